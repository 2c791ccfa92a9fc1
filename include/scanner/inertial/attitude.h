#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "scanner/inertial/options.h"

namespace scanner::inertial {

/// Orientation that brings the mean specific force `f` (m/s^2, base frame) to the world's z axis,
/// with yaw 0 (x of base in the half plane of positive world x) plus `yaw` rad. f must not be zero.
Eigen::Quaterniond levelFromGravity(const Eigen::Vector3d& f, double yaw = 0.0);

/// Attitude R_world_base by integration of the gyro (complementary filter). World: z up. What keeps
/// it from drifting is either the sensor's own orientation or, without one, gravity: roll and pitch
/// then stay, yaw drifts with what is left of the gyro bias.
class AttitudeFilter {
 public:
  explicit AttitudeFilter(const InertialOptions& options) : options_(options) {}

  void reset(const Eigen::Quaterniond& R_world_base) { q_ = R_world_base.normalized(); }
  /// `rate`: mean angular velocity over the last `dt` seconds, without bias, rad/s.
  void propagate(const Eigen::Vector3d& rate, double dt);
  /// Pulls towards the sensor's orientation, or takes it as it is (orientation_time_constant_s 0).
  void correctByOrientation(const Eigen::Quaterniond& R_world_base, double dt);
  /// Pulls towards level. Specific forces that differ from gravity by more than a tenth are motion
  /// and are passed over.
  void correctByGravity(const Eigen::Vector3d& specific_force, double dt);

  const Eigen::Quaterniond& orientation() const { return q_; }

 private:
  InertialOptions options_;
  Eigen::Quaterniond q_ = Eigen::Quaterniond::Identity();
};

}  // namespace scanner::inertial
