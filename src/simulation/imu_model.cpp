#include "scanner/simulation/imu_model.h"

#include <algorithm>
#include <cmath>

#include "scanner/core/se3.h"
#include "simulation/sensor_errors.h"

namespace scanner::simulation {
namespace {

constexpr double kRadians = 3.14159265358979323846 / 180.0;
constexpr double kMaxAcceleration = 50.0;       // m/s^2 (method.md section 1)
constexpr double kMaxRate = 1200.0 * kRadians;  // rad/s
constexpr double kEarthField_mgauss = 540.0;    // what 1 stands for in Ottawa

Vector6 ratesAndForces(const MotionState& state, double gravity) {
  const Eigen::Vector3d up(0.0, 0.0, gravity);
  Vector6 v;
  v << state.angular_velocity, state.T_map_base.linear().transpose() * (state.acceleration + up);
  return v;
}

/// What gyro and accelerometer feel through their limited bandwidth.
class BandLimited {
 public:
  BandLimited(const Motion& motion, const ImuOptions& options)
      : motion_(motion),
        gravity_(options.gravity),
        substeps_(substeps(options)),
        internal_rate_hz_(options.rate_hz * substeps_),
        low_pass_(options.bandwidth_hz, internal_rate_hz_, feel(0)) {}

  /// In order, from 0.
  Vector6 sample(int index) {
    Vector6 out = low_pass_.add(feel(next_++));
    while (next_ <= static_cast<std::int64_t>(index) * substeps_)
      out = low_pass_.add(feel(next_++));
    return out;
  }

 private:
  static int substeps(const ImuOptions& options) {
    constexpr double kOversampling = 10.0;  // of the rate and of the edge
    return static_cast<int>(
        std::ceil(kOversampling * std::max(1.0, options.bandwidth_hz / options.rate_hz)));
  }
  Vector6 feel(std::int64_t step) const {
    return ratesAndForces(motion_.at(static_cast<double>(step) / internal_rate_hz_), gravity_);
  }

  const Motion& motion_;
  double gravity_;
  int substeps_;
  double internal_rate_hz_;
  LowPass low_pass_;
  std::int64_t next_ = 0;
};

/// One triad of gyros or accelerometers: scale, misalignment, bias, drift, white noise.
class Triad {
 public:
  struct Errors {
    double scale;
    double misalignment_rad;
    double bias;
    double drift;
    double drift_time_s;
    double noise;  ///< per square root of Hz
    double limit;
  };

  Triad(const Errors& errors, double rate_hz, std::uint64_t seed)
      : errors_(errors),
        random_(seed),
        response_(Eigen::Matrix3d::Identity()),
        drift_(errors.drift_time_s, 1.0 / rate_hz, random_),
        noise_(errors.noise * std::sqrt(rate_hz)) {
    for (int row = 0; row < 3; ++row) {
      for (int col = 0; col < 3; ++col) {
        response_(row, col) +=
            (row == col ? errors.scale : errors.misalignment_rad) * random_.normal();
      }
    }
    bias_ = errors.bias * normalVector(random_);
  }

  Eigen::Vector3d measure(const Eigen::Vector3d& input) {
    const Eigen::Vector3d drift = errors_.drift * drift_.next(random_);
    const Eigen::Vector3d noise = noise_ * normalVector(random_);
    const Eigen::Vector3d value = response_ * input + bias_ + drift + noise;
    return value.cwiseMax(-errors_.limit).cwiseMin(errors_.limit);
  }

 private:
  Errors errors_;
  Random random_;
  Eigen::Matrix3d response_;
  GaussMarkov drift_;
  double noise_;
  Eigen::Vector3d bias_ = Eigen::Vector3d::Zero();
};

/// Attitude as the sensor's own filter gives it: it neither drifts nor jitters, but is off, and the
/// more so the quicker it is moved.
class AttitudeFilter {
 public:
  AttitudeFilter(const ImuOptions& options, std::uint64_t seed)
      : random_(seed),
        interval_s_(1.0 / options.rate_hz),
        at_rest_(options.attitude_time_s, interval_s_, random_),
        in_motion_(options.attitude_time_s, interval_s_, random_),
        dynamic_(options.attitude_dynamic_deg * kRadians) {
    static_ << options.attitude_static_deg, options.attitude_static_deg, options.heading_static_deg;
    static_ *= kRadians;
  }

  Eigen::Quaterniond measure(const MotionState& state) {
    // Approaches 1 in the motion of a scan; follows it as slowly as the filter does.
    constexpr double kQuickRate = 10.0 * kRadians;
    constexpr double kQuickAcceleration = 1.0;
    constexpr double kFollow_s = 1.0;
    const double quick =
        state.angular_velocity.norm() / kQuickRate + state.acceleration.norm() / kQuickAcceleration;
    intensity_ += (1.0 - std::exp(-quick) - intensity_) * std::min(1.0, interval_s_ / kFollow_s);
    const Eigen::Vector3d error = static_.cwiseProduct(at_rest_.next(random_)) +
                                  dynamic_ * intensity_ * in_motion_.next(random_);
    return expSo3(error) * Eigen::Quaterniond(state.T_map_base.linear());
  }

 private:
  Random random_;
  double interval_s_;
  SmoothDrift at_rest_;
  SmoothDrift in_motion_;
  Eigen::Vector3d static_;
  double dynamic_;
  double intensity_ = 0.0;
};

Triad makeGyro(const ImuOptions& o, std::uint64_t seed) {
  return Triad({o.scale_percent * 0.01, o.misalignment_deg * kRadians, o.gyro_bias_deg_s * kRadians,
                o.gyro_drift_deg_s * kRadians, o.drift_time_s, o.gyro_noise_deg_s_sqrthz * kRadians,
                kMaxRate},
               o.rate_hz, seed);
}

Triad makeAccelerometer(const ImuOptions& o, std::uint64_t seed) {
  return Triad({o.scale_percent * 0.01, o.misalignment_deg * kRadians, o.accel_bias_m_s2,
                o.accel_drift_m_s2, o.drift_time_s, o.accel_noise_m_s2_sqrthz, kMaxAcceleration},
               o.rate_hz, seed);
}

/// Of q and -q the one that continues `last`, so that a plot of the components is smooth.
Eigen::Quaterniond continued(Eigen::Quaterniond q, const Eigen::Quaterniond& last) {
  if (q.dot(last) < 0.0) q.coeffs() = -q.coeffs();
  return q;
}

}  // namespace

std::vector<MtiSample> simulateImu(const Motion& motion, const ImuOptions& options, Time start,
                                   int seed) {
  const auto stream = [&](std::uint64_t n) { return mixSeed(static_cast<std::uint64_t>(seed), n); };
  Triad gyro = makeGyro(options, stream(1));
  Triad accelerometer = makeAccelerometer(options, stream(2));
  AttitudeFilter attitude(options, stream(3));
  Random magnetic(stream(4));
  const bool filtered = options.bandwidth_hz > 0.0;
  BandLimited felt(motion, filtered ? options : ImuOptions());
  const double dip = options.magnetic_dip_deg * kRadians;
  const Eigen::Vector3d field(0.0, std::cos(dip), -std::sin(dip));
  const double field_noise =
      options.mag_noise_mgauss_sqrthz * std::sqrt(options.rate_hz) / kEarthField_mgauss;

  std::vector<MtiSample> samples;
  Eigen::Quaterniond last = Eigen::Quaterniond::Identity();
  Eigen::Quaterniond last_true = last;
  constexpr double kRounding = 1e-9;
  const int count = static_cast<int>(motion.duration() * options.rate_hz + kRounding) + 1;
  for (int i = 0; i < count; ++i) {
    MtiSample sample;
    sample.time_s = i / options.rate_hz;
    sample.counter = static_cast<std::uint16_t>(i & 0xffff);
    const MotionState state = motion.at(sample.time_s);
    const Vector6 exact = ratesAndForces(state, options.gravity);
    const Vector6 input = filtered ? felt.sample(i) : exact;
    const Eigen::Matrix3d R_base_map = state.T_map_base.linear().transpose();

    last = continued(attitude.measure(state), last);
    last_true = continued(Eigen::Quaterniond(state.T_map_base.linear()), last_true);
    const Time stamp = start + fromSeconds(sample.time_s);
    sample.imu = {stamp, gyro.measure(input.head<3>()), accelerometer.measure(input.tail<3>()),
                  last};
    sample.truth = {stamp, exact.head<3>(), exact.tail<3>(), last_true};
    sample.magnetic_field = R_base_map * field + field_noise * normalVector(magnetic);
    sample.temperature_c = options.temperature_c;
    samples.push_back(sample);
  }
  return samples;
}

}  // namespace scanner::simulation
