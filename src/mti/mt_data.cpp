#include "scanner/mti/mt_data.h"

#include <cmath>
#include <string>

#include "scanner/core/se3.h"
#include "scanner/mti/bytes.h"

namespace scanner::mti {
namespace {

constexpr std::uint16_t kSupportedMode = output_mode::kTemperature | output_mode::kCalibrated |
                                         output_mode::kOrientation | output_mode::kAuxiliary |
                                         output_mode::kStatus;
constexpr std::uint32_t kOrientationBits = output_settings::kEuler | output_settings::kMatrix;
constexpr std::uint32_t kSupportedSettings =
    output_settings::kSampleCounter | kOrientationBits | output_settings::kNoAcceleration |
    output_settings::kNoGyro | output_settings::kNoMagnetometer | output_settings::kNoAnalogIn1 |
    output_settings::kNoAnalogIn2 | output_settings::kNorthEastDown;
constexpr double kDegree = 0.017453292519943295;
/// A rotation that left the device in single precision is much closer to one than this.
constexpr double kRotationTolerance = 1e-3;

/// Which fields a message of this mode carries.
struct Layout {
  bool supported, temperature, acceleration, gyro, magnetometer, analog_in_1, analog_in_2, status,
      counter;
  std::uint32_t orientation_floats;  ///< 0: no orientation; else 3 Euler, 4 quaternion, 9 matrix

  Layout(std::uint16_t mode, std::uint32_t settings) {
    const auto has = [mode](std::uint16_t bit) { return (mode & bit) != 0; };
    const auto set = [settings](std::uint32_t bit) { return (settings & bit) != 0; };
    const std::uint32_t kind = settings & kOrientationBits;
    supported = (mode & ~kSupportedMode) == 0 && (settings & ~kSupportedSettings) == 0 &&
                kind != kOrientationBits;
    temperature = has(output_mode::kTemperature);
    acceleration = has(output_mode::kCalibrated) && !set(output_settings::kNoAcceleration);
    gyro = has(output_mode::kCalibrated) && !set(output_settings::kNoGyro);
    magnetometer = has(output_mode::kCalibrated) && !set(output_settings::kNoMagnetometer);
    const std::uint32_t floats = kind == output_settings::kEuler    ? 3
                                 : kind == output_settings::kMatrix ? 9
                                                                    : 4;
    orientation_floats = has(output_mode::kOrientation) ? floats : 0;
    analog_in_1 = has(output_mode::kAuxiliary) && !set(output_settings::kNoAnalogIn1);
    analog_in_2 = has(output_mode::kAuxiliary) && !set(output_settings::kNoAnalogIn2);
    status = has(output_mode::kStatus);
    counter = set(output_settings::kSampleCounter);
  }

  std::size_t size() const {
    const auto count = [](bool field) { return field ? std::size_t{1} : std::size_t{0}; };
    if (!supported) return 0;
    return 4 * count(temperature) + 12 * (count(acceleration) + count(gyro) + count(magnetometer)) +
           4 * std::size_t{orientation_floats} + 2 * (count(analog_in_1) + count(analog_in_2)) +
           count(status) + 2 * count(counter);
  }
};

Eigen::Vector3d readVector(ByteReader& in) {
  const double x = in.f32();
  const double y = in.f32();
  return {x, y, in.f32()};
}

void writeVector(ByteWriter& out, const Eigen::Vector3d& v) {
  for (const double value : v) out.f32(value);
}

std::optional<Eigen::Quaterniond> readQuaternion(ByteReader& in) {
  const double w = in.f32();
  const Eigen::Vector3d v = readVector(in);
  const Eigen::Quaterniond q(w, v.x(), v.y(), v.z());
  if (!(std::abs(q.norm() - 1.0) < kRotationTolerance)) return std::nullopt;  // also for NaN
  return q.normalized();
}

Eigen::Matrix3d readNineFloats(ByteReader& in) {
  Eigen::Matrix3d m;
  for (int column = 0; column < 3; ++column) m.col(column) = readVector(in);
  return m;
}

double orthonormalityDefect(const Eigen::Matrix3d& m) {
  return (m * m.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
}

std::optional<Eigen::Quaterniond> readMatrix(ByteReader& in) {
  const Eigen::Matrix3d m = readNineFloats(in);
  if (!m.allFinite() || orthonormalityDefect(m) > kRotationTolerance || m.determinant() < 0.0) {
    return std::nullopt;
  }
  return Eigen::Quaterniond(nearestRotation(m));
}

std::optional<Eigen::Quaterniond> readEuler(ByteReader& in) {
  const Eigen::Vector3d angles = kDegree * readVector(in);
  if (!angles.allFinite()) return std::nullopt;
  return Eigen::AngleAxisd(angles.z(), Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(angles.y(), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(angles.x(), Eigen::Vector3d::UnitX());
}

std::optional<Eigen::Quaterniond> readOrientation(ByteReader& in, std::uint32_t floats) {
  if (floats == 3) return readEuler(in);
  return floats == 9 ? readMatrix(in) : readQuaternion(in);
}

void writeOrientation(ByteWriter& out, const Eigen::Quaterniond& q, std::uint32_t floats) {
  if (floats == 3) return writeVector(out, rollPitchYaw(q.toRotationMatrix()) / kDegree);
  if (floats == 9) {
    const Eigen::Matrix3d m = q.toRotationMatrix();
    for (int column = 0; column < 3; ++column) writeVector(out, m.col(column));
    return;
  }
  out.f32(q.w());
  writeVector(out, q.vec());
}

bool allFinite(const MtData& data) {
  for (const auto* vector : {&data.acceleration, &data.angular_velocity, &data.magnetic_field}) {
    if (*vector && !(*vector)->allFinite()) return false;
  }
  return !data.temperature_c || std::isfinite(*data.temperature_c);
}

template <typename T>
const T& required(const std::optional<T>& field, const char* name) {
  if (!field) throw ConfigurationError(std::string("MTData to be encoded lacks ") + name);
  return *field;
}

}  // namespace

std::size_t mtDataSize(std::uint16_t mode, std::uint32_t settings) {
  return Layout(mode, settings).size();
}

Result<MtData> decodeMtData(const Message& message, std::uint16_t mode, std::uint32_t settings) {
  const Layout layout(mode, settings);
  if (layout.size() == 0) {
    return Status(StatusCode::kUnsupported, "MTData in output mode " + std::to_string(mode) +
                                                ", settings " + std::to_string(settings));
  }
  if (!message.is(MessageId::kMtData)) {
    return Status(StatusCode::kInvalidInput,
                  "message " + std::to_string(message.id) + " is no MTData");
  }
  if (message.data.size() != layout.size()) {
    return Status(StatusCode::kInvalidInput, "MTData of " + std::to_string(message.data.size()) +
                                                 " bytes, expected " +
                                                 std::to_string(layout.size()));
  }
  ByteReader in(message.data);
  MtData data;
  if (layout.temperature) data.temperature_c = in.f32();
  if (layout.acceleration) data.acceleration = readVector(in);
  if (layout.gyro) data.angular_velocity = readVector(in);
  if (layout.magnetometer) data.magnetic_field = readVector(in);
  if (!allFinite(data)) return Status(StatusCode::kInvalidInput, "MTData with a value not finite");
  if (layout.orientation_floats > 0) {
    data.orientation = readOrientation(in, layout.orientation_floats);
    if (!data.orientation) {
      return Status(StatusCode::kInvalidInput, "MTData whose orientation is no rotation");
    }
  }
  if (layout.analog_in_1) data.analog_in_1 = in.u16();
  if (layout.analog_in_2) data.analog_in_2 = in.u16();
  if (layout.status) data.status = in.u8();
  if (layout.counter) data.counter = in.u16();
  return data;
}

double rotationDefect(const Message& message, std::uint16_t mode, std::uint32_t settings) {
  const Layout layout(mode, settings);
  if (layout.orientation_floats < 4 || !decodeMtData(message, mode, settings)) return 0.0;
  ByteReader in(message.data);
  if (layout.temperature) in.u32();
  for (const bool vector : {layout.acceleration, layout.gyro, layout.magnetometer}) {
    if (vector) readVector(in);
  }
  if (layout.orientation_floats == 9) return orthonormalityDefect(readNineFloats(in));
  const double w = in.f32();
  const Eigen::Vector3d v = readVector(in);
  return std::abs(Eigen::Quaterniond(w, v.x(), v.y(), v.z()).norm() - 1.0);
}

Message encodeMtData(const MtData& data, std::uint16_t mode, std::uint32_t settings) {
  const Layout layout(mode, settings);
  if (layout.size() == 0) {
    throw ConfigurationError("MTData cannot be encoded in output mode " + std::to_string(mode) +
                             ", settings " + std::to_string(settings));
  }
  ByteWriter out;
  if (layout.temperature) out.f32(required(data.temperature_c, "temperature"));
  if (layout.acceleration) writeVector(out, required(data.acceleration, "acceleration"));
  if (layout.gyro) writeVector(out, required(data.angular_velocity, "rate of turn"));
  if (layout.magnetometer) writeVector(out, required(data.magnetic_field, "magnetic field"));
  if (layout.orientation_floats > 0) {
    writeOrientation(out, required(data.orientation, "orientation"), layout.orientation_floats);
  }
  if (layout.analog_in_1) out.u16(required(data.analog_in_1, "analog input 1"));
  if (layout.analog_in_2) out.u16(required(data.analog_in_2, "analog input 2"));
  if (layout.status) out.u8(required(data.status, "status"));
  if (layout.counter) out.u16(required(data.counter, "sample counter"));
  return {static_cast<std::uint8_t>(MessageId::kMtData), out.bytes()};
}

}  // namespace scanner::mti
