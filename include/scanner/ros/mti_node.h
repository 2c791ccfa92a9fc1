#pragma once

#include <ros/node_handle.h>

#include <memory>
#include <string>

#include "scanner/core/options.h"
#include "scanner/core/status.h"

namespace scanner::bridge {

/// Parameters of mti_node (`~`). Standard deviations of one sample; the messages carry their
/// squares. Those that are 0 follow from the data sheet's noise densities and the rate.
struct MtiNodeOptions {
  std::string frame_id = "base_link";  ///< of the sensor; no leading slash
  /// T per unit of the device, which measures the field as a multiple of that at its calibration.
  double field_strength_t = 50e-6;
  double angular_velocity_sigma_deg_s = 0.0;  ///< 0: 0.1 deg/s/sqrt(Hz)
  double acceleration_sigma_m_s2 = 0.0;       ///< 0: 0.02 m/s^2/sqrt(Hz)
  double magnetic_field_sigma_t = 50e-9;      ///< 0.5 mGauss
  /// About the horizontal axes and about the vertical. The data sheet: 0.5 and 1 deg standing
  /// still, 2 deg RMS in motion; a rig that is carried moves.
  double roll_pitch_sigma_deg = 2.0;
  double heading_sigma_deg = 2.0;
};
void describe(OptionVisitor& v, MtiNodeOptions& o);

/// An MTi's samples on topics.
///
/// Publishes (relative to the node's namespace), each sample once, stamped when it was measured
///   mti/imu/data      sensor_msgs/Imu (REP-145): acceleration with gravity, rates, orientation of
///                     the sensor in ENU whatever the device's own earth frame. Covariances are
///                     variances, of the orientation about the fixed axes x y z of ENU; -1 where
///                     the device is set not to send a quantity
///   mti/imu/mag       sensor_msgs/MagneticField, T: what the device sends times
///                     ~field_strength_t. Directions are measured; the magnitude is as good as
///                     that factor
///   mti/temperature   sensor_msgs/Temperature
///   /diagnostics      state, rate, losses, errors on the line, clock, who it is
/// Services
///   ~reset_orientation   scanner/ResetOrientation
/// Parameters
///   scanner/mti, ~mti                     options of the driver (docs/configuration.md)
///   ~frame_id, ~field_strength_t, ...     MtiNodeOptions
///
/// Runs without a device and finds it when it comes, as often as it comes. Samples are published
/// from the driver's thread.
class MtiNode {
 public:
  /// Throws ConfigurationError for bad parameters.
  MtiNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~MtiNode();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Serial ports that could carry an MTi, one a line: port, description and problem, separated by
/// tabs, under a line of these names. Empty when there is none. Opens nothing; needs no ROS master.
std::string listMtiPorts();
/// Asks what is on the port (empty: the first port where an MTi answers) and tells it as YAML.
/// kNotEnoughData when there is no port, kIoError when no MTi answers. Takes seconds; leaves the
/// device as it was; needs no ROS master.
Result<std::string> probeMti(const std::string& port);

}  // namespace scanner::bridge
