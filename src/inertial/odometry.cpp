#include "scanner/inertial/odometry.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "inertial/history.h"
#include "inertial/rest_monitor.h"
#include "inertial/velocity_solver.h"
#include "scanner/core/se3.h"
#include "scanner/inertial/attitude.h"
#include "scanner/inertial/butterworth.h"
#include "scanner/inertial/verlet.h"

namespace scanner::inertial {

namespace {

// Published accuracy of the sensor (method.md section 1) and of the prior (thesis table 5.3: 9.9 cm
// over one interval of 0.55 s); they only scale the sigmas of a state.
constexpr double kStreamVelocitySigma = 0.18;  // m/s
constexpr double kOrientationSigma = 0.035;    // rad, 2 deg RMS in motion
constexpr double kGyroNoise = 0.0017;          // rad/s/sqrt(Hz), 0.1 deg/s/sqrt(Hz)
constexpr double kLevellingSigma = 0.0087;     // rad, 0.5 deg

bool isUsable(const ImuSample& s) {
  if (!s.angular_velocity.allFinite() || !s.linear_acceleration.allFinite()) return false;
  if (!s.orientation) return true;
  const double norm = s.orientation->norm();
  return std::isfinite(norm) && std::abs(norm - 1.0) < 0.05;
}

std::string seconds(Duration d) { return std::to_string(toSeconds(d)) + " s"; }

}  // namespace

class InertialOdometry::Impl {
 public:
  explicit Impl(const InertialOptions& options)
      : options_(options),
        filter_(options.band_low, options.band_high),
        attitude_(options),
        rest_(options) {
    validate(options);
  }

  Status add(const ImuSample& sample);
  Result<OdometryState> predict(Time stamp) const;
  void correct(Time stamp, const Eigen::Isometry3d& T_map_base);
  const InertialOptions& options() const { return options_; }
  const InertialStatistics& statistics() const { return statistics_; }

 private:
  void startSegment();
  void initialise();
  void process(const ImuSample& sample, const ImuSample* previous);
  Eigen::Quaterniond updateAttitude(const ImuSample& sample, const ImuSample* previous,
                                    AttitudeFilter& attitude) const;
  void prune();
  void refreshAnchors();
  void updateRate();
  Status available(Time stamp) const;
  const Anchor* anchorBefore(Time stamp, int segment) const;
  void addSigmas(OdometryState& state) const;
  Duration maxGap() const { return fromSeconds(options_.max_gap_s); }

  InertialOptions options_;
  InertialStatistics statistics_;
  History history_;
  std::vector<Anchor> anchors_;  // by stamp; solved up to the last sample

  // Of the running segment.
  bool initialised_ = false;
  int segment_ = 0;
  std::deque<ImuSample> pending_;  // samples of a segment not yet initialised
  std::deque<Time> stamps_;        // latest stamps, for the rate
  ButterworthBandPass filter_;
  VerletIntegrator verlet_;
  AttitudeFilter attitude_;
  RestMonitor rest_;
  ImuSample last_;  // last accepted sample
  bool has_last_ = false;
  Time first_stamp_;
};

Status InertialOdometry::Impl::add(const ImuSample& sample) {
  if (!isUsable(sample)) {
    ++statistics_.non_finite;
    return {StatusCode::kInvalidInput,
            "inertial sample is not finite or its orientation no rotation"};
  }
  Status status;
  if (has_last_) {
    const Duration step = sample.stamp - last_.stamp;
    if (step.count() == 0) {
      ++statistics_.duplicates;
      return {StatusCode::kInvalidInput, "inertial sample has the stamp of the one before it"};
    }
    if (step.count() < 0) {
      ++statistics_.backwards;
      return {StatusCode::kInvalidInput,
              "inertial sample is " + seconds(-step) + " before the last"};
    }
    if (step > maxGap()) {
      ++statistics_.gaps;
      statistics_.longest_gap_s = std::max(statistics_.longest_gap_s, toSeconds(step));
      status = {StatusCode::kOutOfRange,
                "gap of " + seconds(step) + " in the inertial samples, integration starts anew"};
      startSegment();
    }
  } else {
    first_stamp_ = sample.stamp;
  }
  ++statistics_.samples;
  statistics_.duration_s = toSeconds(sample.stamp - first_stamp_);
  stamps_.push_back(sample.stamp);
  if (stamps_.size() > 201) stamps_.pop_front();

  if (initialised_) {
    process(sample, &last_);
    if (statistics_.samples % 50 == 0) updateRate();
  } else {
    pending_.push_back(sample);
    if (sample.stamp - pending_.front().stamp >= fromSeconds(options_.init_s)) initialise();
  }
  last_ = sample;
  has_last_ = true;
  if (initialised_) {
    prune();
    refreshAnchors();
  }
  return status;
}

void InertialOdometry::Impl::startSegment() {
  ++segment_;
  initialised_ = false;
  pending_.clear();
  stamps_.clear();
}

void InertialOdometry::Impl::updateRate() {
  statistics_.sample_rate_hz = estimateSampleRate({stamps_.begin(), stamps_.end()});
  statistics_.band_low_hz = options_.band_low * statistics_.sample_rate_hz / 2.0;
  statistics_.band_high_hz = options_.band_high * statistics_.sample_rate_hz / 2.0;
}

void InertialOdometry::Impl::initialise() {
  updateRate();
  rest_.start(pending_);
  const ImuSample& first = pending_.front();
  statistics_.has_orientation = first.orientation.has_value();

  // Attitude at the first sample: the sensor's own, or level by the mean specific force, gathered
  // in the base frame of the first sample.
  if (first.orientation) {
    attitude_.reset(*first.orientation);
  } else {
    AttitudeFilter gyro_only(options_);
    Eigen::Vector3d sum = first.linear_acceleration;
    for (std::size_t i = 1; i < pending_.size(); ++i) {
      const ImuSample& a = pending_[i - 1];
      const ImuSample& b = pending_[i];
      gyro_only.propagate(0.5 * (a.angular_velocity + b.angular_velocity) - rest_.gyroBias(),
                          toSeconds(b.stamp - a.stamp));
      sum += gyro_only.orientation() * b.linear_acceleration;
    }
    const double yaw =
        history_.empty()
            ? 0.0
            : rollPitchYaw(history_.entries().back().R_odom_base.toRotationMatrix()).z();
    attitude_.reset(levelFromGravity(sum, yaw));
  }

  // The mean acceleration of these samples is what the band-pass starts from.
  AttitudeFilter attitude = attitude_;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < pending_.size(); ++i) {
    mean += updateAttitude(pending_[i], i > 0 ? &pending_[i - 1] : nullptr, attitude) *
            pending_[i].linear_acceleration;
  }
  mean /= static_cast<double>(pending_.size());
  filter_.resetToSteadyState(mean - options_.gravity_mps2 * Eigen::Vector3d::UnitZ());

  initialised_ = true;
  const std::deque<ImuSample> samples = std::exchange(pending_, {});
  for (std::size_t i = 0; i < samples.size(); ++i) {
    process(samples[i], i > 0 ? &samples[i - 1] : nullptr);
  }
}

Eigen::Quaterniond InertialOdometry::Impl::updateAttitude(const ImuSample& sample,
                                                          const ImuSample* previous,
                                                          AttitudeFilter& attitude) const {
  if (previous == nullptr) return attitude.orientation();
  const double dt = toSeconds(sample.stamp - previous->stamp);
  attitude.propagate(
      0.5 * (previous->angular_velocity + sample.angular_velocity) - rest_.gyroBias(), dt);
  if (sample.orientation) {
    attitude.correctByOrientation(*sample.orientation, dt);
  } else {
    attitude.correctByGravity(sample.linear_acceleration, dt);
  }
  return attitude.orientation();
}

// `previous` is null for the first sample of a segment.
void InertialOdometry::Impl::process(const ImuSample& sample, const ImuSample* previous) {
  HistoryEntry entry;
  entry.stamp = sample.stamp;
  entry.segment = segment_;
  entry.R_odom_base = updateAttitude(sample, previous, attitude_);
  entry.rate = sample.angular_velocity - rest_.gyroBias();
  entry.force = entry.R_odom_base * sample.linear_acceleration;
  const Eigen::Vector3d acceleration =
      filter_.filter(entry.force - options_.gravity_mps2 * Eigen::Vector3d::UnitZ());
  if (previous == nullptr) {
    verlet_ = VerletIntegrator(verlet_.position(), Eigen::Vector3d::Zero(), acceleration);
  } else {
    verlet_.advance(toSeconds(sample.stamp - previous->stamp), acceleration);
  }
  entry.position = verlet_.position();
  entry.velocity = verlet_.velocity();
  entry.acceleration = acceleration;
  history_.entries().push_back(entry);

  if (const auto still_since = rest_.add(sample)) {
    // The whole window was still, not only its end.
    auto& entries = history_.entries();
    for (auto e = entries.rbegin(); e != entries.rend() && e->stamp >= *still_since; ++e) {
      e->still = true;
    }
  }
  statistics_.gyro_bias = rest_.gyroBias();
  statistics_.bias_known = rest_.biasKnown();
  statistics_.stationary_s = rest_.stationarySeconds();
}

// Twice the history is kept, so that every stamp in it still finds the correction before it.
void InertialOdometry::Impl::prune() {
  auto& entries = history_.entries();
  const Time limit = entries.back().stamp - fromSeconds(2.0 * options_.history_s);
  while (entries.size() > 1 && entries.front().stamp < limit) entries.pop_front();
  const Time front = entries.front().stamp;
  const auto outside = std::find_if(anchors_.begin(), anchors_.end(),
                                    [&](const Anchor& a) { return a.stamp >= front; });
  anchors_.erase(anchors_.begin(), outside);
}

void InertialOdometry::Impl::refreshAnchors() {
  for (std::size_t i = 0; i < anchors_.size(); ++i) {
    if (anchors_[i].solved) continue;
    if (anchors_[i].stamp > history_.entries().back().stamp) return;
    solveAnchor(history_, options_, anchors_, i);
  }
}

void InertialOdometry::Impl::correct(Time stamp, const Eigen::Isometry3d& T_map_base) {
  const bool known = !history_.empty() && stamp >= history_.entries().front().stamp &&
                     stamp <= last_.stamp + maxGap() && !history_.inGap(stamp);
  if (!known || !isFinite(T_map_base)) {
    ++statistics_.corrections_ignored;
    return;
  }
  ++statistics_.corrections;
  auto place = std::lower_bound(anchors_.begin(), anchors_.end(), stamp,
                                [](const Anchor& a, Time t) { return a.stamp < t; });
  if (place == anchors_.end() || place->stamp != stamp) place = anchors_.insert(place, Anchor());
  *place = Anchor();
  place->stamp = stamp;
  place->T_map_base = T_map_base;
  for (; place != anchors_.end(); ++place) place->solved = false;
  refreshAnchors();
}

Status InertialOdometry::Impl::available(Time stamp) const {
  if (!has_last_) return {StatusCode::kNotEnoughData, "no inertial samples yet"};
  if (stamp < first_stamp_) {
    return {StatusCode::kOutOfRange,
            "stamp is " + seconds(first_stamp_ - stamp) + " before the first inertial sample"};
  }
  if (stamp > last_.stamp + maxGap()) {
    return {StatusCode::kOutOfRange,
            "stamp is " + seconds(stamp - last_.stamp) + " past the last inertial sample"};
  }
  if (stamp < last_.stamp - fromSeconds(options_.history_s)) {
    return {StatusCode::kOutOfRange,
            "stamp is " + seconds(last_.stamp - stamp) + " back, further than history_s"};
  }
  if (!pending_.empty() && stamp >= pending_.front().stamp) {
    return {StatusCode::kNotEnoughData,
            "only " + seconds(pending_.back().stamp - pending_.front().stamp) +
                " of inertial samples since the start or a gap, init_s not reached"};
  }
  const bool behind_last =
      !pending_.empty() && !history_.empty() && stamp > history_.entries().back().stamp;
  if (history_.empty() || stamp < history_.entries().front().stamp || behind_last ||
      history_.inGap(stamp)) {
    return {StatusCode::kOutOfRange, "stamp lies in a gap of the inertial samples"};
  }
  return Status::ok();
}

const Anchor* InertialOdometry::Impl::anchorBefore(Time stamp, int segment) const {
  const Anchor* found = nullptr;
  for (const Anchor& a : anchors_) {
    if (a.solved && a.stamp <= stamp && a.segment == segment) found = &a;
  }
  return found;
}

void InertialOdometry::Impl::addSigmas(OdometryState& state) const {
  const Anchor* anchor = anchorBefore(state.stamp, state.segment);
  const Time since = anchor != nullptr ? anchor->stamp : history_.entries().front().stamp;
  const double t = toSeconds(state.stamp - since);
  if (anchor != nullptr && options_.use_registration_velocity) {
    state.position_sigma_m = carriedSigma(options_, *anchor, t);
  } else {
    state.position_sigma_m = std::hypot(options_.registration_sigma_m, kStreamVelocitySigma * t);
  }
  const double gyro = kGyroNoise * std::sqrt(t);
  if (!statistics_.has_orientation) {
    state.rotation_sigma_rad = std::hypot(kLevellingSigma, gyro);
  } else if (options_.orientation_time_constant_s > 0.0) {
    state.rotation_sigma_rad = std::min(kOrientationSigma, std::hypot(kLevellingSigma, gyro));
  } else {
    state.rotation_sigma_rad = state.stationary ? kLevellingSigma : kOrientationSigma;
  }
}

Result<OdometryState> InertialOdometry::Impl::predict(Time stamp) const {
  const Status status = available(stamp);
  if (!status) return status;
  const HistoryEntry entry = history_.at(stamp);
  OdometryState state;
  state.stamp = stamp;
  state.segment = entry.segment;
  state.stationary = entry.still;
  state.velocity = entry.velocity;
  Eigen::Vector3d position = entry.position;
  if (options_.use_registration_velocity) {
    if (const Anchor* anchor = anchorBefore(stamp, entry.segment)) {
      const Motion motion = carryForward(history_, options_, *anchor, stamp);
      position = motion.displacement;
      state.velocity = motion.velocity;
    }
  }
  state.T_odom_base = makePose(position, entry.R_odom_base);
  addSigmas(state);
  return state;
}

InertialOdometry::InertialOdometry(const InertialOptions& options)
    : impl_(std::make_unique<Impl>(options)) {}
InertialOdometry::~InertialOdometry() = default;
InertialOdometry::InertialOdometry(InertialOdometry&&) noexcept = default;
InertialOdometry& InertialOdometry::operator=(InertialOdometry&&) noexcept = default;

Status InertialOdometry::add(const ImuSample& sample) { return impl_->add(sample); }
Result<OdometryState> InertialOdometry::predict(Time stamp) const { return impl_->predict(stamp); }
void InertialOdometry::correct(Time stamp, const Eigen::Isometry3d& T_map_base) {
  impl_->correct(stamp, T_map_base);
}
const InertialStatistics& InertialOdometry::statistics() const { return impl_->statistics(); }

Result<Eigen::Isometry3d> InertialOdometry::prior(Time from, Time to) const {
  const Result<OdometryState> a = predict(from);
  if (!a) return a.status();
  const Result<OdometryState> b = predict(to);
  if (!b) return b.status();
  if (a->segment != b->segment) {
    return Status(StatusCode::kOutOfRange, "a gap of the inertial samples lies between the stamps");
  }
  return relativePrior(*a, *b, impl_->options());
}

Eigen::Isometry3d relativePrior(const OdometryState& from, const OdometryState& to,
                                const InertialOptions& options) {
  Eigen::Isometry3d T_from_to = from.T_odom_base.inverse(Eigen::Isometry) * to.T_odom_base;
  if (from.segment != to.segment) {
    T_from_to.translation().setZero();
  } else if (options.start_from_rest && !options.use_registration_velocity) {
    const double dt = toSeconds(to.stamp - from.stamp);
    T_from_to.translation() -= from.T_odom_base.linear().transpose() * from.velocity * dt;
  }
  return T_from_to;
}

}  // namespace scanner::inertial
