#pragma once

#include <sensor_msgs/Imu.h>
#include <sensor_msgs/MagneticField.h>
#include <sensor_msgs/Temperature.h>

#include <optional>

#include "scanner/core/status.h"
#include "scanner/mti/driver.h"
#include "scanner/ros/mti_node.h"

namespace scanner::bridge {

/// Messages of an MTi's samples. Immutable after construction.
class MtiMessages {
 public:
  /// What one sample becomes; absent where the device did not send it.
  struct Messages {
    sensor_msgs::Imu imu;
    std::optional<sensor_msgs::MagneticField> magnetic_field;
    std::optional<sensor_msgs::Temperature> temperature;
  };

  /// `rate_hz` decides how much of the noise's spectrum is in a sample. Throws ConfigurationError
  /// for a frame that tf does not take.
  MtiMessages(const MtiNodeOptions& options, double rate_hz);

  /// kOutOfRange for a stamp that ROS cannot express.
  Result<Messages> of(const mti::Sample& sample) const;

 private:
  using Covariance = sensor_msgs::Imu::_angular_velocity_covariance_type;

  sensor_msgs::Imu imu(const mti::Sample& sample, const std_msgs::Header& header) const;

  std::string frame_id_;
  double field_strength_t_;
  Covariance angular_velocity_, acceleration_, orientation_, magnetic_field_;
};

}  // namespace scanner::bridge
