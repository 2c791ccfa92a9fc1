#include "bumblebee/iidc.h"

#include <chrono>
#include <cstdio>
#include <thread>
#include <utility>

#include "bumblebee/iidc_registers.h"

namespace scanner::bumblebee {
namespace {

using iidc::kBasicFunctionInquiry;
using iidc::kBayerTile;
using iidc::kFormat7Mode3Csr;
using iidc::kFormat7ModeInquiry;
using iidc::kFormatInquiry;
using iidc::kFrameInfo;
using iidc::kImageDataFormat;
using iidc::kIsoEnable;
using iidc::kOn;
using iidc::kPower;
using iidc::kPresent;
using iidc::kSerialNumber;
using iidc::kVideoFormat;
using iidc::kVideoMode;
using iidc::read;
using iidc::readPointer;
using iidc::readSensor;
using iidc::registerName;
using iidc::Sensor;
using iidc::write;
namespace format7 = iidc::format7;

std::string hex(std::uint64_t value) {
  char text[24];
  std::snprintf(text, sizeof text, "0x%llX", static_cast<unsigned long long>(value));
  return text;
}

Status unsupported(std::uint64_t offset, const std::string& what) {
  return {StatusCode::kUnsupported, "register " + registerName(offset) + " " + what};
}

Result<PixelFormat> readPixelFormat(const RegisterBus& bus, const Sensor& sensor) {
  if (!sensor.color) return PixelFormat::kMono8;
  const auto tile = read(bus, kBayerTile);
  if (!tile) return tile.status();
  switch (*tile) {  // four letters
    case 0x52474742:
      return PixelFormat::kBayerRggb8;
    case 0x47425247:
      return PixelFormat::kBayerGbrg8;
    case 0x47524247:
      return PixelFormat::kBayerGrbg8;
    case 0x42474752:
      return PixelFormat::kBayerBggr8;
    case 0x59595959:
      return PixelFormat::kMono8;
    default:
      return unsupported(kBayerTile, "is " + hex(*tile) + ": unknown Bayer tile");
  }
}

/// Reads until the bits of `mask` equal `expected`. The camera has no event for it, so it is asked
/// every 2 ms, a second at most.
Status waitFor(const RegisterBus& bus, std::uint64_t offset, std::uint32_t mask,
               std::uint32_t expected) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(1);
  for (;;) {
    const auto value = read(bus, offset);
    if (!value) return value.status();
    if ((*value & mask) == expected) return Status::ok();
    if (std::chrono::steady_clock::now() > deadline)
      return {StatusCode::kIoError, "register " + registerName(offset) + " stays at " +
                                        hex(*value) + ", wanted " + hex(expected) + " in " +
                                        hex(mask)};
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

Status powerOn(RegisterBus& bus) {
  constexpr std::uint32_t kPowerControl = 1U << 15;
  const auto functions = read(bus, kBasicFunctionInquiry);
  if (!functions) return functions.status();
  if ((*functions & kPowerControl) == 0) return Status::ok();
  if (auto status = write(bus, kPower, kOn); !status) return status;
  return waitFor(bus, kPower, kOn, kOn);
}

/// IIDC 1.30 handshake: tell the camera to look at the values, wait, see whether it likes them.
Status settle(RegisterBus& bus, std::uint64_t csr) {
  constexpr std::uint32_t kSetting = 1U << 30, kError1 = 1U << 23, kError2 = 1U << 22;
  const std::uint64_t offset = csr + format7::kValueSetting;
  const auto before = read(bus, offset);
  // Firmware before 1.30 has no such register; then there is nothing to wait for.
  if (!before || (*before & kPresent) == 0) return Status::ok();
  if (auto status = write(bus, offset, kSetting); !status) return status;
  if (auto status = waitFor(bus, offset, kSetting, 0); !status) return status;
  const auto after = read(bus, offset);
  if (!after) return after.status();
  if ((*after & kError1) != 0)
    return unsupported(offset, "refuses the image position, size or coding");
  if ((*after & kError2) != 0) return unsupported(offset, "refuses the packet size");
  return Status::ok();
}

Status selectMode3(RegisterBus& bus) {
  const auto formats = read(bus, kFormatInquiry);
  if (!formats) return formats.status();
  if ((*formats & (kPresent >> 7)) == 0)
    return unsupported(kFormatInquiry, "is " + hex(*formats) + ": no Format7");
  const auto modes = read(bus, kFormat7ModeInquiry);
  if (!modes) return modes.status();
  if ((*modes & (kPresent >> 3)) == 0)
    return unsupported(kFormat7ModeInquiry, "is " + hex(*modes) + ": no Format7 mode 3");
  if (auto status = write(bus, kVideoFormat, 7U << 29); !status) return status;
  return write(bus, kVideoMode, 3U << 29);
}

/// Whole sensor, 16 bits per sample.
Status selectImage(RegisterBus& bus, std::uint64_t csr, const Sensor& sensor) {
  const auto width = static_cast<std::uint32_t>(sensor.width_px);
  const auto height = static_cast<std::uint32_t>(sensor.height_px);
  const auto largest = read(bus, csr + format7::kMaxImageSize);
  if (!largest) return largest.status();
  if ((*largest >> 16) < width || (*largest & 0xFFFF) < height)
    return unsupported(csr + format7::kMaxImageSize,
                       "is " + hex(*largest) + ": smaller than the sensor");
  const auto codings = read(bus, csr + format7::kColorCodingInquiry);
  if (!codings) return codings.status();
  const std::uint32_t coding = sensor.color ? format7::kRaw16 : format7::kMono16;
  if ((*codings & (kPresent >> coding)) == 0)
    return unsupported(csr + format7::kColorCodingInquiry,
                       "is " + hex(*codings) + (sensor.color ? ": no RAW16" : ": no MONO16"));
  const std::pair<std::uint64_t, std::uint32_t> values[] = {
      {csr + format7::kImagePosition, 0},
      {csr + format7::kImageSize, width << 16 | height},
      {csr + format7::kColorCoding, coding << 24}};
  for (const auto& [offset, value] : values)
    if (auto status = write(bus, offset, value); !status) return status;
  if (auto status = settle(bus, csr); !status) return status;
  const auto size = read(bus, csr + format7::kImageSize);
  if (!size) return size.status();
  if (*size != (width << 16 | height))
    return unsupported(csr + format7::kImageSize, "is " + hex(*size) + " after it was set");
  return Status::ok();
}

/// The largest packet that the camera offers: one stereo camera may have the bus for itself, and
/// the frame rate has a register of its own.
Result<std::uint32_t> selectPacket(RegisterBus& bus, std::uint64_t csr,
                                   std::uint64_t bytes_per_frame) {
  const auto parameters = read(bus, csr + format7::kPacketParameters);
  if (!parameters) return parameters.status();
  const std::uint32_t unit = *parameters >> 16, largest = *parameters & 0xFFFF;
  if (unit == 0 || largest < unit)
    return unsupported(csr + format7::kPacketParameters, "is " + hex(*parameters));
  const std::uint32_t bytes = largest / unit * unit;
  const std::uint64_t offset = csr + format7::kBytesPerPacket;
  if (auto status = write(bus, offset, bytes << 16); !status) return status;
  if (auto status = settle(bus, csr); !status) return status;
  const auto packet = read(bus, offset);
  if (!packet) return packet.status();
  if ((*packet >> 16) == 0) return unsupported(offset, "is 0 after it was set");
  const auto low = read(bus, csr + format7::kTotalBytesLow);
  if (!low) return low.status();
  const auto high = read(bus, csr + format7::kTotalBytesHigh);
  if (!high) return high.status();
  // Some padding of the last packet is possible; less than a frame is not.
  if ((static_cast<std::uint64_t>(*high) << 32 | *low) < bytes_per_frame)
    return unsupported(csr + format7::kTotalBytesLow, "says " + std::to_string(*low) +
                                                          " bytes per frame, expected " +
                                                          std::to_string(bytes_per_frame));
  return *packet >> 16;
}

Status selectByteOrder(RegisterBus& bus) {
  constexpr std::uint32_t kLittleEndian = 0x80000000, kOrderBit = 1;
  if (auto status = write(bus, kImageDataFormat, kLittleEndian); !status) return status;
  const auto order = read(bus, kImageDataFormat);
  if (!order) return order.status();
  if ((*order & (kPresent | kOrderBit)) != kLittleEndian)
    return unsupported(kImageDataFormat, "is " + hex(*order) + " after " + hex(kLittleEndian) +
                                             " was written: left and right would be uncertain");
  return Status::ok();
}

/// Time stamp and counter on, all else off, so that their places are known. A camera without the
/// register streams without them.
Status selectFrameInfo(RegisterBus& bus, FrameFormat* format) {
  constexpr std::uint32_t kTimestamp = 1U << 0, kCounter = 1U << 6, kAll = 0x3FF;
  const auto before = read(bus, kFrameInfo);
  if (!before || (*before & kPresent) == 0) return Status::ok();
  if (auto status = write(bus, kFrameInfo, (*before & ~kAll) | kTimestamp | kCounter); !status)
    return status;
  const auto after = read(bus, kFrameInfo);
  if (!after) return after.status();
  if ((*after & kAll & ~(kTimestamp | kCounter)) != 0)
    return unsupported(kFrameInfo, "is " + hex(*after) + " after it was set");
  format->embedded_timestamp = (*after & kTimestamp) != 0;
  format->embedded_counter = (*after & kCounter) != 0;
  return Status::ok();
}

}  // namespace

namespace iidc {

Result<Sensor> readSensor(const RegisterBus& bus) {
  const auto board = read(bus, kSensorBoard);
  if (!board) return board.status();
  switch (*board & 0xF) {
    case 0xA:
      return Sensor{640, 480, true};
    case 0xB:
      return Sensor{640, 480, false};
    case 0xC:
      return Sensor{1024, 768, true};
    case 0xD:
      return Sensor{1024, 768, false};
    case 0xE:
      return Sensor{1280, 960, true};
    case 0xF:
      return Sensor{1280, 960, false};
    default:
      return unsupported(kSensorBoard, "is " + hex(*board) + ": no Bumblebee");
  }
}

std::string registerName(std::uint64_t offset) {
  static constexpr std::pair<std::uint64_t, const char*> kNames[] = {
      {kFormatInquiry, "format inquiry"},
      {kFormat7ModeInquiry, "Format7 mode inquiry"},
      {kFormat7Mode3Csr, "Format7 mode 3 registers"},
      {kBasicFunctionInquiry, "basic function inquiry"},
      {kFeatureInquiry, "feature inquiry"},
      {kVideoMode, "video mode"},
      {kVideoFormat, "video format"},
      {kPower, "camera power"},
      {kIsoEnable, "ISO_EN"},
      {kFeatureValue + 4 * static_cast<std::uint64_t>(Feature::kWhiteBalance), "white balance"},
      {kFeatureValue + 4 * static_cast<std::uint64_t>(Feature::kShutter), "shutter"},
      {kFeatureValue + 4 * static_cast<std::uint64_t>(Feature::kGain), "gain"},
      {kFeatureValue + 4 * static_cast<std::uint64_t>(Feature::kTemperature), "temperature"},
      {kFeatureValue + 4 * static_cast<std::uint64_t>(Feature::kFrameRate), "frame rate"},
      {kBayerTile, "Bayer tile"},
      {kImageDataFormat, "image data format"},
      {kFrameInfo, "frame information"},
      {kSerialNumber, "serial number"},
      {kSensorBoard, "sensor board"}};
  for (const auto& [known, name] : kNames)
    if (known == offset) return hex(offset) + " (" + name + ")";
  return hex(offset);
}

Result<std::uint32_t> read(const RegisterBus& bus, std::uint64_t offset) {
  auto value = bus.read(offset);
  if (!value)
    return Status(value.status().code(), "register " + registerName(offset) +
                                             " cannot be read: " + value.status().message());
  return value;
}

Status write(RegisterBus& bus, std::uint64_t offset, std::uint32_t value) {
  const Status status = bus.write(offset, value);
  if (status) return status;
  return {status.code(), "register " + registerName(offset) + " cannot be set to " + hex(value) +
                             ": " + status.message()};
}

Result<std::uint64_t> readPointer(const RegisterBus& bus, std::uint64_t offset) {
  const auto quadlets = read(bus, offset);
  if (!quadlets) return quadlets.status();
  const std::uint64_t address = 4 * static_cast<std::uint64_t>(*quadlets);
  if (address < kCommandBase)
    return unsupported(offset, "is " + hex(*quadlets) + ": points nowhere");
  return address - kCommandBase;
}

}  // namespace iidc

Result<IidcSetup> configureIidc(RegisterBus& bus, int width_px, int height_px, EyeOrder eye_order) {
  if (auto status = powerOn(bus); !status) return status;
  const auto sensor = readSensor(bus);
  if (!sensor) return sensor.status();
  if ((width_px != 0 && width_px != sensor->width_px) ||
      (height_px != 0 && height_px != sensor->height_px))
    return Status(StatusCode::kUnsupported,
                  "pictures of " + std::to_string(width_px) + "x" + std::to_string(height_px) +
                      " are not possible: this camera has " + std::to_string(sensor->width_px) +
                      "x" + std::to_string(sensor->height_px));
  // A program that crashed may have left the stream on; formats cannot change then.
  if (auto status = stopIidc(bus); !status) return status;
  if (auto status = selectMode3(bus); !status) return status;
  const auto csr = readPointer(bus, kFormat7Mode3Csr);
  if (!csr) return csr.status();
  if (auto status = selectImage(bus, *csr, *sensor); !status) return status;
  IidcSetup setup;
  setup.format.width_px = sensor->width_px;
  setup.format.height_px = sensor->height_px;
  const auto packet =
      selectPacket(bus, *csr, 2 * static_cast<std::uint64_t>(sensor->width_px) * sensor->height_px);
  if (!packet) return packet.status();
  setup.bytes_per_packet = *packet;
  const auto pixels = readPixelFormat(bus, *sensor);
  if (!pixels) return pixels.status();
  setup.format.pixels = *pixels;
  if (auto status = selectByteOrder(bus); !status) return status;
  setup.format.order =
      eye_order == EyeOrder::kLeftFirst ? ByteOrder::kLeftFirst : ByteOrder::kRightFirst;
  if (auto status = selectFrameInfo(bus, &setup.format); !status) return status;
  return setup;
}

Status startIidc(RegisterBus& bus) {
  if (auto status = write(bus, kIsoEnable, kOn); !status) return status;
  return waitFor(bus, kIsoEnable, kOn, kOn);
}

Status stopIidc(RegisterBus& bus) { return write(bus, kIsoEnable, 0); }

Result<std::uint32_t> iidcSerialNumber(const RegisterBus& bus) { return read(bus, kSerialNumber); }

EmbeddedInfo readEmbeddedInfo(const std::uint8_t* bytes, std::size_t size,
                              const FrameFormat& format) {
  EmbeddedInfo info;
  const std::size_t fields =
      (format.embedded_timestamp ? 1U : 0U) + (format.embedded_counter ? 1U : 0U);
  if (size < 4 * fields) return info;
  std::size_t next = 0;
  const auto quadlet = [bytes, &next] {
    std::uint32_t value = 0;
    for (int i = 0; i < 4; ++i) value = value << 8 | bytes[next++];
    return value;
  };
  if (format.embedded_timestamp) {
    const std::uint32_t timer = quadlet();
    const std::uint32_t cycle = timer >> 12 & 0x1FFF, offset = timer & 0xFFF;
    if (cycle < 8000 && offset < 3072)
      info.cycle_time = std::chrono::seconds(timer >> 25) + std::chrono::microseconds(125 * cycle) +
                        Duration(offset * 125000LL / 3072);
  }
  if (format.embedded_counter) info.counter = quadlet();
  return info;
}

}  // namespace scanner::bumblebee
