#pragma once

#include <ros/node_handle.h>

#include <memory>

namespace scanner::bridge {

/// Motion from inertial samples.
///
/// Subscribes (relative to the node's namespace)
///   mti/imu/data          sensor_msgs/Imu (REP-145); a sensor that is mounted turned to base_link
///   is
///                         turned with tf
///   registration/pose     poses found by registration, which correct the velocity
/// Publishes
///   odometry              nav_msgs/Odometry of base_link in odom, one per sample, at its stamp
///   (the
///                         first second comes late: the filters start from it)
///   tf odom -> base_link
///   /diagnostics          rates, gaps, bias, what is missing
/// Services
///   ~reset                std_srvs/Trigger: starts anew
/// Parameters
///   scanner/inertial, ~inertial   options of the stage (docs/configuration.md)
///   ~odom_frame, ~base_frame
class InertialOdometryNode {
 public:
  /// Throws ConfigurationError for bad parameters.
  InertialOdometryNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~InertialOdometryNode();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::bridge
