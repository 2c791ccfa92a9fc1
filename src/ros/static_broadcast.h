#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <memory>
#include <mutex>
#include <vector>

namespace scanner::bridge {

/// The one broadcaster of /tf_static in this process. roscpp latches one message per topic and
/// process, so of several broadcasters in a nodelet manager only the one that spoke last would
/// reach those who come later. Thread-safe; lives as long as somebody holds it.
class StaticBroadcast {
 public:
  static std::shared_ptr<StaticBroadcast> shared();
  void send(const std::vector<geometry_msgs::TransformStamped>& transforms);

 private:
  std::mutex mutex_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
};

}  // namespace scanner::bridge
