#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <iterator>
#include <thread>

#include "bumblebee/transports.h"
#include "bumblebee/usb_camera.h"
#include "bumblebee/usb_emulation.h"
#include "bumblebee/usb_registers.h"

namespace scanner::bumblebee {
namespace {

using std::chrono::seconds;
constexpr std::size_t kFrameBytes = 2 * 1024 * 768;

/// Right eye first (register 0x1048), left 200, right 50, cycle time and counter in front.
std::vector<std::uint8_t> makeFrame(std::uint32_t counter, std::uint32_t cycle_seconds) {
  std::vector<std::uint8_t> bytes(kFrameBytes);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = i % 2 == 0 ? 50 : 200;
  const auto put = [&bytes](std::size_t at, std::uint32_t value) {
    for (std::size_t i = 0; i < 4; ++i)
      bytes[at + i] = static_cast<std::uint8_t>(value >> (24 - 8 * i));
  };
  put(0, cycle_seconds % 128 << 25);
  put(4, counter);
  return bytes;
}

std::size_t openDescriptors() {
  const std::filesystem::directory_iterator all("/proc/self/fd");
  return static_cast<std::size_t>(std::distance(begin(all), end(all)));
}

template <typename Condition>
bool eventually(Condition condition) {
  const auto deadline = std::chrono::steady_clock::now() + seconds(5);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

class UsbCamera : public ::testing::Test {
 protected:
  std::unique_ptr<StereoCamera> open(int buffers = 4) {
    TransportOptions options;
    options.buffers = buffers;
    auto opened = openUsb("", options);
    EXPECT_TRUE(opened) << opened.status().message();
    return opened ? std::move(*opened) : nullptr;
  }
  std::unique_ptr<StereoCamera> openStreaming(int buffers = 4) {
    auto camera = open(buffers);
    if (camera == nullptr) return nullptr;
    const auto format = camera->configure(0, 0, {});
    EXPECT_TRUE(format) << format.status().message();
    const Status started = camera->start();
    EXPECT_TRUE(started) << started.message();
    return camera;
  }
  /// Waits for the transfer first: it is queued again by another thread.
  bool send(const std::vector<std::uint8_t>& bytes) {
    return eventually([&] { return bus.send(bytes); });
  }

  UsbEmulation bus;
};

TEST_F(UsbCamera, ListsWithNameAndSerial) {
  const auto cameras = listUsb();
  ASSERT_EQ(cameras.size(), 1U);
  EXPECT_EQ(cameras[0].problem, "");
  EXPECT_EQ(cameras[0].address, "1.2");
  EXPECT_EQ(cameras[0].vendor, "Point");
  EXPECT_EQ(cameras[0].model, "Bumblebee2");
  EXPECT_EQ(cameras[0].serial, "7080123");
  EXPECT_EQ(bus.openFiles(), 0U);
}

TEST_F(UsbCamera, OpensBySerialGuidAndAddressOnly) {
  for (const char* address : {"7080123", "00b09d01006c093b", "1.2"})
    EXPECT_TRUE(openUsb(address, {})) << address;
  EXPECT_EQ(openUsb("7080124", {}).status().code(), StatusCode::kIoError);
}

TEST_F(UsbCamera, RegistersInBothSpaces) {
  const auto camera = open();
  ASSERT_NE(camera, nullptr);
  EXPECT_TRUE(camera->writeRegister(0x884, 0x82345678));
  EXPECT_EQ(bus.registers().get(0x884), 0x82345678);
  EXPECT_EQ(*camera->readRegister(0x884), 0x82345678);
  bus.registers().fail(0x884);
  EXPECT_EQ(camera->readRegister(0x884).status().code(), StatusCode::kIoError);
  EXPECT_EQ(camera->readRegister(0x885).status().code(), StatusCode::kInvalidInput);

  libusb_context* context = nullptr;
  ASSERT_EQ(libusb_init(&context), 0);
  {
    const UsbContext owner(context);
    const UsbHandle handle(libusb_open_device_with_vid_pid(context, 0x1E10, 0x2000));
    ASSERT_NE(handle, nullptr);
    UsbRegisters registers(handle.get());
    EXPECT_TRUE(registers.writeAddress(0xD00000001234, 0xCAFE0001));
    EXPECT_EQ(*registers.readAddress(0xD00000001234), 0xCAFE0001);
    EXPECT_FALSE(registers.readAddress(0x123400000000));
  }
}

TEST_F(UsbCamera, StreamsBothEyesWithCounterAndClock) {
  const auto camera = openStreaming();
  ASSERT_NE(camera, nullptr);
  for (std::uint32_t i = 0; i < 12; ++i) {
    ASSERT_TRUE(send(makeFrame(0xFFFFFFFA + i, 120 + i)));
    const auto frame = camera->grab(seconds(5));
    ASSERT_TRUE(frame) << frame.status().message();
    ASSERT_TRUE(frame->status) << frame->status.message();
    ASSERT_EQ(frame->bytes->size(), kFrameBytes);
    EXPECT_EQ((*frame->bytes)[1000], 50);
    EXPECT_EQ((*frame->bytes)[1001], 200);
    EXPECT_EQ(frame->counter, 0xFFFFFFFA + i);
    ASSERT_TRUE(frame->device_time);
  }
  EXPECT_EQ(camera->statistics().frames, 12U);
  EXPECT_EQ(camera->statistics().bytes, 12 * kFrameBytes);
  EXPECT_EQ(camera->grab(std::chrono::milliseconds(5)).status().code(), StatusCode::kOutOfRange);
}

TEST_F(UsbCamera, ShortAndOverlongFramesAreDamagedAndTheStreamGoesOn) {
  const auto camera = openStreaming(2);
  ASSERT_NE(camera, nullptr);
  auto cut = makeFrame(1, 1);
  cut.resize(1000);
  auto overlong = makeFrame(2, 2);
  overlong.resize(kFrameBytes + 1);
  for (int round = 0; round < 3; ++round) {
    for (const auto& bytes : {cut, overlong}) {
      ASSERT_TRUE(send(bytes));
      const auto frame = camera->grab(seconds(5));
      ASSERT_TRUE(frame);
      EXPECT_FALSE(frame->status);
      EXPECT_EQ(frame->bytes, nullptr);
    }
    ASSERT_TRUE(send(makeFrame(3, 3)));
    const auto frame = camera->grab(seconds(5));
    ASSERT_TRUE(frame);
    EXPECT_TRUE(frame->status);
  }
  EXPECT_EQ(camera->statistics().incomplete, 6U);
  EXPECT_EQ(camera->statistics().frames, 3U);
}

TEST_F(UsbCamera, StallIsClearedWithNothingQueued) {
  const auto camera = openStreaming();
  ASSERT_NE(camera, nullptr);
  for (int round = 1; round <= 15; ++round) {
    ASSERT_TRUE(eventually([&] { return bus.stall(); }));
    auto frame = camera->grab(seconds(5));
    ASSERT_TRUE(frame);
    EXPECT_FALSE(frame->status);
    ASSERT_TRUE(send(makeFrame(1, 1)));
    frame = camera->grab(seconds(5));
    ASSERT_TRUE(frame);
    EXPECT_TRUE(frame->status);
    EXPECT_EQ(bus.haltsCleared(), round);
  }
  EXPECT_EQ(bus.haltsClearedTooEarly(), 0);
}

TEST_F(UsbCamera, StallForEverIsAnError) {
  const auto camera = openStreaming();
  ASSERT_NE(camera, nullptr);
  for (int i = 0; i < 11; ++i) ASSERT_TRUE(eventually([&] { return bus.stall(); }));
  Status last;
  ASSERT_TRUE(eventually([&] {
    return !(last = camera->grab(Duration(0)).status()) && last.code() == StatusCode::kIoError;
  }));
  EXPECT_NE(last.message().find("again and again"), std::string::npos);
}

TEST_F(UsbCamera, SlowReaderLosesTheOldestAndTheyAreCounted) {
  const auto camera = openStreaming(3);
  ASSERT_NE(camera, nullptr);
  for (std::uint32_t i = 0; i < 10; ++i) ASSERT_TRUE(send(makeFrame(i, i)));
  ASSERT_TRUE(eventually([&] { return camera->statistics().frames == 10; }));
  EXPECT_EQ(camera->statistics().overruns, 7U);
  EXPECT_EQ(camera->grab(seconds(5))->counter, 7U);
}

TEST_F(UsbCamera, UnplugWhileStreamingAndReplug) {
  const std::size_t before = openDescriptors();
  for (int round = 0; round < 5; ++round) {
    auto camera = openStreaming();
    ASSERT_NE(camera, nullptr);
    ASSERT_TRUE(send(makeFrame(1, 1)));
    ASSERT_TRUE(camera->grab(seconds(5)));
    std::thread pulls([this] { bus.unplug(); });
    const auto frame = camera->grab(seconds(5));
    pulls.join();
    ASSERT_FALSE(frame);
    EXPECT_EQ(frame.status().code(), StatusCode::kIoError);
    EXPECT_NE(frame.status().message().find("unplugged"), std::string::npos);
    EXPECT_FALSE(camera->readRegister(0x1F28));
    camera.reset();
    EXPECT_TRUE(listUsb().empty());
    bus.plug();
  }
  EXPECT_EQ(bus.openFiles(), 0U);
  EXPECT_EQ(openDescriptors(), before);
}

TEST_F(UsbCamera, StopTakesEveryTransferBackAndStartsAgain) {
  const auto camera = openStreaming();
  ASSERT_NE(camera, nullptr);
  for (int round = 0; round < 5; ++round) {
    EXPECT_EQ(bus.queued(), 4U);
    ASSERT_TRUE(send(makeFrame(1, 1)));
    ASSERT_TRUE(camera->grab(seconds(5)));
    camera->stop();
    EXPECT_EQ(bus.unreaped(), 0U);
    EXPECT_FALSE(bus.send(makeFrame(1, 1)));
    EXPECT_EQ(camera->grab(Duration(0)).status().code(), StatusCode::kIoError);
    ASSERT_TRUE(camera->start());
  }
}

TEST_F(UsbCamera, FewerBuffersWhenTheKernelGrantsNoMore) {
  bus.limitTransfers(2);
  auto camera = openStreaming(8);
  ASSERT_NE(camera, nullptr);
  EXPECT_EQ(bus.queued(), 2U);
  camera->stop();
  bus.limitTransfers(1);
  const Status status = camera->start();
  EXPECT_EQ(status.code(), StatusCode::kIoError);
  EXPECT_NE(status.message().find("usbfs_memory_mb"), std::string::npos);
  EXPECT_EQ(bus.unreaped(), 0U);
}

TEST_F(UsbCamera, BusyAndForbiddenNameTheRemedy) {
  bus.claimElsewhere(true);
  Status status = openUsb("", {}).status();
  EXPECT_EQ(status.code(), StatusCode::kIoError);
  EXPECT_NE(status.message().find("another program"), std::string::npos) << status.message();
  bus.claimElsewhere(false);
  bus.denyAccess(true);
  status = openUsb("", {}).status();
  EXPECT_EQ(status.code(), StatusCode::kIoError);
  EXPECT_NE(status.message().find("60-scanner.rules"), std::string::npos) << status.message();
  const auto listed = listUsb();
  ASSERT_EQ(listed.size(), 1U);
  EXPECT_NE(listed[0].problem.find("no permission"), std::string::npos);
  bus.denyAccess(false);
  const auto first = open();
  EXPECT_NE(openUsb("", {}).status().message().find("busy"), std::string::npos);
  EXPECT_EQ(listUsb().size(), 1U);  // asking does not disturb it
}

TEST(UsbCycleClock, UnwrapsOverGapsOfManyTurns) {
  CycleClock clock;
  const CycleClock::Steady::time_point begin;
  EXPECT_EQ(clock.unwrap(seconds(100), begin), seconds(100));
  EXPECT_EQ(clock.unwrap(seconds(2), begin + seconds(30)), seconds(130));
  EXPECT_EQ(clock.unwrap(seconds(1), begin + seconds(30 + 5 * 128 - 1)), seconds(129 + 5 * 128));
}

}  // namespace
}  // namespace scanner::bumblebee
