#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "scanner/core/status.h"
#include "scanner/mti/message.h"
#include "scanner/mti/mt_data.h"

/// MTData2, what devices since the MTi-10/100 send: packets of (identifier, length, value). The low
/// nibble of an identifier tells how numbers are written and which earth frame they are in.
namespace scanner::mti {

namespace xdi {
inline constexpr std::uint16_t kTemperature = 0x0810, kUtcTime = 0x1010, kPacketCounter = 0x1020,
                               kSampleTimeFine = 0x1060, kSampleTimeCoarse = 0x1070,
                               kQuaternion = 0x2010, kRotationMatrix = 0x2020,
                               kEulerAngles = 0x2030, kPressure = 0x3010, kDeltaV = 0x4010,
                               kAcceleration = 0x4020, kFreeAcceleration = 0x4030,
                               kAccelerationHr = 0x4040, kAltitudeEllipsoid = 0x5020,
                               kPositionEcef = 0x5030, kLatLon = 0x5040, kRateOfTurn = 0x8020,
                               kDeltaQ = 0x8030, kRateOfTurnHr = 0x8040, kMagneticField = 0xC020,
                               kVelocity = 0xD010, kStatusByte = 0xE010, kStatusWord = 0xE020;
/// Numbers: IEEE single (4 bytes), fixed point (4 and 6 bytes), IEEE double (8 bytes).
inline constexpr std::uint16_t kFloat = 0x0, kFixed1220 = 0x1, kFixed1632 = 0x2, kDouble = 0x3;
/// Earth frames.
inline constexpr std::uint16_t kEastNorthUp = 0x0, kNorthEastDown = 0x4, kNorthWestUp = 0x8;
}  // namespace xdi

enum class EarthFrame : std::uint16_t {
  kEastNorthUp = xdi::kEastNorthUp,
  kNorthEastDown = xdi::kNorthEastDown,
  kNorthWestUp = xdi::kNorthWestUp,
};

template <typename T>
struct InFrame {
  T value;
  EarthFrame frame = EarthFrame::kEastNorthUp;
};

struct UtcTime {
  std::uint32_t nanoseconds = 0;
  int year = 0, month = 0, day = 0, hour = 0, minute = 0, second = 0;
  std::uint8_t flags = 0;  ///< bit 2: valid
};

/// What one MTData2 message carries, numbers as they were sent.
struct MtData2 {
  std::optional<std::uint16_t> packet_counter;
  std::optional<std::uint32_t> sample_time_fine;    ///< 0.1 ms, wraps
  std::optional<std::uint32_t> sample_time_coarse;  ///< s
  std::optional<UtcTime> utc_time;
  std::optional<double> temperature_c;
  std::optional<std::uint32_t> pressure_pa;
  /// Sensor to earth, unit length to 1e-3 but as sent.
  std::optional<InFrame<Eigen::Quaterniond>> quaternion;
  std::optional<InFrame<Eigen::Matrix3d>> rotation_matrix;  ///< column by column on the wire
  /// Roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll).
  std::optional<InFrame<Eigen::Vector3d>> euler_deg;
  std::optional<Eigen::Vector3d> acceleration;  ///< m/s^2, gravity included, sensor frame
  std::optional<Eigen::Vector3d> acceleration_hr;
  std::optional<InFrame<Eigen::Vector3d>> free_acceleration;  ///< m/s^2, without gravity, earth
  std::optional<Eigen::Vector3d> delta_v;                     ///< m/s over the sampling interval
  std::optional<Eigen::Vector3d> angular_velocity;            ///< rad/s, sensor frame
  std::optional<Eigen::Vector3d> angular_velocity_hr;
  std::optional<Eigen::Quaterniond> delta_q;      ///< turn over the sampling interval
  std::optional<Eigen::Vector3d> magnetic_field;  ///< 1 = about the earth's field, sensor frame
  std::optional<Eigen::Vector2d> lat_lon_deg;
  std::optional<double> altitude_m;  ///< above the ellipsoid
  std::optional<Eigen::Vector3d> position_ecef_m;
  std::optional<InFrame<Eigen::Vector3d>> velocity;  ///< m/s
  std::optional<std::uint8_t> status_byte;           ///< the low byte of the status word
  std::optional<std::uint32_t> status_word;
  int skipped = 0;  ///< packets that are not known here (raw data, GNSS, ...)

  /// Sensor to earth, from whatever form was sent, normalised.
  std::optional<InFrame<Eigen::Quaterniond>> orientation() const;
  /// | |q| - 1 |, or the largest entry of |R R^T - I|; 0 without orientation or with Euler angles.
  double rotationDefect() const;
};

/// kInvalidInput when it is no MTData2, a packet does not fit the message or its own type, comes
/// twice, a value is not finite, an orientation is no rotation. Unknown packets are skipped.
Result<MtData2> decodeMtData2(const Message& message);
/// Packets in this order and form. Throws ConfigurationError for an identifier that is not known, a
/// value that is missing or that fixed point cannot hold. Earth frames are those of the
/// identifiers: they must be those of the values.
Message encodeMtData2(const MtData2& data, const std::vector<std::uint16_t>& identifiers);

/// The part that all generations share. The orientation is turned to the legacy devices' earth
/// frame, north-west-up.
MtData toMtData(const MtData2& data);

}  // namespace scanner::mti
