#pragma once

#include <vector>

#include "inertial/history.h"
#include "scanner/core/se3.h"
#include "scanner/inertial/options.h"

namespace scanner::inertial {

/// A registered pose and what was solved for its moment.
struct Anchor {
  Time stamp;
  Eigen::Isometry3d T_map_base = Eigen::Isometry3d::Identity();
  bool solved = false;
  int segment = 0;
  Eigen::Quaterniond R_map_odom = Eigen::Quaterniond::Identity();
  Eigen::Vector3d position_odom = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_map = Eigen::Vector3d::Zero();
  /// Constant error of the acceleration in map, to be added to it (tilt of the map, bias).
  Eigen::Vector3d acceleration_map = Eigen::Vector3d::Zero();
  /// Of position, velocity and acceleration error, alike for the three axes; SI.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  bool still = false;            ///< the sensor stood still at this moment
  bool hold_when_still = false;  ///< and the poses do not speak against it
};

/// Fills in everything but stamp and pose of anchors[index]. The anchors before it are solved, and
/// anchors[index] lies inside the history.
void solveAnchor(const History& history, const InertialOptions& options,
                 std::vector<Anchor>& anchors, std::size_t index);

/// Velocity and position in odom at `stamp`, carried forward from `anchor` (same segment).
Motion carryForward(const History& history, const InertialOptions& options, const Anchor& anchor,
                    Time stamp);

/// Standard deviation of the carried position along one axis, `t` seconds after the anchor, metres.
double carriedSigma(const InertialOptions& options, const Anchor& anchor, double t);

}  // namespace scanner::inertial
