#include "scanner/mti/mt_data2.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <string>

#include "scanner/core/se3.h"
#include "scanner/mti/bytes.h"

namespace scanner::mti {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kDegree = 0.017453292519943295;
/// As for MTData; fixed point 12.20 is finer than this, too.
constexpr double kRotationTolerance = 1e-3;
constexpr std::uint16_t kFormatBits = 0x3;
constexpr std::uint16_t kFrameBits = 0xC;
constexpr double kTwoTo20 = 1048576.0;
constexpr double kTwoTo32 = 4294967296.0;
constexpr std::size_t kUtcBytes = 12;

/// What a packet holds.
enum class Kind {
  kUnknown,
  kInteger,      ///< of a fixed length
  kUtc,          ///< UtcTime
  kNumbers,      ///< in the format of the identifier
  kFrameNumbers  ///< in the format and earth frame of the identifier
};
struct PacketType {
  Kind kind;
  std::size_t count;  ///< bytes of an integer, numbers otherwise
};

PacketType typeOf(std::uint16_t identifier) {
  switch (identifier & ~(kFormatBits | kFrameBits)) {
    case xdi::kUtcTime:
      return {Kind::kUtc, kUtcBytes};
    case xdi::kPacketCounter:
      return {Kind::kInteger, 2};
    case xdi::kStatusByte:
      return {Kind::kInteger, 1};
    case xdi::kSampleTimeFine:
    case xdi::kSampleTimeCoarse:
    case xdi::kPressure:
    case xdi::kStatusWord:
      return {Kind::kInteger, 4};
    case xdi::kTemperature:
    case xdi::kAltitudeEllipsoid:
      return {Kind::kNumbers, 1};
    case xdi::kLatLon:
      return {Kind::kNumbers, 2};
    case xdi::kDeltaV:
    case xdi::kAcceleration:
    case xdi::kAccelerationHr:
    case xdi::kRateOfTurn:
    case xdi::kRateOfTurnHr:
    case xdi::kMagneticField:
    case xdi::kPositionEcef:
      return {Kind::kNumbers, 3};
    case xdi::kDeltaQ:
      return {Kind::kNumbers, 4};
    case xdi::kEulerAngles:
    case xdi::kFreeAcceleration:
    case xdi::kVelocity:
      return {Kind::kFrameNumbers, 3};
    case xdi::kQuaternion:
      return {Kind::kFrameNumbers, 4};
    case xdi::kRotationMatrix:
      return {Kind::kFrameNumbers, 9};
    default:
      return {Kind::kUnknown, 0};
  }
}

std::uint16_t baseOf(std::uint16_t identifier) {
  return static_cast<std::uint16_t>(identifier & ~(kFormatBits | kFrameBits));
}

/// The low nibble says nothing about integers, and the fourth frame does not exist.
bool isKnown(std::uint16_t identifier) {
  const Kind kind = typeOf(identifier).kind;
  const bool plain = kind == Kind::kInteger || kind == Kind::kUtc;
  if (plain) return (identifier & (kFormatBits | kFrameBits)) == 0;
  return kind != Kind::kUnknown && (identifier & kFrameBits) != kFrameBits;
}

std::size_t bytesPerNumber(std::uint16_t identifier) {
  constexpr std::size_t kBytes[] = {4, 4, 6, 8};
  return kBytes[identifier & kFormatBits];
}

std::size_t sizeOf(std::uint16_t identifier) {
  const PacketType type = typeOf(identifier);
  const bool plain = type.kind == Kind::kInteger || type.kind == Kind::kUtc;
  return plain ? type.count : type.count * bytesPerNumber(identifier);
}

std::string nameOf(std::uint16_t identifier) {
  char text[16];
  std::snprintf(text, sizeof(text), "0x%04X", static_cast<unsigned>(identifier));
  return text;
}

template <typename To, typename From>
To bitsAs(From from) {
  static_assert(sizeof(To) == sizeof(From));
  To to;
  std::memcpy(&to, &from, sizeof(to));
  return to;
}

double readNumber(ByteReader& in, std::uint16_t identifier) {
  switch (identifier & kFormatBits) {
    case xdi::kFloat:
      return in.f32();
    case xdi::kFixed1220:
      return bitsAs<std::int32_t>(in.u32()) / kTwoTo20;
    case xdi::kFixed1632: {  // the fraction comes first
      const std::uint32_t fraction = in.u32();
      return bitsAs<std::int16_t>(in.u16()) + fraction / kTwoTo32;
    }
    default: {
      const std::uint64_t high = in.u32();
      return bitsAs<double>((high << 32U) | in.u32());
    }
  }
}

void writeNumber(ByteWriter& out, std::uint16_t identifier, double value) {
  const std::uint16_t format = identifier & kFormatBits;
  if (!std::isfinite(value)) throw ConfigurationError("MTData2: a value that is not finite");
  if (format == xdi::kFloat) {
    if (std::abs(value) > static_cast<double>(std::numeric_limits<float>::max())) {
      throw ConfigurationError("MTData2: " + std::to_string(value) + " in single precision");
    }
    return out.f32(value);
  }
  if (format == xdi::kDouble) {
    const auto bits = bitsAs<std::uint64_t>(value);
    out.u32(static_cast<std::uint32_t>(bits >> 32U));
    return out.u32(static_cast<std::uint32_t>(bits & 0xFFFFFFFFU));
  }
  const double scaled = std::nearbyint(value * (format == xdi::kFixed1220 ? kTwoTo20 : kTwoTo32));
  const double limit = format == xdi::kFixed1220 ? 2147483648.0 : 140737488355328.0;
  if (scaled < -limit || scaled >= limit) {
    throw ConfigurationError("MTData2: " + std::to_string(value) + " in fixed point");
  }
  const auto fixed = static_cast<std::int64_t>(scaled);
  out.u32(static_cast<std::uint32_t>(fixed & 0xFFFFFFFF));
  if (format == xdi::kFixed1632) out.u16(static_cast<std::uint16_t>((fixed >> 32U) & 0xFFFF));
}

double orthonormalityDefect(const Matrix3d& m) {
  return (m * m.transpose() - Matrix3d::Identity()).cwiseAbs().maxCoeff();
}

bool isRotation(const Matrix3d& m) {
  return orthonormalityDefect(m) < kRotationTolerance && m.determinant() > 0.0;
}

bool isRotation(const Quaterniond& q) { return std::abs(q.norm() - 1.0) < kRotationTolerance; }

/// Calls `visitor` with the field of `data` that packets of this (known) identifier hold.
template <typename Data, typename Visitor>
void visitField(std::uint16_t identifier, Data& data, Visitor&& visitor) {
  switch (baseOf(identifier)) {
    case xdi::kTemperature:
      return visitor(data.temperature_c);
    case xdi::kUtcTime:
      return visitor(data.utc_time);
    case xdi::kPacketCounter:
      return visitor(data.packet_counter);
    case xdi::kSampleTimeFine:
      return visitor(data.sample_time_fine);
    case xdi::kSampleTimeCoarse:
      return visitor(data.sample_time_coarse);
    case xdi::kQuaternion:
      return visitor(data.quaternion);
    case xdi::kRotationMatrix:
      return visitor(data.rotation_matrix);
    case xdi::kEulerAngles:
      return visitor(data.euler_deg);
    case xdi::kPressure:
      return visitor(data.pressure_pa);
    case xdi::kDeltaV:
      return visitor(data.delta_v);
    case xdi::kAcceleration:
      return visitor(data.acceleration);
    case xdi::kFreeAcceleration:
      return visitor(data.free_acceleration);
    case xdi::kAccelerationHr:
      return visitor(data.acceleration_hr);
    case xdi::kAltitudeEllipsoid:
      return visitor(data.altitude_m);
    case xdi::kPositionEcef:
      return visitor(data.position_ecef_m);
    case xdi::kLatLon:
      return visitor(data.lat_lon_deg);
    case xdi::kRateOfTurn:
      return visitor(data.angular_velocity);
    case xdi::kDeltaQ:
      return visitor(data.delta_q);
    case xdi::kRateOfTurnHr:
      return visitor(data.angular_velocity_hr);
    case xdi::kMagneticField:
      return visitor(data.magnetic_field);
    case xdi::kVelocity:
      return visitor(data.velocity);
    case xdi::kStatusByte:
      return visitor(data.status_byte);
    default:  // kStatusWord
      return visitor(data.status_word);
  }
}

/// Reads one packet into its field and says what is wrong with it.
class PacketReader {
 public:
  PacketReader(ByteReader& in, std::uint16_t identifier) : in_(in), identifier_(identifier) {}

  template <typename T>
  void operator()(std::optional<T>& field) {
    if (field) trouble_ = "comes twice";
    field.emplace();
    read(*field);
  }
  /// Nothing, or what is wrong.
  const char* trouble() const { return trouble_; }

 private:
  void read(std::uint8_t& value) { value = in_.u8(); }
  void read(std::uint16_t& value) { value = in_.u16(); }
  void read(std::uint32_t& value) { value = in_.u32(); }
  void read(double& value) {
    value = readNumber(in_, identifier_);
    if (!std::isfinite(value)) trouble_ = "is not finite";
  }
  void read(Eigen::Vector2d& v) {
    for (double& value : v) read(value);
  }
  void read(Vector3d& v) {
    for (double& value : v) read(value);
  }
  void read(Quaterniond& q) {
    read(q.w());
    for (int i = 0; i < 3; ++i) read(q.coeffs()[i]);
    if (!isRotation(q) && trouble_ == nullptr) trouble_ = "is no rotation";
  }
  void read(Matrix3d& m) {
    for (double& value : m.reshaped()) read(value);  // column by column
    if (!isRotation(m) && trouble_ == nullptr) trouble_ = "is no rotation";
  }
  template <typename T>
  void read(InFrame<T>& framed) {
    framed.frame = static_cast<EarthFrame>(identifier_ & kFrameBits);
    read(framed.value);
  }
  void read(UtcTime& time) {
    time.nanoseconds = in_.u32();
    time.year = in_.u16();
    for (int* part : {&time.month, &time.day, &time.hour, &time.minute, &time.second}) {
      *part = in_.u8();
    }
    time.flags = in_.u8();
  }

  ByteReader& in_;
  std::uint16_t identifier_;
  const char* trouble_ = nullptr;
};

/// Writes one packet's value from its field.
class PacketWriter {
 public:
  PacketWriter(ByteWriter& out, std::uint16_t identifier) : out_(out), identifier_(identifier) {}

  template <typename T>
  void operator()(const std::optional<T>& field) {
    if (!field) throw ConfigurationError("MTData2 to be encoded lacks " + nameOf(identifier_));
    write(*field);
  }

 private:
  void write(std::uint8_t value) { out_.u8(value); }
  void write(std::uint16_t value) { out_.u16(value); }
  void write(std::uint32_t value) { out_.u32(value); }
  void write(double value) { writeNumber(out_, identifier_, value); }
  void write(const Eigen::Vector2d& v) {
    for (const double value : v) write(value);
  }
  void write(const Vector3d& v) {
    for (const double value : v) write(value);
  }
  void write(const Quaterniond& q) {
    write(q.w());
    write(Vector3d(q.vec()));
  }
  void write(const Matrix3d& m) {
    for (const double value : m.reshaped()) write(value);  // column by column
  }
  template <typename T>
  void write(const InFrame<T>& framed) {
    if (static_cast<std::uint16_t>(framed.frame) != (identifier_ & kFrameBits)) {
      throw ConfigurationError("MTData2 to be encoded: " + nameOf(identifier_) +
                               " is in another earth frame");
    }
    write(framed.value);
  }
  void write(const UtcTime& time) {
    out_.u32(time.nanoseconds);
    out_.u16(static_cast<std::uint16_t>(time.year));
    for (const int part : {time.month, time.day, time.hour, time.minute, time.second}) {
      out_.u8(static_cast<std::uint8_t>(part));
    }
    out_.u8(time.flags);
  }

  ByteWriter& out_;
  std::uint16_t identifier_;
};

Status damaged(std::uint16_t identifier, const std::string& what) {
  return {StatusCode::kInvalidInput, "MTData2 packet " + nameOf(identifier) + " " + what};
}

Quaterniond northWestUpFrom(EarthFrame frame) {
  switch (frame) {
    case EarthFrame::kEastNorthUp:
      return Quaterniond(Eigen::AngleAxisd(-90.0 * kDegree, Vector3d::UnitZ()));
    case EarthFrame::kNorthEastDown:
      return {0.0, 1.0, 0.0, 0.0};
    default:
      return Quaterniond::Identity();
  }
}

}  // namespace

std::optional<InFrame<Quaterniond>> MtData2::orientation() const {
  if (quaternion) return InFrame<Quaterniond>{quaternion->value.normalized(), quaternion->frame};
  if (rotation_matrix) {
    return InFrame<Quaterniond>{Quaterniond(nearestRotation(rotation_matrix->value)),
                                rotation_matrix->frame};
  }
  if (!euler_deg) return std::nullopt;
  const Vector3d angles = kDegree * euler_deg->value;
  return InFrame<Quaterniond>{Quaterniond(Eigen::AngleAxisd(angles.z(), Vector3d::UnitZ()) *
                                          Eigen::AngleAxisd(angles.y(), Vector3d::UnitY()) *
                                          Eigen::AngleAxisd(angles.x(), Vector3d::UnitX())),
                              euler_deg->frame};
}

double MtData2::rotationDefect() const {
  double defect = 0.0;
  if (quaternion) defect = std::abs(quaternion->value.norm() - 1.0);
  if (rotation_matrix) defect = std::max(defect, orthonormalityDefect(rotation_matrix->value));
  return defect;
}

Result<MtData2> decodeMtData2(const Message& message) {
  if (!message.is(MessageId::kMtData2)) {
    return Status(StatusCode::kInvalidInput,
                  "message " + std::to_string(message.id) + " is no MTData2");
  }
  ByteReader in(message.data);
  MtData2 data;
  std::size_t left = message.data.size();
  while (left > 0) {
    if (left < 3) return Status(StatusCode::kInvalidInput, "MTData2 ends within a packet's header");
    const std::uint16_t identifier = in.u16();
    const std::size_t size = in.u8();
    left -= 3;
    if (size > left) return damaged(identifier, "is longer than the message");
    left -= size;
    if (!isKnown(identifier)) {
      for (std::size_t i = 0; i < size; ++i) in.u8();
      ++data.skipped;
      continue;
    }
    if (size != sizeOf(identifier)) {
      return damaged(identifier, "has " + std::to_string(size) + " bytes");
    }
    PacketReader packet(in, identifier);
    visitField(identifier, data, packet);
    if (packet.trouble() != nullptr) return damaged(identifier, packet.trouble());
  }
  return data;
}

Message encodeMtData2(const MtData2& data, const std::vector<std::uint16_t>& identifiers) {
  ByteWriter out;
  for (const std::uint16_t identifier : identifiers) {
    if (!isKnown(identifier)) {
      throw ConfigurationError("MTData2 identifier " + nameOf(identifier) + " is not known");
    }
    out.u16(identifier);
    out.u8(static_cast<std::uint8_t>(sizeOf(identifier)));
    visitField(identifier, data, PacketWriter(out, identifier));
  }
  return {static_cast<std::uint8_t>(MessageId::kMtData2), out.bytes()};
}

MtData toMtData(const MtData2& data) {
  MtData out;
  out.temperature_c = data.temperature_c;
  out.acceleration = data.acceleration ? data.acceleration : data.acceleration_hr;
  out.angular_velocity = data.angular_velocity ? data.angular_velocity : data.angular_velocity_hr;
  out.magnetic_field = data.magnetic_field;
  if (const auto orientation = data.orientation()) {
    out.orientation = northWestUpFrom(orientation->frame) * orientation->value;
  }
  out.status = data.status_byte;
  if (data.status_word) out.status = static_cast<std::uint8_t>(*data.status_word & 0xFFU);
  out.counter = data.packet_counter;
  return out;
}

}  // namespace scanner::mti
