#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "scanner/core/status.h"

namespace scanner {

/// Pinhole camera with lens distortion, and its rectification, as in sensor_msgs/CameraInfo.
struct CameraModel {
  int width = 0;                               ///< pixels
  int height = 0;                              ///< pixels
  std::string distortion_model = "plumb_bob";  ///< plumb_bob, rational_polynomial or equidistant
  std::vector<double> D;
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();  ///< of the raw image
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();  ///< raw to rectified camera frame
  Eigen::Matrix<double, 3, 4> P = Eigen::Matrix<double, 3, 4>::Zero();  ///< of the rectified image
};

/// A calibrated, rectifiable pair. Left is the reference; the rectified left camera frame is the
/// optical frame that disparity, depth and clouds are expressed in.
struct StereoCalibration {
  CameraModel left;
  CameraModel right;

  double focalLength() const { return left.P(0, 0); }                 ///< pixels
  double baseline() const { return -right.P(0, 3) / right.P(0, 0); }  ///< metres, positive
  /// x shift between the two rectified principal points, pixels: d_metric = d - offset.
  double disparityOffset() const { return left.P(0, 2) - right.P(0, 2); }
};

/// Checks that the pair can be scanned with: sizes equal and positive, K and P finite, focal
/// lengths equal, P[3] of the right camera negative (0 or positive is a common mistake and gives a
/// cloud that is a dot or mirrored), R a rotation. The message names the field and its value.
Status validate(const StereoCalibration& calibration);

/// Calibration of the rig: where the camera sits on the body.
struct Rig {
  /// Raw left optical frame to the sensor frame of the inertial sensor (base_link).
  Eigen::Isometry3d T_base_camera = Eigen::Isometry3d::Identity();
  /// Present when the rig file carries the cameras too; else they come with the recording.
  std::optional<StereoCalibration> cameras;

  /// Rectified left optical frame to base_link (`left.R` rotates raw to rectified).
  Eigen::Isometry3d rectifiedCameraPose(const StereoCalibration& calibration) const;
};

/// Reads a rig file (`T_base_link_bumblebee_left_optical`, and `left`/`right` when present;
/// docs/conventions.md). Throws ConfigurationError naming file and key.
Rig loadRig(const std::string& path);

}  // namespace scanner
