#include "bumblebee/file_transport.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "bumblebee/transports.h"
#include "scanner/bumblebee/decode.h"
#include "support/temporary_folder.h"

namespace scanner::bumblebee {
namespace {

constexpr Duration kPatience = std::chrono::seconds(5);

cv::Mat grey(int value, cv::Size size = {16, 12}) {
  cv::Mat image(size, CV_8UC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(value + 3 * x + y);
    }
  }
  return image;
}

TransportOptions fast() {
  TransportOptions options;
  options.file_rate_hz = 200.0;
  return options;
}

class FileTransport : public testing::Test {
 protected:
  void write(const std::string& name, const cv::Mat& image) {
    std::filesystem::create_directories(std::filesystem::path(folder_ / name).parent_path());
    ASSERT_TRUE(cv::imwrite(folder_ / name, image));
  }
  std::unique_ptr<StereoCamera> open(const TransportOptions& options = fast()) {
    Result<std::unique_ptr<StereoCamera>> camera =
        openCamera(Transport::kFile, folder_.path(), options);
    EXPECT_TRUE(camera) << camera.status().message();
    if (!camera) return nullptr;
    const Result<FrameFormat> format = (*camera)->configure(0, 0, {});
    EXPECT_TRUE(format);
    format_ = *format;
    EXPECT_TRUE((*camera)->start());
    return std::move(*camera);
  }
  /// Top left grey value of both eyes; -1 -1 for a damaged frame.
  std::pair<int, int> next(StereoCamera& camera) {
    const Result<RawFrame> frame = camera.grab(kPatience);
    EXPECT_TRUE(frame) << frame.status().message();
    if (!frame) return {-2, -2};
    const Result<DecodedPair> pair = decodeFrame(*frame, format_);
    if (!pair) return {-1, -1};
    return {pair->left.data.at<std::uint8_t>(0, 0), pair->right.data.at<std::uint8_t>(0, 0)};
  }

  using Pair = std::pair<int, int>;
  test::TemporaryFolder folder_;
  FrameFormat format_;
};

TEST_F(FileTransport, PlaysPairsInTheOrderOfTheirNumbersAndEnds) {
  write("left10.png", grey(10));
  write("right10.png", grey(110));
  write("left2.png", grey(2));
  write("right2.png", grey(102));
  auto camera = open();
  EXPECT_EQ(format_.pixels, PixelFormat::kMono8);
  EXPECT_EQ(format_.width_px, 16);
  EXPECT_EQ(next(*camera), Pair(2, 102));
  EXPECT_EQ(next(*camera), Pair(10, 110));
  const Result<RawFrame> end = camera->grab(kPatience);
  EXPECT_EQ(end.status().code(), StatusCode::kIoError);
  EXPECT_EQ(end.status().message().rfind(kEndOfRecording, 0), 0U) << end.status().message();
  EXPECT_EQ(camera->statistics().frames, 2U);
}

TEST_F(FileTransport, RepeatsAndCounts) {
  write("left/000.png", grey(1));
  write("right/000.png", grey(101));
  write("left/001.png", grey(2));
  write("right/001.png", grey(102));
  TransportOptions options = fast();
  options.file_repeat = true;
  auto camera = open(options);
  Duration last(-1);
  for (std::uint64_t i = 1; i <= 5; ++i) {
    const Result<RawFrame> frame = camera->grab(kPatience);
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->counter.value_or(0), i);
    EXPECT_EQ(decodeFrame(*frame, format_)->left.data.at<std::uint8_t>(0, 0), 2 - i % 2);
    ASSERT_TRUE(frame->device_time);
    if (i > 1) {
      EXPECT_EQ(*frame->device_time - last, std::chrono::milliseconds(5));
    }
    last = *frame->device_time;
  }
}

TEST_F(FileTransport, ComesAtItsRateAndNotEarlier) {
  write("left1.png", grey(1));
  write("right1.png", grey(1));
  TransportOptions options;
  options.file_rate_hz = 10.0;
  options.file_repeat = true;
  auto camera = open(options);
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(camera->grab(kPatience));
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(295));
  EXPECT_EQ(camera->grab(std::chrono::milliseconds(1)).status().code(), StatusCode::kOutOfRange);
  EXPECT_TRUE(camera->grab(kPatience)) << "try again";
}

TEST_F(FileTransport, InterleavedPicturesHaveLeftInTheLowByte) {
  cv::Mat both(12, 16, CV_16UC1, cv::Scalar(0x3412));
  write("bayer_grbg8_0.png", both);
  auto camera = open();
  EXPECT_EQ(format_.pixels, PixelFormat::kBayerGrbg8) << "by its name";
  EXPECT_EQ(next(*camera), Pair(0x12, 0x34));
}

TEST_F(FileTransport, ColourIsSampledAsABayerTile) {
  const cv::Mat colour(12, 16, CV_8UC3, cv::Scalar(10, 100, 200));
  write("chair_left.png", colour);
  write("chair_right.png", colour);
  auto camera = open();
  EXPECT_EQ(format_.pixels, PixelFormat::kBayerRggb8);
  const Result<RawFrame> frame = camera->grab(kPatience);
  ASSERT_TRUE(frame);
  const cv::Mat left = decodeFrame(*frame, format_)->left.data;
  EXPECT_EQ(left.at<std::uint8_t>(0, 0), 200) << "red";
  EXPECT_EQ(left.at<std::uint8_t>(0, 1), 100);
  EXPECT_EQ(left.at<std::uint8_t>(1, 0), 100);
  EXPECT_EQ(left.at<std::uint8_t>(1, 1), 10) << "blue";
}

TEST_F(FileTransport, BadPicturesAreDamagedFramesWithAReason) {
  write("left1.png", grey(1));
  write("right1.png", grey(101));
  std::ofstream(folder_ / "left2.png") << "no picture";
  write("right2.png", grey(102));
  write("left3.png", grey(3, {18, 12}));
  write("right3.png", grey(103, {18, 12}));
  write("left4.png", grey(4));  // alone
  write("left5.png", grey(5));
  write("right5.png", grey(105, {16, 10}));
  write("left6.png", cv::Mat(12, 16, CV_8UC3, cv::Scalar::all(6)));
  write("right6.png", cv::Mat(12, 16, CV_8UC3, cv::Scalar::all(6)));
  write("left7.png", grey(7));
  write("right7.png", grey(107));
  std::filesystem::resize_file(folder_ / "left7.png",
                               std::filesystem::file_size(folder_ / "left7.png") - 40);
  write("left8.png", grey(8));
  write("right8.png", grey(108));
  auto camera = open();
  EXPECT_EQ(next(*camera), Pair(1, 101));
  for (int i = 2; i <= 7; ++i) {
    const Result<RawFrame> frame = camera->grab(kPatience);
    ASSERT_TRUE(frame);
    EXPECT_FALSE(frame->status) << i;
    EXPECT_NE(frame->status.message().find(std::to_string(i) + ".png"), std::string::npos)
        << frame->status.message();
  }
  EXPECT_EQ(next(*camera), Pair(8, 108)) << "counted, and on with the next";
  EXPECT_GE(camera->statistics().incomplete, 6U);
}

TEST_F(FileTransport, AJpegThatWasCutOffIsDamaged) {
  for (const char* name : {"left1.jpg", "right1.jpg", "left2.jpg", "right2.jpg"}) {
    write(name, grey(50, {160, 120}));
  }
  std::filesystem::resize_file(folder_ / "right2.jpg",
                               std::filesystem::file_size(folder_ / "right2.jpg") - 2);
  auto camera = open();
  EXPECT_TRUE(camera->grab(kPatience)->status);
  EXPECT_FALSE(camera->grab(kPatience)->status);
}

TEST_F(FileTransport, SaysWhatItCannotOpen) {
  const auto problem = [](const std::string& address) {
    return openCamera(Transport::kFile, address, fast()).status();
  };
  EXPECT_EQ(problem(folder_ / "nowhere").code(), StatusCode::kIoError);
  EXPECT_EQ(problem("").code(), StatusCode::kIoError);
  EXPECT_EQ(problem(folder_.path()).code(), StatusCode::kIoError) << "empty";
  std::ofstream(folder_ / "left1.png") << "no picture";
  EXPECT_FALSE(problem(folder_.path()).isOk());
  write("left2.png", grey(1));
  write("right2.png", grey(1));
  EXPECT_TRUE(problem(folder_.path()).isOk()) << "one pair is enough";
  TransportOptions options;
  options.file_rate_hz = 0.0;
  EXPECT_FALSE(openCamera(Transport::kFile, folder_.path(), options));
}

TEST_F(FileTransport, HasNoControlsAndOnlyItsOwnSize) {
  write("left1.png", grey(1));
  write("right1.png", grey(1));
  auto camera = open();
  EXPECT_EQ(camera->configure(640, 480, {}).status().code(), StatusCode::kUnsupported);
  EXPECT_TRUE(camera->configure(16, 12, {}));
  Controls controls;
  controls.gain_db = 3.0;
  EXPECT_EQ(camera->setControls(controls).code(), StatusCode::kUnsupported);
  EXPECT_EQ(camera->readRegister(0x1F20).status().code(), StatusCode::kUnsupported);
  EXPECT_TRUE(listCameras(Transport::kFile).empty());
}

TEST(RealDataFileTransport, PlaysPicturesOfABumblebee2) {
  const char* variable = std::getenv("SCANNER_DATA");
  const std::string data = variable ? variable : SCANNER_SOURCE_DIR "/../shared/data";
  const std::string folder = data + "/bumblebee2/pairs";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << folder << " is absent";
  auto camera = openCamera(Transport::kFile, folder, fast());
  ASSERT_TRUE(camera) << camera.status().message();
  const Result<FrameFormat> format = (*camera)->configure(0, 0, {});
  ASSERT_TRUE(format);
  EXPECT_EQ(format->pixels, PixelFormat::kBayerRggb8);
  ASSERT_TRUE((*camera)->start());
  int pairs = 0;
  for (Result<RawFrame> frame = (*camera)->grab(kPatience); frame;
       frame = (*camera)->grab(kPatience)) {
    const Result<DecodedPair> pair = decodeFrame(*frame, *format);
    ASSERT_TRUE(pair) << pair.status().message();
    EXPECT_GT(pair->statistics[0].mean_level, 0.05);
    EXPECT_NEAR(pair->statistics[0].mean_level, pair->statistics[1].mean_level, 0.15);
    ++pairs;
  }
  EXPECT_EQ(pairs, 8);
}

}  // namespace
}  // namespace scanner::bumblebee
