#pragma once

#include <ros/node_handle.h>

#include <memory>
#include <string>

#include "scanner/core/options.h"
#include "scanner/core/status.h"

namespace scanner::bridge {

/// Parameters of bumblebee_node (`~`).
struct BumblebeeNodeOptions {
  std::string left_camera_info_url;   ///< camera_info_manager's; empty: its default
  std::string right_camera_info_url;  ///< the same
  std::string rig;  ///< rig file; where it carries the cameras, they are the calibration
};
void describe(OptionVisitor& v, BumblebeeNodeOptions& o);

/// A stereo camera's pairs on topics.
///
/// Publishes (relative to the node's namespace)
///   bumblebee/{left,right}/image_raw    8-bit Bayer (or mono8), equal stamps: mid-exposure
///   bumblebee/{left,right}/camera_info  of the same stamps; only while the calibration can be
///                                       scanned with
///   /tf_static                          bumblebee_left_optical -> bumblebee_right_optical, from
///                                       the calibration
///   /diagnostics                        state, rate, losses, exposure, clock, calibration
/// Services
///   bumblebee/{left,right}/set_camera_info   as cameracalibrator calls them; from the first images
///                                            of a camera on
///   ~get_register, ~set_register             scanner/GetRegister, scanner/SetRegister
///   ~bumblebee/set_parameters                dynamic_reconfigure (cfg/Bumblebee.cfg)
/// Parameters
///   scanner/bumblebee, ~bumblebee   options of the driver (docs/configuration.md); values that
///                                   are changed while it runs are kept in ~bumblebee, so that a
///                                   respawned node goes on with them
///   ~left_camera_info_url, ~right_camera_info_url, ~rig    BumblebeeNodeOptions
///
/// A calibration that does not fit the images, or that validate(StereoCalibration) refuses, is not
/// published (nobody scans with it); the images are, because calibrating needs them. Diagnostics
/// and the log say why. In the default urls, ${NAME} holds the camera's serial number, so that
/// another camera does not inherit the calibration of the one before.
///
/// Runs without a camera and finds it when it comes, as often as it comes. Images are published
/// from the driver's thread; requests to the camera have a thread of their own.
class BumblebeeNode {
 public:
  /// Throws ConfigurationError for bad parameters and a rig file that cannot be used.
  BumblebeeNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~BumblebeeNode();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// The cameras of all transports, one a line: transport, address, vendor, model, serial, firmware
/// and problem, separated by tabs, under a line of these names. Empty when there is none. Takes
/// seconds; needs no ROS master.
std::string listBumblebees();
/// Opens the camera with this address or serial number, or folder of pictures (empty: the first
/// camera that can be asked), and tells identity, capabilities, format, controls and the head of
/// the factory calibration as YAML. Needs no ROS master.
Result<std::string> probeBumblebee(const std::string& address);

}  // namespace scanner::bridge
