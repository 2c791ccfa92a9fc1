#pragma once

#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Imu.h>

#include <functional>
#include <string>

#include "scanner/ros/bag_reader.h"
#include "support/synthetic_rig.h"

namespace scanner::test {

/// Writes a small recording of the synthetic rig; each hook may change a message before it is
/// written, or return false to leave it out.
struct BagWriter {
  int frames = 3;
  double frame_step_s = 0.5;
  double imu_step_s = 0.01;
  bool transforms = true;
  bool truth = true;
  bridge::Topics topics;
  std::string camera_frame = "bumblebee_left_optical";
  std::function<bool(int frame, bool left, sensor_msgs::Image&)> image;
  std::function<bool(int frame, bool left, sensor_msgs::CameraInfo&)> info;
  std::function<bool(int sample, sensor_msgs::Imu&)> imu;

  void write(const std::string& path, const SyntheticRig& rig) const;

 private:
  void writeFrame(rosbag::Bag& bag, const SyntheticRig& rig, int index) const;
  void writeTransforms(rosbag::Bag& bag, const SyntheticRig& rig) const;
};

}  // namespace scanner::test
