#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>

#include "scanner/core/status.h"
#include "scanner/mti/message.h"

namespace scanner::mti {

/// SetOutputMode and SetOutputSettings of a legacy MTi, as the device encodes them.
namespace output_mode {
inline constexpr std::uint16_t kTemperature = 0x0001, kCalibrated = 0x0002, kOrientation = 0x0004,
                               kAuxiliary = 0x0008, kStatus = 0x0800, kRaw = 0x4000;
}
namespace output_settings {
inline constexpr std::uint32_t kSampleCounter = 0x1, kQuaternion = 0x0, kEuler = 0x4, kMatrix = 0x8,
                               kNoAcceleration = 0x10, kNoGyro = 0x20, kNoMagnetometer = 0x40,
                               kNoAnalogIn1 = 0x400, kNoAnalogIn2 = 0x800,
                               kNorthEastDown = 0x80000000U;
}

/// What one MTData message carries, in the device's own units and frames.
struct MtData {
  std::optional<double> temperature_c;
  std::optional<Eigen::Vector3d> acceleration;      ///< m/s^2, gravity included, sensor frame
  std::optional<Eigen::Vector3d> angular_velocity;  ///< rad/s, sensor frame
  std::optional<Eigen::Vector3d> magnetic_field;    ///< 1 = about the earth's field, sensor frame
  /// Sensor to earth. Earth is north-west-up (X magnetic north), or north-east-down if set so.
  std::optional<Eigen::Quaterniond> orientation;
  std::optional<std::uint16_t> analog_in_1;  ///< raw value of the auxiliary inputs
  std::optional<std::uint16_t> analog_in_2;
  std::optional<std::uint8_t> status;  ///< bit 0: self-test passed, bit 1: filter valid
  std::optional<std::uint16_t> counter;
};

/// Length of the data of an MTData message; 0 for a mode that is not supported (raw data, fixed
/// point, other time stamps than the counter) or that sends nothing.
std::size_t mtDataSize(std::uint16_t mode, std::uint32_t settings);
/// kInvalidInput when it is no MTData, the length does not fit the mode, a value is not finite or
/// the orientation is no rotation; kUnsupported for raw mode and others of length 0.
///
/// The matrix comes column by column, R_earth_sensor = [a d g; b e h; c f i] (MT0100P 4.3.3): the
/// first three numbers are where the sensor's x axis points. The vendor's old library and public
/// drivers hand it on row by row, which is the inverse. A recorded device, which sends quaternion
/// and matrix side by side in MTData2, agrees with the manual.
/// Euler angles are roll, pitch, yaw in degrees on the wire, R = Rz(yaw) Ry(pitch) Rx(roll).
Result<MtData> decodeMtData(const Message& message, std::uint16_t mode, std::uint32_t settings);
/// How far the orientation that was sent is from a rotation: | |q| - 1 |, or the largest entry of
/// |R R^T - I|; 0 for Euler angles and for messages that do not decode. Rounding to single
/// precision leaves a few 1e-7: more is a sign of damage that the checksum missed.
double rotationDefect(const Message& message, std::uint16_t mode, std::uint32_t settings);
/// The inverse, for the emulated device. Throws ConfigurationError when a value is missing.
Message encodeMtData(const MtData& data, std::uint16_t mode, std::uint32_t settings);

}  // namespace scanner::mti
