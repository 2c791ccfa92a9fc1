#pragma once

#include <Eigen/Geometry>

#include "scanner/core/camera.h"
#include "scanner/core/image.h"
#include "scanner/core/imu.h"
#include "scanner/core/se3.h"

namespace scanner::test {

/// A small rig with exact truth for pipeline tests: a bumpy ball of 0.4 m with a solid texture at
/// the origin of the map, seen from an orbit of 0.7 m radius in the plane z = 0, starting from rest
/// and speeding up smoothly. Base and left camera are turned against each other. Images are
/// ray-cast without noise, already rectified.
class SyntheticRig {
 public:
  SyntheticRig();

  const StereoCalibration& calibration() const { return calibration_; }
  const Rig& rig() const { return rig_; }
  /// T_map_base, twice continuously differentiable in time.
  Eigen::Isometry3d pose(double seconds) const;
  static Time stamp(double seconds);
  /// Ideal sample: rates and specific force by the closed forms of the motion, true orientation.
  ImuSample imu(double seconds) const;
  StereoFrame frame(double seconds) const;
  /// Signed distance of a map point from the ball's surface, metres (first order).
  static double surfaceDistance(const Eigen::Vector3d& p);

 private:
  cv::Mat render(const Eigen::Isometry3d& T_map_camera) const;

  StereoCalibration calibration_;
  Rig rig_;
};

}  // namespace scanner::test
