#pragma once

#include <sensor_msgs/Imu.h>
#include <tf2_ros/buffer.h>

#include <string>

#include "scanner/core/imu.h"
#include "scanner/core/status.h"

namespace scanner::bridge {

/// The sample in `base_frame`: turned with tf when the sensor is mounted turned (the frame is
/// another one and tf knows it), else as it is. Errors of fromRos().
Result<ImuSample> imuInBase(const sensor_msgs::Imu& message, const tf2_ros::Buffer& tf,
                            const std::string& base_frame);

}  // namespace scanner::bridge
