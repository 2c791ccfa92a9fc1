#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

#include "scanner/core/time.h"

namespace scanner {

/// One sample of the inertial sensor, in its own frame (base_link).
struct ImuSample {
  Time stamp;
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();     ///< rad/s
  Eigen::Vector3d linear_acceleration = Eigen::Vector3d::Zero();  ///< m/s^2, gravity included
  /// R_world_base from the sensor's own filter, world = ENU, z up. Absent on a plain IMU.
  std::optional<Eigen::Quaterniond> orientation;
};

}  // namespace scanner
