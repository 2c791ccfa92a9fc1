#pragma once

#include <ros/node_handle.h>

#include "ros/simulated_rig.h"
#include "scanner/core/camera.h"
#include "scanner/core/status.h"

namespace scanner::bridge {

/// What an operator does with a rig that was just switched on, for the emulated devices: gives the
/// camera driver its calibration (set_camera_info, as a calibrator does), waits until both drivers
/// have read their device for some seconds, starts the scan if `start_scan`, and lets the motion
/// begin. kNotEnoughData when that takes longer than `patience_s` (0: for ever), kIoError when a
/// service refuses or at shutdown.
Status bringUp(const ros::NodeHandle& nh, const StereoCalibration& calibration, bool start_scan,
               double patience_s, SimulatedDevices& devices);

}  // namespace scanner::bridge
