#pragma once

#include <ros/node_handle.h>

#include <memory>

namespace scanner::bridge {

/// Unpacks the viewfinder's JPEGs on the base station, where rviz wants plain images.
///
/// Subscribes  stereo/left/viewfinder/compressed (sensor_msgs/CompressedImage)
/// Publishes   viewfinder/image (sensor_msgs/Image, bgr8, stamp and frame as received),
/// /diagnostics
class ViewfinderNode {
 public:
  ViewfinderNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~ViewfinderNode();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::bridge
