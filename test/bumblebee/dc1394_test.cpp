#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "bumblebee/dc1394_bus.h"
#include "bumblebee/juju_emulation.h"
#include "bumblebee/transports.h"

// libdc1394 itself runs below these tests, on an emulation of the kernel's FireWire devices.

#if defined(__SANITIZE_ADDRESS__)
// libdc1394 forgets its frame list when capture_stop finds the camera gone; file and buffers, which
// are large, are released by the transport.
extern "C" const char* __lsan_default_suppressions() { return "leak:dc1394_juju_capture_setup\n"; }
#endif

namespace scanner::bumblebee {
namespace {

using std::chrono::milliseconds;

constexpr int kWidth = 640, kHeight = 480;
constexpr std::int64_t kTransferUs = 150 * 125;

/// Left and right differ in every pixel; head as the camera embeds it.
std::vector<std::uint8_t> frameBytes(std::uint32_t counter) {
  std::vector<std::uint8_t> bytes(2 * kWidth * kHeight);
  for (std::size_t i = 0; i < bytes.size() / 2; ++i) {
    bytes[2 * i] = static_cast<std::uint8_t>(i % 100);            // first byte: right eye
    bytes[2 * i + 1] = static_cast<std::uint8_t>(128 + i % 100);  // left eye
  }
  for (std::size_t i = 0; i < 4; ++i) bytes[i] = 0;
  for (std::size_t i = 0; i < 4; ++i)
    bytes[4 + i] = static_cast<std::uint8_t>(counter >> (24 - 8 * i));
  return bytes;
}

class Dc1394 : public ::testing::Test {
 protected:
  std::unique_ptr<StereoCamera> open(const std::string& address = "") {
    auto opened = openDc1394(address, TransportOptions());
    EXPECT_TRUE(opened) << opened.status().message();
    return opened ? std::move(opened).value() : nullptr;
  }
  std::unique_ptr<StereoCamera> openStreaming() {
    auto camera = open();
    if (!camera) return camera;
    const auto format = camera->configure(0, 0, Controls());
    EXPECT_TRUE(format) << format.status().message();
    const auto status = camera->start();
    EXPECT_TRUE(status) << status.message();
    return camera;
  }
  JujuEmulation bus_;
};

TEST_F(Dc1394, ListsTheCamera) {
  const auto cameras = listDc1394();
  ASSERT_EQ(cameras.size(), 1U);
  EXPECT_EQ(cameras[0].transport, Transport::kDc1394);
  EXPECT_EQ(cameras[0].address, "00b09d01006c089b");
  EXPECT_EQ(cameras[0].vendor, "Point Grey Research");
  EXPECT_EQ(cameras[0].model, "Bumblebee2 BB2-03S2C");
  EXPECT_EQ(cameras[0].serial, "7080123");
  EXPECT_EQ(cameras[0].problem, "");
  EXPECT_EQ(bus_.openFiles(), 0U);
}

TEST_F(Dc1394, OpensByGuidAndBySerialNumber) {
  EXPECT_NE(open("00b09d01006c089b"), nullptr);
  EXPECT_NE(open("0x00B09D01006C089B"), nullptr);
  EXPECT_NE(open("7080123"), nullptr);
  const auto other = openDc1394("7080124", TransportOptions());
  ASSERT_FALSE(other);
  EXPECT_EQ(other.status().code(), StatusCode::kIoError);
  EXPECT_EQ(bus_.openFiles(), 0U);
}

TEST_F(Dc1394, SaysWhatIsMissing) {
  bus_.denyAccess(true);
  auto opened = openDc1394("", TransportOptions());
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.status().message().find("no permission: /dev/fw1"), std::string::npos)
      << opened.status().message();
  bus_.denyAccess(false);
  bus_.unplug();
  opened = openDc1394("", TransportOptions());
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.status().message().find("no camera on the FireWire bus"), std::string::npos);
  bus_.removeController();
  opened = openDc1394("", TransportOptions());
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.status().message().find("no FireWire bus"), std::string::npos);
  EXPECT_TRUE(listDc1394().empty());
}

TEST_F(Dc1394, NamesACameraThatItMayNotOpen) {
  const auto sys = std::filesystem::temp_directory_path() / "scanner_dc1394_test_sys";
  std::filesystem::create_directories(sys / "fw1");
  std::ofstream(sys / "fw1" / "units") << "0x00a02d:0x000102\n";
  std::ofstream(sys / "fw1" / "guid") << "0x00b09d01006c089b\n";
  std::ofstream(sys / "fw1" / "vendor_name") << "Point Grey Research\n";
  bus_.denyAccess(true);
  const auto nodes = fireWireNodes(sys.string());
  std::filesystem::remove_all(sys);
  ASSERT_EQ(nodes.size(), 2U);
  EXPECT_FALSE(nodes[0].is_camera);
  EXPECT_TRUE(nodes[1].is_camera);
  EXPECT_EQ(nodes[1].guid, "00b09d01006c089b");
  EXPECT_EQ(nodes[1].vendor, "Point Grey Research");
  EXPECT_NE(nodes[1].problem.find("no permission"), std::string::npos);
}

TEST_F(Dc1394, ReadsAndWritesRegisters) {
  auto camera = open();
  ASSERT_NE(camera, nullptr);
  EXPECT_EQ(camera->readRegister(0x1F20).value(), 7080123U);
  EXPECT_TRUE(camera->writeRegister(0x1A00, 0x1234ABCD));
  EXPECT_EQ(bus_.registers().get(0x1A00), 0x1234ABCDU);
  bus_.resetBus();  // requests of the old generation are refused; the library asks again
  EXPECT_EQ(camera->readRegister(0x1F20).value(), 7080123U);
  bus_.registers().fail(0x1F20);
  const auto failed = camera->readRegister(0x1F20);
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.status().code(), StatusCode::kIoError);
}

TEST_F(Dc1394, SetsControlsAndTellsTemperature) {
  auto camera = open();
  ASSERT_NE(camera, nullptr);
  EXPECT_TRUE(camera->capabilities().device_clock && camera->capabilities().frame_counter);
  Controls controls;
  controls.exposure_s = 0.002;
  EXPECT_TRUE(camera->setControls(controls));
  EXPECT_NEAR(camera->controls()->exposure_s.value_or(0), 0.002, 1e-9);
  EXPECT_NEAR(camera->temperatureC().value_or(0), 35.65, 1e-6);
}

TEST_F(Dc1394, StreamsBothEyes) {
  testing::internal::CaptureStderr();
  {
    auto camera = open();
    ASSERT_NE(camera, nullptr);
    const auto format = camera->configure(0, 0, Controls());
    ASSERT_TRUE(format) << format.status().message();
    EXPECT_EQ(format->order, ByteOrder::kRightFirst);
    ASSERT_TRUE(camera->start());
    EXPECT_EQ(bus_.freeBuffers(), 8U);
    EXPECT_GT(bus_.isoResources(), 0U);
    for (std::uint32_t i = 0; i < 20; ++i) {
      const auto bytes = frameBytes(100 + i);
      ASSERT_TRUE(bus_.sendFrame(bytes, kTransferUs));
      const auto frame = camera->grab(milliseconds(2000));
      ASSERT_TRUE(frame) << frame.status().message();
      ASSERT_TRUE(frame->status) << frame->status.message();
      EXPECT_EQ(*frame->bytes, bytes);
      EXPECT_EQ(frame->counter, 100U + i);
      EXPECT_EQ(frame->counter_max, 0xFFFFFFFFU);
      EXPECT_EQ(frame->moment, StampMoment::kStartOfTransmission);
      ASSERT_TRUE(frame->device_time);
      // Start of transmission, in steps of the bus' 125 us, whenever the frame was taken.
      EXPECT_NEAR(toSeconds(*frame->device_time), 1e-6 * static_cast<double>(bus_.lastStart()),
                  250e-6);
      EXPECT_GE(frame->arrival.time_since_epoch(), *frame->device_time);
      EXPECT_EQ(bus_.freeBuffers(), 8U);
    }
    EXPECT_EQ(camera->statistics().frames, 20U);
    EXPECT_EQ(camera->statistics().incomplete, 0U);
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");  // the library's own log
  EXPECT_EQ(bus_.openFiles(), 0U);
  EXPECT_EQ(bus_.mappedBytes(), 0U);
  EXPECT_EQ(bus_.isoResources(), 0U);
  EXPECT_EQ(bus_.registers().get(0x614), 0U);
}

TEST_F(Dc1394, NoFrameInTimeIsNoFailure) {
  auto camera = openStreaming();
  ASSERT_NE(camera, nullptr);
  const auto none = camera->grab(milliseconds(20));
  ASSERT_FALSE(none);
  EXPECT_EQ(none.status().code(), StatusCode::kOutOfRange);
  ASSERT_TRUE(bus_.sendFrame(frameBytes(1), kTransferUs));
  EXPECT_TRUE(camera->grab(milliseconds(2000)));
}

/// Frames 3 s apart by their stamps; one completes 2.9 s late, as it does when the beginning of the
/// next frame had to fill its buffer.
TEST_F(Dc1394, FrameWithLostPacketsIsMarkedAndItsBufferComesBack) {
  auto camera = openStreaming();
  ASSERT_NE(camera, nullptr);
  const auto sendLater = [this](std::uint32_t counter, std::int64_t age_us) {
    return std::thread([this, counter, age_us] {
      std::this_thread::sleep_for(milliseconds(100));  // grab() is waiting by then
      bus_.sendFrame(frameBytes(counter), age_us);
    });
  };
  ASSERT_TRUE(bus_.sendFrame(frameBytes(1), kTransferUs + 3000000));
  ASSERT_TRUE(camera->grab(milliseconds(2000))->status);
  ASSERT_TRUE(bus_.sendFrame(frameBytes(2), kTransferUs));
  ASSERT_TRUE(camera->grab(milliseconds(2000))->status);
  auto sender = sendLater(3, kTransferUs + 2900000);
  auto frame = camera->grab(milliseconds(5000));
  sender.join();
  ASSERT_TRUE(frame) << frame.status().message();
  EXPECT_FALSE(frame->status);
  EXPECT_EQ(frame->status.code(), StatusCode::kInvalidInput);
  EXPECT_EQ(frame->bytes, nullptr);
  EXPECT_EQ(frame->counter, 3U);
  EXPECT_EQ(bus_.freeBuffers(), 8U);
  sender = sendLater(5, kTransferUs);
  frame = camera->grab(milliseconds(5000));
  sender.join();
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->status) << frame->status.message();
  EXPECT_EQ(camera->statistics().incomplete, 1U);
  EXPECT_EQ(camera->statistics().frames, 3U);
  for (std::uint32_t i = 0; i < 16; ++i) {  // twice around the buffers
    ASSERT_TRUE(bus_.sendFrame(frameBytes(6 + i), kTransferUs));
    ASSERT_TRUE(camera->grab(milliseconds(2000)));
  }
}

TEST_F(Dc1394, FramesQueueUpToTheBuffers) {
  auto camera = openStreaming();
  ASSERT_NE(camera, nullptr);
  for (std::uint32_t i = 0; i < 8; ++i) ASSERT_TRUE(bus_.sendFrame(frameBytes(i), kTransferUs));
  EXPECT_FALSE(bus_.sendFrame(frameBytes(8), kTransferUs));  // lost; the counter will tell
  for (std::uint32_t i = 0; i < 8; ++i) EXPECT_EQ(camera->grab(milliseconds(2000))->counter, i);
}

TEST_F(Dc1394, StartStopStart) {
  auto camera = openStreaming();
  ASSERT_NE(camera, nullptr);
  for (int round = 0; round < 3; ++round) {
    ASSERT_TRUE(bus_.sendFrame(frameBytes(7), kTransferUs));
    ASSERT_TRUE(camera->grab(milliseconds(2000)));
    camera->stop();
    EXPECT_EQ(bus_.mappedBytes(), 0U);
    EXPECT_EQ(bus_.isoResources(), 0U);
    EXPECT_EQ(camera->grab(milliseconds(1)).status().code(), StatusCode::kIoError);
    ASSERT_TRUE(camera->configure(kWidth, kHeight, Controls()));
    ASSERT_TRUE(camera->start());
    EXPECT_EQ(camera->statistics().frames, 0U);
  }
}

TEST_F(Dc1394, UnplugAndReplug) {
  for (int round = 0; round < 3; ++round) {
    auto camera = openStreaming();
    ASSERT_NE(camera, nullptr);
    ASSERT_TRUE(bus_.sendFrame(frameBytes(1), kTransferUs));
    ASSERT_TRUE(camera->grab(milliseconds(2000)));
    std::thread hand([this] {
      std::this_thread::sleep_for(milliseconds(30));
      bus_.unplug();
    });
    const auto begin = std::chrono::steady_clock::now();
    const auto frame = camera->grab(milliseconds(20000));
    hand.join();
    ASSERT_FALSE(frame);
    EXPECT_EQ(frame.status().code(), StatusCode::kIoError) << frame.status().message();
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
    EXPECT_EQ(camera->readRegister(0x1F20).status().code(), StatusCode::kIoError);
    EXPECT_FALSE(camera->temperatureC());
    EXPECT_FALSE(camera->start());
    camera.reset();
    EXPECT_EQ(bus_.openFiles(), 0U);
    EXPECT_EQ(bus_.mappedBytes(), 0U);
    EXPECT_TRUE(listDc1394().empty());
    bus_.plug();
  }
}

TEST_F(Dc1394, BusResetWhileStreamingIsSurvived) {
  auto camera = openStreaming();
  ASSERT_NE(camera, nullptr);
  bus_.resetBus();
  ASSERT_TRUE(bus_.sendFrame(frameBytes(1), kTransferUs));
  EXPECT_TRUE(camera->grab(milliseconds(2000)));
  EXPECT_TRUE(camera->readRegister(0x1F20));
}

TEST_F(Dc1394, ReclaimsBandwidthOfACrashedProgram) {
  auto camera = open();
  ASSERT_NE(camera, nullptr);
  ASSERT_TRUE(camera->configure(0, 0, Controls()));
  bus_.fillBus(false);
  const auto status = camera->start();
  EXPECT_TRUE(status) << status.message();
  EXPECT_EQ(bus_.busResetsAsked(), 1);
  camera->stop();
  bus_.fillBus(true);
  testing::internal::CaptureStderr();
  const auto full = camera->start();
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");  // the library logs it; our status tells
  ASSERT_FALSE(full);
  EXPECT_EQ(full.code(), StatusCode::kIoError);
  EXPECT_NE(full.message().find("bus is full"), std::string::npos) << full.message();
  EXPECT_EQ(bus_.mappedBytes(), 0U);
}

TEST_F(Dc1394, RefusesACameraThatIsNoBumblebee) {
  bus_.registers().set(0x1F28, 0);
  const auto opened = openDc1394("", TransportOptions());
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.status().code(), StatusCode::kUnsupported);
  EXPECT_EQ(bus_.openFiles(), 0U);
}

}  // namespace
}  // namespace scanner::bumblebee
