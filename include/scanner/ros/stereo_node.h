#pragma once

#include <ros/node_handle.h>

#include <memory>

namespace scanner::bridge {

/// Raw pairs to organised clouds.
///
/// Subscribes (relative to the node's namespace; exact stamps, image_transport)
///   bumblebee/{left,right}/image_raw, bumblebee/{left,right}/camera_info
/// Publishes, stamped with the images' stamp, in the rectified left optical frame (the left images'
/// frame_id + "_rectified", which the node adds to tf from camera_info's R)
///   stereo/points                      organised PointCloud2: x y z, normal, rgb, sigma; one for
///   every
///                                      pair, empty when the pair could not be used
///   stereo/disparity                   stereo_msgs/DisparityImage (when subscribed)
///   stereo/left/image_rect_color       (when subscribed)
///   stereo/left/viewfinder/compressed  small JPEG for slow links (when subscribed)
///   /diagnostics                       rates, queue, failures, what is missing
/// Parameters
///   scanner/stereo, ~stereo   options of the stage (docs/configuration.md)
///   ~threads                  0: all processors
///   ~viewfinder_width_px, ~viewfinder_quality, ~viewfinder_rate_hz
///
/// Pairs wait in an unbounded queue whose length is in the diagnostics: a recording that comes
/// faster than it can be matched is worked off, not thinned.
class StereoNode {
 public:
  /// Throws ConfigurationError for bad parameters.
  StereoNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~StereoNode();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::bridge
