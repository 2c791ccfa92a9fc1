#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "scanner/evaluation/pose_error.h"
#include "scanner/simulation/motion.h"
#include "scanner/simulation/random.h"

namespace scanner::simulation {

/// Where the raw left camera is, and where it looks, at one of the equal intervals of a path.
struct CameraKnot {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< map, m
  double heading = 0.0;  ///< azimuth of the optical axis, rad; not wrapped
  double tilt = 0.0;     ///< of the optical axis below the horizon, rad
  double roll = 0.0;     ///< about the optical axis, rad
};

/// Published figures of the step from one picture to the next (thesis table 5.2, last rows).
struct StepTargets {
  double rho_m = 0.0993;
  double rho_sigma_m = 0.0311;
  double arc_deg = 8.7313;
  double arc_sigma_deg = 4.4186;
  double rate_hz = 1.82;  ///< of the pictures (method.md section 1)
  int steps = 49;
};

/// A path of `steps` steps, so steps + 1 knots, tremor not included.
struct PathRequest {
  const MotionSubject& subject;
  int steps = 0;
  bool uneven = true;  ///< steps of unequal length
  std::uint64_t seed = 0;
};

/// Closed loop round the subject in 49 steps; fewer steps give part of it, more go on. Steps have
/// the published mean and spread as far as the size of the subject allows it.
std::vector<CameraKnot> orbitPath(const PathRequest& request);
/// Up along the left, down the centre, up along the right of the subject's south side, as thesis
/// 5.4 has it; fewer than 49 steps give the first part.
std::vector<CameraKnot> passesPath(const PathRequest& request);

/// Orientation of the optical frame (x right, y down, z forward) in the map.
Eigen::Matrix3d cameraOrientation(double heading, double tilt, double roll);
/// Statistics of the steps of base_link along the knots.
evaluation::MotionSummary stepStatistics(const std::vector<CameraKnot>& knots,
                                         const Eigen::Isometry3d& T_base_camera);

/// Numbers of mean 0 and standard deviation 1 whose neighbours have the given correlation, none
/// beyond +-`limit`.
std::vector<double> wander(int count, double correlation, double limit, Random& random);
/// Shifts and scales to mean 0 and standard deviation 1. Equal numbers become 0.
void standardize(std::vector<double>& values);
/// Cumulative lengths of `steps` steps, from 0 to 1; `spread` is their relative deviation, `unit`
/// standardized numbers that say which are long.
std::vector<double> placesAlongPath(const std::vector<double>& unit, double spread);

}  // namespace scanner::simulation
