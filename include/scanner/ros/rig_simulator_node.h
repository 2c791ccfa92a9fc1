#pragma once

#include <ros/node_handle.h>

#include <memory>
#include <string>

#include "scanner/core/options.h"
#include "scanner/core/status.h"

namespace scanner::bridge {

/// Parameters of rig_simulator_node (`~`).
struct RigSimulatorOptions {
  std::string scene = "artwork";  ///< artwork, totem, target, or the path of a mesh
  int seed = 1;
  bool full_quality = true;  ///< else one sample per pixel and no motion blur
  bool prerender = true;     ///< all views before the motion starts; else as far as the CPU allows
  bool devices = false;      ///< emulate the two devices; else publish the sensors' topics
  bool finish = false;       ///< finish the scan when the motion has ended, then exit
  bool start_scan = false;   ///< with devices: start the scan when the motion begins
  bool mesh = true;          ///< build the mesh then
  std::string
      out;  ///< scan folder to fill then, beside reference.ply, the true surface; empty: none
  double startup_s = 60.0;                     ///< how long the nodes may take to come up
  int threads = 0;                             ///< of the renderer; 0: all processors
  std::string mti_link = "/tmp/scanner_mti";   ///< terminal of the emulated MTi
  std::string camera_interface = "127.0.0.1";  ///< address of the emulated camera
  std::string camera_serial = "SIM0001";
};
void describe(OptionVisitor& v, RigSimulatorOptions& o);

/// The rig that needs no hardware: renders a scene along a hand-held motion, in real time.
///
/// Publishes
///   /ground_truth/pose    geometry_msgs/PoseStamped, base_link in map, at the inertial rate
///   /tf_static            base_link -> bumblebee_left_optical -> bumblebee_right_optical
///   /diagnostics          views rendered, shown and missed
/// and either (devices: false)
///   bumblebee/{left,right}/{image_raw,camera_info}, mti/imu/data     what the drivers would
///   publish
/// or (devices: true) a GigE Vision camera on `~camera_interface` and an MTi on the terminal
/// `~mti_link`, for the drivers to open. The camera's driver gets its calibration by
/// set_camera_info; when both devices have been read for some seconds the motion starts. Services
/// (devices: true)
///   ~plug_camera, ~plug_mti   std_srvs/SetBool: the cable in or out
///   ~faults                   scanner/SetFaults
/// Parameters
///   scanner/simulation, ~simulation   options of the stage (docs/configuration.md)
///   ~scene, ~seed, ...                RigSimulatorOptions
///
/// run() returns when the motion has ended and, with `~finish`, the scan is finished (the lines of
/// the services), or at Ctrl-C. A view whose picture is not rendered when its time comes is missed
/// and counted, as a camera drops frames; with `~prerender` none is.
class RigSimulatorNode {
 public:
  /// Throws ConfigurationError for bad parameters and scenes.
  RigSimulatorNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~RigSimulatorNode();
  Result<std::string> run();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::bridge
