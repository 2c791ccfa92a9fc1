#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "scanner/core/camera.h"
#include "scanner/core/imu.h"
#include "scanner/core/se3.h"
#include "scanner/core/status.h"

namespace scanner::bridge {

/// One camera of an ASL folder.
struct EurocCamera {
  CameraModel model;  ///< K and D only
  Eigen::Isometry3d T_body_camera = Eigen::Isometry3d::Identity();
  std::vector<std::pair<Time, std::string>> images;  ///< stamp and path, increasing
};

/// Everything but the pixels.
struct EurocFolder {
  EurocCamera left, right;
  Eigen::Isometry3d T_body_imu = Eigen::Isometry3d::Identity();
  std::vector<ImuSample> samples;
  Trajectory truth;  ///< of the inertial sensor in the world; empty when absent
};

/// `directory` is mav0 or holds it. kIoError or kInvalidInput naming file and line.
Result<EurocFolder> readEuroc(const std::string& directory);

}  // namespace scanner::bridge
