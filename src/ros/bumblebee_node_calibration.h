#pragma once

#include <camera_info_manager/camera_info_manager.h>
#include <ros/node_handle.h>

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "ros/static_broadcast.h"
#include "scanner/core/camera.h"
#include "scanner/core/status.h"
#include "scanner/core/time.h"
#include "scanner/ros/bumblebee_node.h"

namespace scanner::bridge {

/// Pose of the raw right camera in the raw left one.
Eigen::Isometry3d rightInLeft(const StereoCalibration& calibration);

/// Calibration of both eyes, and whether one may scan with it. Thread-safe.
class BumblebeeCalibration {
 public:
  enum class State {
    kUnknown,       ///< no images yet
    kUncalibrated,  ///< an eye has none
    kRefused,
    kGood
  };
  struct Verdict {
    State state = State::kUnknown;
    std::string reason;  ///< why not good
  };
  using Infos = std::pair<sensor_msgs::CameraInfo, sensor_msgs::CameraInfo>;

  /// Throws ConfigurationError.
  BumblebeeCalibration(const ros::NodeHandle& nh, const BumblebeeNodeOptions& options);

  /// To be called before the first images of a camera: its serial number is part of the default
  /// urls. Offers bumblebee/{left,right}/set_camera_info from the first camera on: what is set
  /// there is for a camera that is known.
  void useCamera(const std::string& serial);
  /// Without headers; nothing when images of this size must not be scanned with it. Says once what
  /// is wrong, and sends left -> right to tf when it changes.
  std::optional<Infos> infos(int width_px, int height_px, Time stamp);
  Verdict verdict() const;

 private:
  const ros::NodeHandle nh_;
  const BumblebeeNodeOptions options_;
  std::optional<StereoCalibration> rig_;
  std::shared_ptr<StaticBroadcast> static_tf_ = StaticBroadcast::shared();

  void judge(const Infos& infos, int width_px, int height_px, Time stamp);

  mutable std::mutex mutex_;
  std::unique_ptr<camera_info_manager::CameraInfoManager> left_, right_;
  std::string serial_;
  std::optional<Infos> judged_;
  int judged_width_px_ = 0, judged_height_px_ = 0;
  Verdict verdict_;
};

}  // namespace scanner::bridge
