// libFuzzer target: whatever a camera sends as a frame, as embedded information and as the text of
// its factory calibration, either it is refused or every pixel is the one that was sent.
//
// Input: 1 byte what to do, then for frames 8 bytes of format and a buffer.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <vector>

#include "bumblebee/iidc.h"
#include "scanner/bumblebee/decode.h"
#include "scanner/bumblebee/factory_calibration.h"

namespace {

using namespace scanner;             // NOLINT(google-build-using-namespace)
using namespace scanner::bumblebee;  // NOLINT(google-build-using-namespace)

constexpr std::size_t kFormatBytes = 8;

void require(bool holds) {
  if (!holds) std::abort();
}

/// Sides small enough to be met by buffers, and at times any number at all.
int side(std::uint8_t low, std::uint8_t high) {
  if (high < 0xF0) return low % 64;
  const auto value = static_cast<std::uint32_t>(low) << 24U | static_cast<std::uint32_t>(high);
  return static_cast<std::int32_t>(value);
}

FrameFormat formatFrom(const std::uint8_t* data) {
  FrameFormat format;
  format.width_px = side(data[0], data[1]);
  format.height_px = side(data[2], data[3]);
  format.order = (data[4] & 1U) != 0 ? ByteOrder::kRightFirst : ByteOrder::kLeftFirst;
  format.embedded_timestamp = (data[4] & 2U) != 0;
  format.embedded_counter = (data[4] & 4U) != 0;
  format.pixels = static_cast<PixelFormat>(data[5] % 6U);
  return format;
}

/// How a buffer's size relates to what the format asks for: as it is, exact, or off by some bytes.
std::vector<std::uint8_t> bufferFrom(const std::uint8_t* data, std::size_t size, std::uint8_t how,
                                     const FrameFormat& format) {
  std::vector<std::uint8_t> bytes(data, data + size);
  if (how >= 200 || !checkFormat(format)) return bytes;
  const std::size_t exact = frameBytes(format);
  if (exact > (1U << 20U)) return bytes;
  const std::size_t off = how % 4U == 0 ? how / 4U % 16U : 0;
  bytes.resize(how % 8U == 0 ? exact + off : exact - std::min(exact, off), 0x5A);
  return bytes;
}

void checkPicture(const Image& eye, const FrameFormat& format, std::size_t offset,
                  const std::vector<std::uint8_t>& bytes) {
  require(eye.data.cols == format.width_px && eye.data.rows == format.height_px);
  require(eye.data.type() == CV_8UC1 && eye.format == format.pixels);
  const int embedded =
      2 * ((format.embedded_timestamp ? 1 : 0) + (format.embedded_counter ? 1 : 0));
  for (int y = 0; y < eye.data.rows; ++y) {
    for (int x = 0; x < eye.data.cols; ++x) {
      const int from = y == 0 && x < embedded ? 2 : y;
      const auto at = 2 * static_cast<std::size_t>(from * format.width_px + x) + offset;
      require(eye.data.at<std::uint8_t>(y, x) == bytes[at]);
    }
  }
}

void checkStatistics(const EyeStatistics& s) {
  require(s.mean_level >= 0.0 && s.mean_level <= 1.0);
  require(s.saturated_share >= 0.0 && s.saturated_share <= 1.0);
}

void fuzzFrame(const std::uint8_t* data, std::size_t size) {
  if (size < kFormatBytes) return;
  const FrameFormat format = formatFrom(data);
  RawFrame frame;
  if (data[6] != 0xFF) {
    frame.bytes = std::make_shared<const std::vector<std::uint8_t>>(
        bufferFrom(data + kFormatBytes, size - kFormatBytes, data[6], format));
  }
  const bool damaged = data[7] == 0xFF;
  if (damaged) frame.status = Status(StatusCode::kIoError, "short");
  const Result<DecodedPair> pair = decodeFrame(frame, format);
  if (!pair) {
    require(!pair.status().message().empty());
    // What is whole and has a format that can be is not refused.
    const bool whole = frame.bytes != nullptr && !damaged && checkFormat(format) &&
                       frame.bytes->size() == frameBytes(format);
    require(!whole);
    return;
  }
  require(!damaged && frame.bytes->size() == frameBytes(format));
  const bool left_first = format.order == ByteOrder::kLeftFirst;
  checkPicture(pair->left, format, left_first ? 0 : 1, *frame.bytes);
  checkPicture(pair->right, format, left_first ? 1 : 0, *frame.bytes);
  for (const EyeStatistics& s : pair->statistics) checkStatistics(s);
}

void fuzzEmbedded(const std::uint8_t* data, std::size_t size) {
  if (size < kFormatBytes) return;
  const FrameFormat format = formatFrom(data);
  // A buffer of its own, so that a read beyond its end is seen.
  const std::vector<std::uint8_t> bytes(data + kFormatBytes, data + size);
  const EmbeddedInfo info = readEmbeddedInfo(bytes.data(), bytes.size(), format);
  require(!info.cycle_time || format.embedded_timestamp);
  require(!info.counter || format.embedded_counter);
  require(!info.cycle_time ||
          (toSeconds(*info.cycle_time) >= 0.0 && toSeconds(*info.cycle_time) <= 128.0 + 1e-3));
}

void fuzzCalibration(const std::uint8_t* data, std::size_t size) {
  const std::size_t read_size = size;
  const Result<FactoryCalibration> c =
      readFactoryCalibration([&](std::uint64_t offset) -> Result<std::uint32_t> {
        if (offset == kCalibrationLengthRegister) return static_cast<std::uint32_t>(read_size);
        require(offset >= kCalibrationDataRegister);
        std::uint32_t value = 0;
        const std::size_t at = static_cast<std::size_t>(offset - kCalibrationDataRegister);
        require(at % 4 == 0 && at < read_size);
        for (std::size_t i = at; i < at + 4; ++i) value = value << 8U | (i < size ? data[i] : 0U);
        return value;
      });
  if (!c) return;
  require(c->text.size() <= size &&
          std::equal(c->text.begin(), c->text.end(), data,
                     [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; }));
  require(!c->width_px || *c->width_px > 0);
  require(!c->height_px || *c->height_px > 0);
  require(!c->focal_length || *c->focal_length > 0.0);
  require(!c->baseline || *c->baseline > 0.0);
  require(!c->serial || !c->serial->empty());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  switch (data[0] % 3U) {
    case 0:
      fuzzFrame(data + 1, size - 1);
      break;
    case 1:
      fuzzEmbedded(data + 1, size - 1);
      break;
    default:
      fuzzCalibration(data + 1, size - 1);
  }
  return 0;
}
