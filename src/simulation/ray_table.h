#pragma once

#include <Eigen/Core>
#include <vector>

#include "scanner/core/camera.h"

namespace scanner::simulation {

/// Directions (x, y, 1) in the optical frame through any place of a raw picture: the undistorted
/// coordinates of every pixel centre and their slopes. Immutable.
class RayTable {
 public:
  /// Throws ConfigurationError for a distortion model that is not known or cannot be undone.
  RayTable(const CameraModel& camera, int threads);
  /// (du, dv): from the centre of pixel (col, row), within about a pixel.
  Eigen::Vector3f direction(int col, int row, float du, float dv) const;

 private:
  const Eigen::Vector2f& at(int col, int row) const;

  int width_;
  int height_;
  std::vector<Eigen::Vector2f> centres_;  ///< with a border of one pixel
};

}  // namespace scanner::simulation
