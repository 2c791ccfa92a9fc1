#pragma once

#include <cstdint>
#include <string>

#include "bumblebee/iidc.h"

/// Offsets and bits of the IIDC 1.31 command register space and of Point Grey's additions. Bits are
/// counted from the least significant one; the specifications count from the other end.
namespace scanner::bumblebee::iidc {

/// Command registers begin here in the initial register space; absolute-value and Format7 registers
/// are addressed in quadlets from 0xFFFFF0000000.
inline constexpr std::uint64_t kCommandBase = 0xF00000;

inline constexpr std::uint64_t kFormatInquiry = 0x100;
inline constexpr std::uint64_t kFormat7ModeInquiry = 0x19C;
inline constexpr std::uint64_t kFormat7Mode3Csr = 0x2EC;
inline constexpr std::uint64_t kBasicFunctionInquiry = 0x400;
inline constexpr std::uint64_t kFeatureInquiry = 0x404;
inline constexpr std::uint64_t kFeatureElementInquiry = 0x500;  // + 4 * feature
inline constexpr std::uint64_t kVideoMode = 0x604;
inline constexpr std::uint64_t kVideoFormat = 0x608;
inline constexpr std::uint64_t kPower = 0x610;
inline constexpr std::uint64_t kIsoEnable = 0x614;
inline constexpr std::uint64_t kAbsoluteCsr = 0x700;   // + 4 * feature
inline constexpr std::uint64_t kFeatureValue = 0x800;  // + 4 * feature
// Point Grey
inline constexpr std::uint64_t kBayerTile = 0x1040;
inline constexpr std::uint64_t kImageDataFormat = 0x1048;
inline constexpr std::uint64_t kFrameInfo = 0x12F8;
inline constexpr std::uint64_t kSerialNumber = 0x1F20;
inline constexpr std::uint64_t kSensorBoard = 0x1F28;

/// Relative to the Format7 registers of a mode.
namespace format7 {
inline constexpr std::uint64_t kMaxImageSize = 0x00;
inline constexpr std::uint64_t kImagePosition = 0x08;
inline constexpr std::uint64_t kImageSize = 0x0C;
inline constexpr std::uint64_t kColorCoding = 0x10;
inline constexpr std::uint64_t kColorCodingInquiry = 0x14;
inline constexpr std::uint64_t kTotalBytesHigh = 0x38;
inline constexpr std::uint64_t kTotalBytesLow = 0x3C;
inline constexpr std::uint64_t kPacketParameters = 0x40;
inline constexpr std::uint64_t kBytesPerPacket = 0x44;
inline constexpr std::uint64_t kValueSetting = 0x7C;
inline constexpr std::uint32_t kMono16 = 5;
inline constexpr std::uint32_t kRaw16 = 10;
}  // namespace format7

inline constexpr std::uint32_t kPresent = 0x80000000;  // bit 31 of nearly every register
inline constexpr std::uint32_t kOn = 0x80000000;       // power, ISO_EN

/// Index within the feature registers.
enum class Feature : unsigned {
  kWhiteBalance = 3,
  kShutter = 7,
  kGain = 8,
  kTemperature = 11,
  kFrameRate = 15
};

std::string registerName(std::uint64_t offset);  // "0x1F28 (sensor board)"
/// Reads and writes whose failures name the register.
Result<std::uint32_t> read(const RegisterBus& bus, std::uint64_t offset);
Status write(RegisterBus& bus, std::uint64_t offset, std::uint32_t value);
/// What the sensor board register says; kUnsupported when it is no Bumblebee.
struct Sensor {
  int width_px = 0, height_px = 0;
  bool color = false;
};
Result<Sensor> readSensor(const RegisterBus& bus);
/// A quadlet pointer register as an offset in the command register space; kUnsupported for 0 and
/// for what lies before that space.
Result<std::uint64_t> readPointer(const RegisterBus& bus, std::uint64_t offset);

}  // namespace scanner::bumblebee::iidc
