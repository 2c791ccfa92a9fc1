#include "scanner/bumblebee/decode.h"

#include <gtest/gtest.h>

#include <memory>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace scanner::bumblebee {
namespace {

using Bytes = std::vector<std::uint8_t>;

RawFrame frameOf(Bytes bytes) {
  RawFrame frame;
  frame.bytes = std::make_shared<const Bytes>(std::move(bytes));
  return frame;
}

FrameFormat formatOf(int width, int height, PixelFormat pixels = PixelFormat::kBayerRggb8) {
  FrameFormat format;
  format.width_px = width;
  format.height_px = height;
  format.pixels = pixels;
  return format;
}

/// No symmetry in any direction, and other for each eye.
std::uint8_t pixel(int x, int y, int eye) {
  return static_cast<std::uint8_t>(3 * x + 5 * y + ((x * y) % 7) + 90 * eye);
}

Bytes interleaved(const FrameFormat& format) {
  Bytes bytes(frameBytes(format));
  const int left_at = format.order == ByteOrder::kLeftFirst ? 0 : 1;
  for (int y = 0; y < format.height_px; ++y) {
    for (int x = 0; x < format.width_px; ++x) {
      const auto at = static_cast<std::size_t>(2 * (y * format.width_px + x));
      bytes[at + static_cast<std::size_t>(left_at)] = pixel(x, y, 0);
      bytes[at + static_cast<std::size_t>(1 - left_at)] = pixel(x, y, 1);
    }
  }
  return bytes;
}

TEST(Decode, EachEyeGetsItsPixelsInBothByteOrders) {
  for (const ByteOrder order : {ByteOrder::kLeftFirst, ByteOrder::kRightFirst}) {
    FrameFormat format = formatOf(34, 18);
    format.order = order;
    const Bytes bytes = interleaved(format);
    EXPECT_EQ(bytes[order == ByteOrder::kLeftFirst ? 0 : 1], pixel(0, 0, 0));
    const Result<DecodedPair> pair = decodeFrame(frameOf(bytes), format);
    ASSERT_TRUE(pair) << pair.status().message();
    EXPECT_EQ(pair->left.format, PixelFormat::kBayerRggb8);
    ASSERT_EQ(pair->right.data.size(), cv::Size(34, 18));
    for (int y = 0; y < 18; ++y) {
      for (int x = 0; x < 34; ++x) {
        ASSERT_EQ(pair->left.data.at<std::uint8_t>(y, x), pixel(x, y, 0)) << x << ", " << y;
        ASSERT_EQ(pair->right.data.at<std::uint8_t>(y, x), pixel(x, y, 1)) << x << ", " << y;
      }
    }
  }
}

TEST(Decode, TheOtherByteOrderSwapsTheEyes) {
  FrameFormat format = formatOf(16, 8);
  const RawFrame frame = frameOf(interleaved(format));
  const Result<DecodedPair> as_is = decodeFrame(frame, format);
  format.order = ByteOrder::kRightFirst;
  const Result<DecodedPair> swapped = decodeFrame(frame, format);
  ASSERT_TRUE(as_is && swapped);
  EXPECT_EQ(cv::norm(as_is->left.data, swapped->right.data, cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(as_is->left.data, swapped->left.data, cv::NORM_INF), 0.0);
}

// The left eye sees one colour, the right eye another: demosaiced by themselves, neither has a
// trace of the other, up to the last row.
TEST(Decode, ColoursOfOneEyeDoNotBleedIntoTheOther) {
  const FrameFormat format = formatOf(16, 12);
  const cv::Vec3b colours[2] = {{40, 80, 200}, {220, 60, 10}};  // BGR
  Bytes bytes(frameBytes(format));
  for (int y = 0; y < format.height_px; ++y) {
    for (int x = 0; x < format.width_px; ++x) {
      for (int eye = 0; eye < 2; ++eye) {
        bytes[static_cast<std::size_t>(2 * (y * format.width_px + x) + eye)] =
            colours[eye][2 - (y % 2 + x % 2)];
      }
    }
  }
  const Result<DecodedPair> pair = decodeFrame(frameOf(bytes), format);
  ASSERT_TRUE(pair);
  for (int eye = 0; eye < 2; ++eye) {
    cv::Mat colour;
    // OpenCV names a Bayer tile by its second row and column: BG is RGGB.
    cv::cvtColor(eye == 0 ? pair->left.data : pair->right.data, colour, cv::COLOR_BayerBG2BGR);
    for (int y = 0; y < colour.rows; ++y) {
      for (int x = 0; x < colour.cols; ++x) {
        ASSERT_EQ(colour.at<cv::Vec3b>(y, x), colours[eye]) << eye << ": " << x << ", " << y;
      }
    }
  }
}

TEST(Decode, EmbeddedInformationIsCoveredByItsNeighbours) {
  for (const bool with_time : {false, true}) {
    for (const bool with_counter : {false, true}) {
      FrameFormat format = formatOf(16, 8);
      format.embedded_timestamp = with_time;
      format.embedded_counter = with_counter;
      const int covered = 2 * (with_time + with_counter);
      Bytes bytes = interleaved(format);
      for (int i = 0; i < 2 * covered; ++i) bytes[static_cast<std::size_t>(i)] = 0xEE;
      const Result<DecodedPair> pair = decodeFrame(frameOf(bytes), format);
      ASSERT_TRUE(pair);
      for (int x = 0; x < 16; ++x) {
        const int from = x < covered ? 2 : 0;
        EXPECT_EQ(pair->left.data.at<std::uint8_t>(0, x), pixel(x, from, 0)) << x;
        EXPECT_EQ(pair->right.data.at<std::uint8_t>(0, x), pixel(x, from, 1)) << x;
      }
      EXPECT_EQ(pair->statistics[0].histogram[0xEE], 0U) << "measured after it is covered";
    }
  }
}

TEST(Decode, NeverAPictureFromABufferThatDoesNotFit) {
  const FrameFormat format = formatOf(32, 16);
  const Bytes good = interleaved(format);
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, good.size() / 2, good.size() - 1,
                                 good.size() + 1, good.size() * 2}) {
    Bytes bytes = good;
    bytes.resize(size);
    const Result<DecodedPair> pair = decodeFrame(frameOf(bytes), format);
    ASSERT_FALSE(pair) << size;
    EXPECT_EQ(pair.status().code(), StatusCode::kInvalidInput);
    EXPECT_NE(pair.status().message().find(std::to_string(size)), std::string::npos);
  }
  EXPECT_EQ(decodeFrame(RawFrame(), format).status().code(), StatusCode::kInvalidInput);
  RawFrame damaged = frameOf(good);
  damaged.status = Status(StatusCode::kIoError, "12 packets are missing");
  EXPECT_EQ(decodeFrame(damaged, format).status().message(), "12 packets are missing");
}

TEST(Decode, RefusesFormatsThatCannotBe) {
  const auto refused = [](FrameFormat format) {
    return decodeFrame(frameOf(Bytes(64)), format).status().code();
  };
  EXPECT_EQ(refused(formatOf(0, 8)), StatusCode::kInvalidInput);
  EXPECT_EQ(refused(formatOf(8, -4)), StatusCode::kInvalidInput);
  EXPECT_EQ(refused(formatOf(1 << 30, 1 << 30)), StatusCode::kInvalidInput);
  EXPECT_EQ(refused(formatOf(-2147483647, 2)), StatusCode::kInvalidInput);
  EXPECT_EQ(refused(formatOf(7, 4)), StatusCode::kInvalidInput) << "half a Bayer tile";
  EXPECT_EQ(refused(formatOf(8, 4, PixelFormat::kBgr8)), StatusCode::kUnsupported);
  FrameFormat tiny = formatOf(2, 16, PixelFormat::kMono8);
  EXPECT_TRUE(decodeFrame(frameOf(Bytes(64)), tiny));
  tiny.embedded_timestamp = tiny.embedded_counter = true;
  EXPECT_EQ(refused(tiny), StatusCode::kInvalidInput) << "no room for 8 bytes in a row";
}

TEST(Decode, MeasuresEachEye) {
  const FrameFormat format = formatOf(64, 32, PixelFormat::kMono8);
  Bytes bytes(frameBytes(format));
  for (std::size_t i = 0; i < bytes.size(); i += 2) {
    bytes[i] = 51;                              // left: a fifth everywhere
    bytes[i + 1] = (i / 2) % 4 == 0 ? 255 : 0;  // right: a quarter burnt out
  }
  const Result<DecodedPair> pair = decodeFrame(frameOf(bytes), format);
  ASSERT_TRUE(pair);
  EXPECT_DOUBLE_EQ(pair->statistics[0].mean_level, 0.2);
  EXPECT_DOUBLE_EQ(pair->statistics[0].saturated_share, 0.0);
  EXPECT_DOUBLE_EQ(pair->statistics[1].mean_level, 0.25);
  EXPECT_DOUBLE_EQ(pair->statistics[1].saturated_share, 0.25);
  EXPECT_EQ(pair->statistics[1].histogram[255] * 3, pair->statistics[1].histogram[0]);
  EXPECT_EQ(pair->statistics[0].histogram[51], 64U * 32U / 4U) << "a quarter of the rows";
}

}  // namespace
}  // namespace scanner::bumblebee
