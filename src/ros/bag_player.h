#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "scanner/core/status.h"

namespace scanner::bridge {

/// Plays topics of a recording with /clock, like `rosbag play --clock`, but so that nothing is
/// lost: it starts when every subscriber is connected, its queues are unbounded, its clock moves on
/// when it falls behind, and what was published last is sent as long as the object lives.
class BagPlayer {
 public:
  /// Advertises. Throws what rosbag throws.
  BagPlayer(const ros::NodeHandle& nh, const std::string& path,
            const std::vector<std::string>& topics);

  /// Waits until each topic has at least as many subscribers as `subscribers` says.
  /// kNotEnoughData naming the first topic that does not.
  Status waitForSubscribers(const std::map<std::string, std::set<std::string>>& subscribers,
                            ros::WallDuration patience);
  /// Plays to the end. kIoError "interrupted" on Ctrl-C, or when a message cannot be read.
  Status play(double rate);

 private:
  void advanceTo(const ros::Time& time, double rate);
  void publishClock(const ros::Time& time);

  ros::NodeHandle nh_;
  rosbag::Bag bag_;
  std::unique_ptr<rosbag::View> view_;
  std::map<std::string, ros::Publisher> publishers_;
  ros::Publisher clock_;
  ros::Time clock_at_;
  ros::WallTime wall_start_;
};

}  // namespace scanner::bridge
