#pragma once

#include <ros/node_handle.h>

#include <memory>

namespace scanner::bridge {

/// Puts the stereo clouds together into one map.
///
/// Subscribes (relative to the node's namespace)
///   stereo/points                  a cloud waits until the inertial samples have passed its stamp
///   mti/imu/data                   for the priors, in step with the clouds: what a replay gives
///   does
///                                  not depend on how fast the machine is, and equals scan_bag's
///   odometry                       for tf map -> odom only
///   bumblebee/left/camera_info     only its stamps: which clouds are still to come
///   ground_truth/pose              PoseStamped of base_link, if somebody knows it: for the report
///   only
/// Publishes, in map
///   registration/pose     PoseWithCovarianceStamped of base_link, for every registered view, at
///   its
///                         stamp; covariance: of the motion since the view before
///   registration/path     all registered views (latched; final after ~finish)
///   registration/views    RegisteredView: every view with its cloud, discarded ones too
///   registration/groups   GroupArray (latched)
///   registration/group_markers  the same for rviz (latched)
///   registration/cloud    thinned preview of everything registered (latched, throttled)
///   registration/status   RegistrationStatus (latched)
///   tf map -> odom, /diagnostics
/// Services
///   ~start ~stop      std_srvs/Trigger: clouds that come are used, or ignored (and counted)
///   ~finish           waits for what is under way, then closes groups and runs the global stage
///   ~discard_last     takes the newest view out again
///   ~save             scanner/Save: a scan folder with views, groups, trajectory,
///                     report.json and report.html
/// Parameters
///   scanner/{registration,inertial,stereo,scan}, or ~...: options (docs/configuration.md)
///   ~autostart (true), ~start_delay_s (0), ~threads (0: all processors)
///   ~rig              rig file; published as tf base_link -> camera; empty: tf has it already
///   ~out              scan folder that views and trajectory are written to as they come; empty:
///   none ~preview_rate_hz, ~preview_voxel_m, ~finish_timeout_s, ~map_frame, ~odom_frame,
///   ~base_frame
///
/// Clouds wait in an unbounded queue whose length is in the status: a recording that comes faster
/// than it can be registered is worked off, not thinned.
class RegistrationNode {
 public:
  /// Throws ConfigurationError for bad parameters, rig file or output folder.
  RegistrationNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~RegistrationNode();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::bridge
