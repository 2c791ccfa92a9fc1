#include "scanner/simulation/imu_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <utility>
#include <vector>

#include "scanner/core/se3.h"
#include "simulation/motion_subjects.h"

namespace scanner::simulation {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kRadians = kPi / 180.0;
const Time kStart = fromNanoseconds(1600000000123456789);

/// Natural-ended cubic spline through equally spaced samples: what lies between samples of a smooth
/// motion. Plain trapezoids at 100 Hz would drift by millimetres.
class Spline {
 public:
  Spline(std::vector<Eigen::Vector3d> values, double interval_s)
      : values_(std::move(values)),
        bends_(values_.size(), Eigen::Vector3d::Zero()),
        h_(interval_s) {
    const std::size_t n = values_.size();
    std::vector<double> diagonal(n, 4.0);
    for (std::size_t i = 1; i + 1 < n; ++i) {
      bends_[i] = 6.0 * (values_[i - 1] - 2.0 * values_[i] + values_[i + 1]) / (h_ * h_);
      if (i > 1) {
        diagonal[i] -= 1.0 / diagonal[i - 1];
        bends_[i] -= bends_[i - 1] / diagonal[i - 1];
      }
    }
    for (std::size_t i = n - 1; i-- > 1;) bends_[i] = (bends_[i] - bends_[i + 1]) / diagonal[i];
  }

  Eigen::Vector3d at(double time_s) const {
    const double x = time_s / h_;
    const std::size_t i = std::min(static_cast<std::size_t>(x), values_.size() - 2);
    const double b = x - static_cast<double>(i);
    const double a = 1.0 - b;
    return a * values_[i] + b * values_[i + 1] +
           h_ * h_ / 6.0 * ((a * a * a - a) * bends_[i] + (b * b * b - b) * bends_[i + 1]);
  }

 private:
  std::vector<Eigen::Vector3d> values_;
  std::vector<Eigen::Vector3d> bends_;
  double h_;
};

/// Dead reckoning from the state at `from_s` on: midpoint attitude, Simpson's rule for the rest.
Eigen::Isometry3d integrate(const std::vector<MtiSample>& samples, const MotionState& start,
                            double from_s, double to_s, double rate_hz) {
  std::vector<Eigen::Vector3d> rates;
  std::vector<Eigen::Vector3d> forces;
  for (const MtiSample& sample : samples) {
    rates.push_back(sample.imu.angular_velocity);
    forces.push_back(sample.imu.linear_acceleration);
  }
  const Spline rate(rates, 1.0 / rate_hz);
  const Spline force(forces, 1.0 / rate_hz);
  const Eigen::Vector3d gravity(0.0, 0.0, -9.82);
  Eigen::Quaterniond q(start.T_map_base.linear());
  Eigen::Vector3d v = start.velocity;
  Eigen::Vector3d p = start.T_map_base.translation();
  constexpr double h = 1e-3;
  const int steps = static_cast<int>(std::lround((to_s - from_s) / h));
  for (int i = 0; i < steps; ++i) {
    const double t = from_s + i * h;
    const Eigen::Quaterniond half = q * expSo3(rate.at(t + 0.25 * h) * 0.5 * h);
    const Eigen::Quaterniond end = half * expSo3(rate.at(t + 0.75 * h) * 0.5 * h);
    const Eigen::Vector3d a0 = q * force.at(t) + gravity;
    const Eigen::Vector3d a1 = half * force.at(t + 0.5 * h) + gravity;
    const Eigen::Vector3d a2 = end * force.at(t + h) + gravity;
    p += h * v + h * h / 6.0 * (a0 + 2.0 * a1);
    v += h / 6.0 * (a0 + 4.0 * a1 + a2);
    q = end.normalized();
  }
  return makePose(p, q);
}

/// Overlapping Allan deviation at averaging time tau.
double allanDeviation(const std::vector<double>& values, double rate_hz, double tau_s) {
  const auto m = static_cast<std::size_t>(std::lround(tau_s * rate_hz));
  std::vector<double> sums = {0.0};
  for (const double value : values) sums.push_back(sums.back() + value);
  double square = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i + 2 * m < sums.size(); ++i, ++count) {
    const double difference =
        (sums[i + 2 * m] - 2.0 * sums[i + m] + sums[i]) / static_cast<double>(m);
    square += difference * difference;
  }
  return std::sqrt(0.5 * square / static_cast<double>(count));
}

TEST(ImuModelTest, NoiseFreeSamplesReproduceTheTrajectory) {
  const ImuOptions options = noiseFree({});
  for (const MotionSubject& subject : {test::statue(), test::pole()}) {
    const auto motion = makeMotion(subject, {}, 1);
    const std::vector<MtiSample> samples = simulateImu(*motion, options, kStart, 1);
    double worst_m = 0.0;
    double worst_deg = 0.0;
    for (const double from_s : {2.0, 8.0, 18.0}) {
      const Eigen::Isometry3d T =
          integrate(samples, motion->at(from_s), from_s, from_s + 10.0, options.rate_hz);
      const Eigen::Isometry3d error = motion->at(from_s + 10.0).T_map_base.inverse() * T;
      worst_m = std::max(worst_m, error.translation().norm());
      worst_deg = std::max(worst_deg, rotationAngle(error) / kRadians);
    }
    std::cout << subject.path << ", 100 Hz splined, 10 s: " << worst_m * 1e3 << " mm, " << worst_deg
              << " deg\n";
    EXPECT_LT(worst_m, 1e-4) << subject.path;
    EXPECT_LT(worst_deg, 1e-3) << subject.path;
  }
}

TEST(ImuModelTest, AtRestItFeelsGravityUpwards) {
  const test::SteadyMotion rest(1.0);
  const std::vector<MtiSample> samples = simulateImu(rest, noiseFree({}), kStart, 1);
  ASSERT_EQ(samples.size(), 101U);
  for (const MtiSample& sample : samples) {
    EXPECT_EQ(sample.imu.angular_velocity, Eigen::Vector3d::Zero());
    EXPECT_EQ(sample.imu.linear_acceleration, Eigen::Vector3d(0.0, 0.0, 9.82));
    EXPECT_LT(angleBetween(*sample.imu.orientation, Eigen::Quaterniond::Identity()), 1e-12);
    // North, and 70 deg down.
    EXPECT_NEAR(sample.magnetic_field.x(), 0.0, 1e-12);
    EXPECT_NEAR(sample.magnetic_field.y(), std::cos(70.0 * kRadians), 1e-12);
    EXPECT_NEAR(sample.magnetic_field.z(), -std::sin(70.0 * kRadians), 1e-12);
    EXPECT_EQ(sample.temperature_c, 24.0);
  }
}

TEST(ImuModelTest, StampsAreExactAndTheCounterWraps) {
  const test::SteadyMotion rest(700.0);
  ImuOptions options = noiseFree({});
  options.rate_hz = 102.0;
  const std::vector<MtiSample> samples = simulateImu(rest, options, kStart, 1);
  ASSERT_GT(samples.size(), 65540U);
  EXPECT_EQ(samples[65535].counter, 65535);
  EXPECT_EQ(samples[65536].counter, 0);
  EXPECT_EQ(samples[51].imu.stamp, kStart + fromSeconds(0.5));
  for (std::size_t i = 0; i < samples.size(); i += 997) {
    EXPECT_EQ(samples[i].imu.stamp, kStart + fromSeconds(static_cast<double>(i) / options.rate_hz));
    EXPECT_EQ(samples[i].truth.stamp, samples[i].imu.stamp);
  }
}

TEST(ImuModelTest, AllanDeviationsMatchTheDensities) {
  const test::SteadyMotion rest(3600.0);
  const ImuOptions options;
  const std::vector<MtiSample> samples = simulateImu(rest, options, kStart, 3);
  for (const double tau_s : {0.1, 0.3, 1.0}) {
    double gyro = 0.0;
    double accelerometer = 0.0;
    double magnetometer = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<double> columns[3];
      for (const MtiSample& sample : samples) {
        columns[0].push_back(sample.imu.angular_velocity[axis] / kRadians);
        columns[1].push_back(sample.imu.linear_acceleration[axis]);
        columns[2].push_back(sample.magnetic_field[axis] * 540.0);
      }
      gyro += allanDeviation(columns[0], options.rate_hz, tau_s) / 3.0;
      accelerometer += allanDeviation(columns[1], options.rate_hz, tau_s) / 3.0;
      magnetometer += allanDeviation(columns[2], options.rate_hz, tau_s) / 3.0;
    }
    const double root = std::sqrt(tau_s);
    std::cout << "Allan deviation x sqrt(" << tau_s << " s): gyro " << gyro * root
              << " deg/s/sqrt(Hz), accelerometer " << accelerometer * root
              << " m/s^2/sqrt(Hz), magnetometer " << magnetometer * root << " mGauss/sqrt(Hz)\n";
    EXPECT_NEAR(gyro * root, 0.1, 0.01);
    EXPECT_NEAR(accelerometer * root, 0.02, 0.002);
    EXPECT_NEAR(magnetometer * root, 0.5, 0.05);
  }
}

TEST(ImuModelTest, BiasAndDriftHaveTheirSize) {
  ImuOptions options = noiseFree({});
  options.gyro_bias_deg_s = 0.3;
  const test::SteadyMotion rest(0.1);
  double square = 0.0;
  constexpr int kSeeds = 400;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const std::vector<MtiSample> samples = simulateImu(rest, options, kStart, seed);
    EXPECT_EQ(samples.front().imu.angular_velocity, samples.back().imu.angular_velocity);
    square += samples[0].imu.angular_velocity.squaredNorm() / (3.0 * kSeeds);
  }
  EXPECT_NEAR(std::sqrt(square) / kRadians, 0.3, 0.03);

  options = noiseFree({});
  options.accel_drift_m_s2 = 0.004;
  options.drift_time_s = 5.0;
  const std::vector<MtiSample> samples =
      simulateImu(test::SteadyMotion(5000.0), options, kStart, 1);
  double power = 0.0;
  double product = 0.0;
  constexpr std::size_t kLag = 500;  // one correlation time
  for (std::size_t i = 0; i + kLag < samples.size(); ++i) {
    const double now = samples[i].imu.linear_acceleration.x();
    power += now * now;
    product += now * samples[i + kLag].imu.linear_acceleration.x();
  }
  EXPECT_NEAR(std::sqrt(power / static_cast<double>(samples.size())), 0.004, 0.0005);
  EXPECT_NEAR(product / power, std::exp(-1.0), 0.1);
}

TEST(ImuModelTest, ScaleAndMisalignmentActOnTheInput) {
  test::SteadyMotion turning(0.1);
  turning.turn_rate = {2.0, 0.0, 0.0};
  ImuOptions options = noiseFree({});
  options.scale_percent = 1.0;
  options.misalignment_deg = 0.5;
  double scale = 0.0;
  double across = 0.0;
  constexpr int kSeeds = 400;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const Eigen::Vector3d rate =
        simulateImu(turning, options, kStart, seed)[0].imu.angular_velocity / 2.0;
    scale += std::pow(rate.x() - 1.0, 2) / kSeeds;
    across += 0.5 * rate.tail<2>().squaredNorm() / kSeeds;
  }
  EXPECT_NEAR(std::sqrt(scale), 0.01, 0.001);
  EXPECT_NEAR(std::sqrt(across), 0.5 * kRadians, 0.001);
}

TEST(ImuModelTest, BandwidthIsHalfPowerAtItsEdge) {
  ImuOptions options = noiseFree({});
  options.bandwidth_hz = 40.0;
  options.rate_hz = 500.0;
  const auto gain = [&](double frequency_hz) {
    test::SteadyMotion shaking(4.0);
    shaking.shake = {3.0, 0.0, 0.0};
    shaking.shake_hz = frequency_hz;
    double square = 0.0;
    double count = 0.0;
    for (const MtiSample& sample : simulateImu(shaking, options, kStart, 1)) {
      if (sample.time_s < 1.0) continue;
      square += std::pow(sample.imu.linear_acceleration.x(), 2);
      count += 1.0;
    }
    return std::sqrt(2.0 * square / count) / 3.0;
  };
  EXPECT_NEAR(gain(4.0), 1.0, 0.01);
  EXPECT_NEAR(gain(40.0), std::sqrt(0.5), 0.01);
  EXPECT_NEAR(gain(160.0), 1.0 / 16.0, 0.01);
}

TEST(ImuModelTest, SaturatesAtTheRangeOfTheDevice) {
  test::SteadyMotion wild(0.5);
  wild.turn_rate = {0.0, 0.0, 2000.0 * kRadians};
  wild.shake = {0.0, 0.0, 500.0};
  wild.shake_hz = 2.0;
  double highest = 0.0;
  for (const MtiSample& sample : simulateImu(wild, noiseFree({}), kStart, 1)) {
    EXPECT_NEAR(sample.imu.angular_velocity.z(), 1200.0 * kRadians, 1e-9);
    EXPECT_NEAR(sample.truth.angular_velocity.z(), 2000.0 * kRadians, 1e-9);
    highest = std::max(highest, sample.imu.linear_acceleration.z());
  }
  EXPECT_EQ(highest, 50.0);
}

/// RMS of the attitude error, deg: east, north (tilt) and up (heading).
Eigen::Vector3d attitudeError(const std::vector<MtiSample>& samples) {
  Eigen::Vector3d square = Eigen::Vector3d::Zero();
  for (const MtiSample& sample : samples) {
    const Eigen::Vector3d error =
        logSo3(*sample.imu.orientation * sample.truth.orientation->conjugate()) / kRadians;
    square += error.cwiseAbs2() / static_cast<double>(samples.size());
  }
  return square.cwiseSqrt();
}

TEST(ImuModelTest, AttitudeAtRestIsWithinTheSpecificationAndDoesNotDrift) {
  const std::vector<MtiSample> samples = simulateImu(test::SteadyMotion(4000.0), {}, kStart, 1);
  const std::size_t half = samples.size() / 2;
  for (const std::vector<MtiSample>& part :
       {std::vector<MtiSample>(samples.begin(), samples.begin() + static_cast<long>(half)),
        std::vector<MtiSample>(samples.begin() + static_cast<long>(half), samples.end())}) {
    const Eigen::Vector3d error = attitudeError(part);
    EXPECT_NEAR(error.x(), 0.25, 0.06);
    EXPECT_NEAR(error.y(), 0.25, 0.06);
    EXPECT_NEAR(error.z(), 0.5, 0.12);
  }
  // Correlated: hardly any jitter from sample to sample.
  for (std::size_t i = 1; i < samples.size(); ++i) {
    ASSERT_LT(angleBetween(*samples[i].imu.orientation, *samples[i - 1].imu.orientation),
              0.05 * kRadians);
  }
}

TEST(ImuModelTest, AttitudeInMotionIsWorseButWithinTheSpecification) {
  const auto motion = makeMotion(test::statue(), {}, 1);
  double square = 0.0;
  constexpr int kSeeds = 20;
  for (int seed = 0; seed < kSeeds; ++seed) {
    square += attitudeError(simulateImu(*motion, {}, kStart, seed)).squaredNorm() / kSeeds;
  }
  std::cout << "attitude error in motion: " << std::sqrt(square) << " deg RMS\n";
  EXPECT_GT(std::sqrt(square), 0.8);
  EXPECT_LT(std::sqrt(square), 2.0);
}

TEST(ImuModelTest, SameSeedSameBits) {
  const auto motion = makeMotion(test::statue(), {}, 1);
  const std::vector<MtiSample> a = simulateImu(*motion, {}, kStart, 7);
  const std::vector<MtiSample> b = simulateImu(*motion, {}, kStart, 7);
  const std::vector<MtiSample> c = simulateImu(*motion, {}, kStart, 8);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].imu.angular_velocity, b[i].imu.angular_velocity);
    ASSERT_EQ(a[i].imu.linear_acceleration, b[i].imu.linear_acceleration);
    ASSERT_EQ(a[i].imu.orientation->coeffs(), b[i].imu.orientation->coeffs());
    ASSERT_EQ(a[i].magnetic_field, b[i].magnetic_field);
  }
  EXPECT_NE(a[0].imu.angular_velocity, c[0].imu.angular_velocity);
}

TEST(ImuModelTest, TruthHasNoError) {
  const auto motion = makeMotion(test::statue(), {}, 1);
  const std::vector<MtiSample> noisy = simulateImu(*motion, {}, kStart, 7);
  const std::vector<MtiSample> clean = simulateImu(*motion, noiseFree({}), kStart, 9);
  for (std::size_t i = 0; i < noisy.size(); ++i) {
    ASSERT_EQ(noisy[i].truth.angular_velocity, clean[i].imu.angular_velocity);
    ASSERT_EQ(noisy[i].truth.linear_acceleration, clean[i].imu.linear_acceleration);
    ASSERT_LT(angleBetween(*noisy[i].truth.orientation, *clean[i].imu.orientation), 1e-9);
  }
}

}  // namespace
}  // namespace scanner::simulation
