#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <memory>

#include "scanner/core/imu.h"
#include "scanner/core/status.h"
#include "scanner/core/time.h"
#include "scanner/inertial/options.h"

namespace scanner::inertial {

/// Where the sensor is at one moment, in odom: gravity aligned (z up), continuous, drifting.
struct OdometryState {
  Time stamp;
  Eigen::Isometry3d T_odom_base = Eigen::Isometry3d::Identity();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< odom frame, m/s
  bool stationary = false;
  /// One standard deviation per axis of the motion since the last correction (or the start).
  double position_sigma_m = 0.0;
  double rotation_sigma_rad = 0.0;
  /// Counts the gaps before this moment. Two states of different segments have a gap between them:
  /// how the sensor moved in between is not known.
  int segment = 0;
};

struct InertialStatistics {
  std::size_t samples = 0;      ///< accepted
  std::size_t non_finite = 0;   ///< skipped: NaN, infinite, or an orientation that is no rotation
  std::size_t backwards = 0;    ///< skipped: stamp before the last one
  std::size_t duplicates = 0;   ///< skipped: stamp equal to the last one
  std::size_t gaps = 0;         ///< intervals longer than max_gap_s
  double longest_gap_s = 0.0;   ///< of those
  double sample_rate_hz = 0.0;  ///< median, 0 before the first samples are in
  double band_low_hz = 0.0;     ///< edges of the band-pass at that rate
  double band_high_hz = 0.0;
  double duration_s = 0.0;                              ///< first to last accepted sample
  double stationary_s = 0.0;                            ///< time found to be standing still
  bool has_orientation = false;                         ///< the sensor's own orientation is in use
  bool bias_known = false;                              ///< the gyro bias has been estimated
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();  ///< rad/s, base frame
  std::size_t corrections = 0;                          ///< accepted by correct()
  std::size_t corrections_ignored = 0;                  ///< not finite, or outside the history
};

/// Motion from inertial samples (thesis 4.4; method.md section 5): each acceleration is rotated to
/// the world by the orientation of its sample, gravity is removed, the rest band-passed and
/// integrated by Verlet's method. A sensor without orientation is levelled by gravity: roll and
/// pitch start from the mean acceleration of the first `init_s` seconds, yaw starts at 0, the gyro
/// bias is estimated while it stands still.
///
/// What comes out depends on the samples and corrections given, not on when they were given or
/// asked for. The first states, and those behind a gap, are available once `init_s` of samples
/// have come in; they then reach back to the first of those samples.
///
/// Not thread-safe; const methods may be called concurrently.
class InertialOdometry {
 public:
  /// Throws ConfigurationError when options contradict each other.
  explicit InertialOdometry(const InertialOptions& options);
  ~InertialOdometry();
  InertialOdometry(InertialOdometry&&) noexcept;
  InertialOdometry& operator=(InertialOdometry&&) noexcept;

  /// Samples in order of time. kInvalidInput: the sample was counted and skipped, because it is not
  /// finite or its stamp is not after the last one's. kOutOfRange: the sample is used, but it comes
  /// after a gap and integration starts anew, from the last position and at rest.
  Status add(const ImuSample& sample);

  /// State at `stamp`, between samples by interpolation. kNotEnoughData: too few samples so far (at
  /// the start or behind a gap). kOutOfRange: before the first sample, further back than
  /// `history_s`, past the last sample by more than `max_gap_s`, or inside a gap.
  Result<OdometryState> predict(Time stamp) const;

  /// Motion T_from_to between two moments: predict() for both, then relativePrior(). kOutOfRange
  /// also when a gap lies between them.
  Result<Eigen::Isometry3d> prior(Time from, Time to) const;

  /// Pose found by registration for `stamp`. The position in odom stays continuous; with
  /// `use_registration_velocity` the velocity from `stamp` on is the one that explains the latest
  /// `velocity_window_views` poses, given the accelerations between them: least squares for the
  /// last position, the velocity there and one constant error of the acceleration. Accelerations
  /// are turned to map by T_map_base R_odom_base^T at the moment of each pose, so map and odom may
  /// differ in yaw and slightly in tilt. With one pose so far the velocity is zero when standing
  /// still, else that of the stream. While the sensor stands still and the velocity was found to be
  /// next to zero, the position is held. Corrections may come late and in any order; one at a stamp
  /// already given replaces it. One outside the history is counted and ignored.
  void correct(Time stamp, const Eigen::Isometry3d& T_map_base);

  const InertialStatistics& statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// T_from_to, the motion between two states in the base frame of `from`. From rest (thesis) the
/// translation is p_to - p_from - v_from dt: integration is linear, so this is what integrating the
/// interval alone from rest would give. With `use_registration_velocity`, or without
/// `start_from_rest`, the velocity counts. States of different segments have an unknown translation
/// between them: it is left at zero (the rotation holds when the sensor gives its orientation);
/// InertialOdometry::prior() refuses them instead.
Eigen::Isometry3d relativePrior(const OdometryState& from, const OdometryState& to,
                                const InertialOptions& options);

}  // namespace scanner::inertial
