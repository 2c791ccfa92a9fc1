#include "scanner/bumblebee/decode.h"

#include <cstddef>
#include <string>

namespace scanner::bumblebee {
namespace {

constexpr int kRowsPerBlock = 8;  ///< of which the first two are measured
constexpr int kEmbeddedFieldBytes = 4;
constexpr std::uint32_t kSaturated = 255;

std::string sizeText(const FrameFormat& format) {
  return std::to_string(format.width_px) + "x" + std::to_string(format.height_px);
}

int embeddedPixels(const FrameFormat& format) {
  const int fields = (format.embedded_timestamp ? 1 : 0) + (format.embedded_counter ? 1 : 0);
  return fields * kEmbeddedFieldBytes / 2;
}

/// Written so that compilers turn it into vector code: no branches, no aliasing.
void splitRow(const std::uint8_t* __restrict in, std::uint8_t* __restrict first,
              std::uint8_t* __restrict second, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) {
    first[i] = in[2 * i];
    second[i] = in[2 * i + 1];
  }
}

/// Two counters for neighbours: equal pixels in a row would otherwise wait for each other.
class HistogramCounter {
 public:
  void add(const std::uint8_t* row, std::size_t n) {
    std::size_t i = 0;
    for (; i + 1 < n; i += 2) {
      ++even_[row[i]];
      ++odd_[row[i + 1]];
    }
    if (i < n) ++even_[row[i]];
  }
  EyeStatistics statistics() const {
    EyeStatistics s;
    std::uint64_t count = 0;
    std::uint64_t sum = 0;
    for (std::size_t value = 0; value < s.histogram.size(); ++value) {
      s.histogram[value] = even_[value] + odd_[value];
      count += s.histogram[value];
      sum += value * s.histogram[value];
    }
    if (count == 0) return s;
    const double pixels = static_cast<double>(count);
    s.mean_level = static_cast<double>(sum) / (pixels * kSaturated);
    s.saturated_share = static_cast<double>(s.histogram[kSaturated]) / pixels;
    return s;
  }

 private:
  std::array<std::uint32_t, 256> even_{}, odd_{};
};

void coverEmbedded(cv::Mat& eye, int pixels) {
  for (int x = 0; x < pixels; ++x) eye.at<std::uint8_t>(0, x) = eye.at<std::uint8_t>(2, x);
}

}  // namespace

Status checkFormat(const FrameFormat& format) {
  const bool size_ok = format.width_px > 0 && format.height_px > 0 &&
                       format.width_px <= kLargestSide_px && format.height_px <= kLargestSide_px;
  if (!size_ok) {
    return {StatusCode::kInvalidInput, "frame format: " + sizeText(format) + " is no size"};
  }
  if (format.pixels != PixelFormat::kMono8 && !isBayer(format.pixels)) {
    return {StatusCode::kUnsupported,
            std::string("frame format: pixels are mono or Bayer, not ") + toString(format.pixels)};
  }
  if (isBayer(format.pixels) && (format.width_px % 2 != 0 || format.height_px % 2 != 0)) {
    return {StatusCode::kInvalidInput,
            "frame format: a Bayer picture has even sides, not " + sizeText(format)};
  }
  const int embedded = embeddedPixels(format);
  if (embedded > 0 && (format.width_px < embedded || format.height_px < 3)) {
    return {StatusCode::kInvalidInput,
            "frame format: " + sizeText(format) + " is too small for embedded information"};
  }
  return Status::ok();
}

std::size_t frameBytes(const FrameFormat& format) {
  return 2 * static_cast<std::size_t>(format.width_px) * static_cast<std::size_t>(format.height_px);
}

Result<DecodedPair> decodeFrame(const RawFrame& frame, const FrameFormat& format) {
  if (!frame.status) return frame.status;
  if (Status status = checkFormat(format); !status) return status;
  if (frame.bytes == nullptr) return Status(StatusCode::kInvalidInput, "frame without bytes");
  if (frame.bytes->size() != frameBytes(format)) {
    return Status(StatusCode::kInvalidInput, "frame of " + std::to_string(frame.bytes->size()) +
                                                 " bytes instead of " +
                                                 std::to_string(frameBytes(format)));
  }
  DecodedPair pair;
  pair.left = {cv::Mat(format.height_px, format.width_px, CV_8UC1), format.pixels};
  pair.right = {cv::Mat(format.height_px, format.width_px, CV_8UC1), format.pixels};
  const bool left_first = format.order == ByteOrder::kLeftFirst;
  const auto width = static_cast<std::size_t>(format.width_px);
  const auto row = [&](int y) {
    const std::uint8_t* in = frame.bytes->data() + 2 * width * static_cast<std::size_t>(y);
    auto* left = pair.left.data.ptr<std::uint8_t>(y);
    auto* right = pair.right.data.ptr<std::uint8_t>(y);
    splitRow(in, left_first ? left : right, left_first ? right : left, width);
  };
  std::array<HistogramCounter, 2> counters;
  for (int y = 0; y < format.height_px; ++y) {
    row(y);
    // Row 0 may hold embedded information, which is covered from row 2: measured after the loop.
    if (y == 0 || y % kRowsPerBlock >= 2) continue;
    counters[0].add(pair.left.data.ptr<std::uint8_t>(y), width);
    counters[1].add(pair.right.data.ptr<std::uint8_t>(y), width);
  }
  coverEmbedded(pair.left.data, embeddedPixels(format));
  coverEmbedded(pair.right.data, embeddedPixels(format));
  counters[0].add(pair.left.data.ptr<std::uint8_t>(0), width);
  counters[1].add(pair.right.data.ptr<std::uint8_t>(0), width);
  pair.statistics = {counters[0].statistics(), counters[1].statistics()};
  return pair;
}

}  // namespace scanner::bumblebee
