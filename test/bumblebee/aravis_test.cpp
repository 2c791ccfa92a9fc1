// Finding, opening and controlling the camera, and frames of a sound line.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <thread>

#include "bumblebee/aravis_fixture.h"
#include "bumblebee/aravis_support.h"
#include "support/temporary_folder.h"

namespace scanner::bumblebee {
namespace {

TEST_F(AravisTest, FindsTheCameraWheneverItComes) {
  for (const CameraIdentity& camera : listAravis()) EXPECT_NE(camera.serial, "SIM0001");
  plug(30.0);
  const std::vector<CameraIdentity> cameras = listAravis();
  const auto found = std::find_if(cameras.begin(), cameras.end(),
                                  [](const auto& camera) { return camera.serial == "SIM0001"; });
  ASSERT_NE(found, cameras.end());
  EXPECT_EQ(found->transport, Transport::kAravis);
  EXPECT_EQ(found->model, "Bumblebee2");
  EXPECT_EQ(found->problem, "");
  for (const std::string& address : {std::string("SIM0001"), found->address}) {
    const auto camera = openAravis(address, {});
    ASSERT_TRUE(camera) << camera.status().message();
    EXPECT_EQ((*camera)->identity().serial, "SIM0001");
    EXPECT_EQ((*camera)->identity().address, found->address);
    EXPECT_FALSE((*camera)->identity().firmware.empty());
  }
}

TEST_F(AravisTest, AnAddressWhereNobodyIsFailsFast) {
  const auto begin = Steady::now();
  const auto camera = openAravis(kHere, {});
  EXPECT_EQ(camera.status().code(), StatusCode::kIoError);
  EXPECT_NE(camera.status().message().find(kHere), std::string::npos);
  EXPECT_LT(secondsSince(begin), 5.0);
  EXPECT_EQ(openAravis("SIM0001", {}).status().code(), StatusCode::kIoError);
}

TEST_F(AravisTest, CapabilitiesAreTheCameras) {
  plug(30.0);
  const auto camera = open();
  ASSERT_TRUE(camera);
  const Capabilities c = camera->capabilities();
  EXPECT_EQ(c.width_px, 128);
  EXPECT_EQ(c.height_px, 96);
  ASSERT_TRUE(c.exposure_s && c.gain_db && c.rate_hz);
  EXPECT_NEAR(c.exposure_s->min, 10e-6, 1e-12);
  EXPECT_NEAR(c.exposure_s->max, 10.0, 1e-9);
  EXPECT_EQ(c.gain_db->min, 0.0);
  EXPECT_EQ(c.gain_db->max, 10.0);
  EXPECT_LE(c.rate_hz->min, 0.1 + 1e-9);
  EXPECT_GE(c.rate_hz->max, 1000.0 - 1e-6);
  EXPECT_FALSE(c.white_balance);
  EXPECT_TRUE(c.frame_counter);
  EXPECT_TRUE(c.device_clock);
  EXPECT_FALSE(c.registers);
  EXPECT_FALSE(c.temperature);
  EXPECT_FALSE(camera->temperatureC());
  EXPECT_EQ(camera->readRegister(0x1048).status().code(), StatusCode::kUnsupported);
  EXPECT_EQ(camera->writeRegister(0x1048, 0).code(), StatusCode::kUnsupported);
}

TEST_F(AravisTest, StreamsBothEyesOverTheWrapOfTheCounter) {
  plug(100.0, 64, 48);
  const auto camera = stream();
  ASSERT_TRUE(camera);
  std::optional<Duration> last;
  std::uint64_t last_number = 0;
  bool wrapped = false;
  for (int i = 0; i < 200; ++i) {
    const auto frame = camera->grab(kPatience);
    ASSERT_TRUE(frame) << frame.status().message();
    expectRight(*frame);
    EXPECT_EQ(frame->counter_max, 65535U);
    EXPECT_EQ(frame->counter_first, 1U);
    const std::uint64_t number = numberOf(*frame->counter);
    if (i > 0) {
      EXPECT_EQ(number, last_number + 1);
    }
    wrapped = wrapped || *frame->counter < 1000;
    last_number = number;
    ASSERT_TRUE(frame->device_time);
    if (last) {
      EXPECT_GT(*frame->device_time, *last);
    }
    last = frame->device_time;
    const auto taken = times();
    ASSERT_EQ(taken.count(number), 1U);
    EXPECT_EQ(frame->device_time->count(), toNanoseconds(taken.at(number)));
    EXPECT_GT(frame->arrival, taken.at(number) + std::chrono::microseconds(1000)) << "exposed";
    EXPECT_EQ(frame->moment, StampMoment::kStartOfExposure);
  }
  EXPECT_TRUE(wrapped);
  const TransportStatistics statistics = camera->statistics();
  EXPECT_EQ(statistics.frames, 200U);
  EXPECT_EQ(statistics.incomplete, 0U);
  EXPECT_EQ(statistics.overruns, 0U);
  EXPECT_EQ(statistics.lost_packets, 0U);
  EXPECT_EQ(statistics.bytes, 200U * 64U * 48U * 2U);
}

TEST_F(AravisTest, FullFramesInFormat) {
  plug(15.0, 1024, 768);
  const auto camera = open();
  ASSERT_TRUE(camera);
  EXPECT_EQ(camera->start().code(), StatusCode::kInvalidInput) << "not configured";
  const auto format = camera->configure(0, 0, {});
  ASSERT_TRUE(format) << format.status().message();
  EXPECT_EQ(format->width_px, 1024);
  EXPECT_EQ(format->height_px, 768);
  EXPECT_EQ(format->order, ByteOrder::kLeftFirst);
  EXPECT_EQ(format->pixels, PixelFormat::kBayerRggb8);
  ASSERT_TRUE(camera->start());
  EXPECT_EQ(camera->configure(0, 0, {}).status().code(), StatusCode::kInvalidInput) << "streams";
  // A busy machine drops packets of frames of this size itself; such a frame must say so.
  int sound = 0;
  for (int i = 0; i < 60 && sound < 4; ++i) {
    const auto frame = camera->grab(kPatience);
    ASSERT_TRUE(frame) << frame.status().message();
    if (!frame->status) {
      EXPECT_EQ(frame->status.code(), StatusCode::kNotEnoughData);
      continue;
    }
    expectRight(*frame);
    ++sound;
  }
  EXPECT_EQ(sound, 4);
}

TEST_F(AravisTest, ControlsReachTheSourceWhileStreaming) {
  plug(50.0);
  Controls controls;
  controls.exposure_s = 0.002;
  controls.gain_db = 3.0;
  const auto camera = stream(controls);
  ASSERT_TRUE(camera);
  ASSERT_TRUE(camera->grab(kPatience));
  EXPECT_NEAR(exposure().exposure_s, 0.002, 1e-9);
  EXPECT_EQ(exposure().gain_db, 3.0);
  controls.exposure_s = 0.004;
  controls.gain_db = 7.4;  // whole decibels
  controls.rate_hz = 20.0;
  std::thread other([&] { EXPECT_TRUE(camera->setControls(controls)); });
  ASSERT_TRUE(camera->grab(kPatience));
  other.join();
  const auto now = camera->controls();
  ASSERT_TRUE(now) << now.status().message();
  EXPECT_NEAR(*now->exposure_s, 0.004, 1e-9);
  EXPECT_EQ(*now->gain_db, 7.0);
  EXPECT_NEAR(*now->rate_hz, 20.0, 1e-3);
  for (int i = 0; i < 12 && exposure().gain_db != 7.0; ++i) ASSERT_TRUE(camera->grab(kPatience));
  EXPECT_NEAR(exposure().exposure_s, 0.004, 1e-9);
  Duration shortest = kPatience;
  auto last = camera->grab(kPatience);
  for (int i = 0; i < 6; ++i) {
    auto next = camera->grab(kPatience);
    ASSERT_TRUE(last && next && last->device_time && next->device_time);
    if (i > 1) shortest = std::min(shortest, *next->device_time - *last->device_time);
    last = std::move(next);
  }
  EXPECT_NEAR(toSeconds(shortest), 0.05, 0.005);
}

TEST_F(AravisTest, RefusesValuesOutsideTheRanges) {
  plug(30.0);
  const auto camera = open();
  ASSERT_TRUE(camera);
  Controls controls;
  controls.exposure_s = 20.0;
  const Status status = camera->setControls(controls);
  EXPECT_EQ(status.code(), StatusCode::kInvalidInput);
  EXPECT_NE(status.message().find("exposure 20 s"), std::string::npos) << status.message();
  controls = {};
  controls.gain_db = std::nan("");
  EXPECT_EQ(camera->setControls(controls).code(), StatusCode::kInvalidInput);
  controls = {};
  controls.rate_hz = 0.0;
  EXPECT_EQ(camera->setControls(controls).code(), StatusCode::kInvalidInput);
  controls = {};
  controls.white_balance_red = 1.0;
  EXPECT_EQ(camera->setControls(controls).code(), StatusCode::kUnsupported);
  EXPECT_EQ(camera->configure(4000, 0, {}).status().code(), StatusCode::kInvalidInput);
  EXPECT_EQ(camera->configure(-1, 0, {}).status().code(), StatusCode::kInvalidInput);
  EXPECT_TRUE(camera->configure(0, 0, {}));
}

TEST_F(AravisTest, OddSizesAreTheUpperLeftPart) {
  plug(50.0);
  const auto camera = open();
  ASSERT_TRUE(camera);
  const auto format = camera->configure(77, 33, {});
  ASSERT_TRUE(format) << format.status().message();
  EXPECT_EQ(format->width_px, 77);
  ASSERT_TRUE(camera->start());
  const auto frame = camera->grab(kPatience);
  ASSERT_TRUE(frame && frame->status && frame->counter);
  const std::uint64_t number = numberOf(*frame->counter);
  const cv::Rect part(0, 0, 77, 33);
  EXPECT_EQ(*frame->bytes,
            bytesOf(pattern(size_, 0, number)(part), pattern(size_, 1, number)(part)));
  camera->stop();
  EXPECT_EQ(camera->configure(0, 0, {})->width_px, 128);
}

TEST_F(AravisTest, NoFrameInTimeIsNoError) {
  plug(0.5);
  const auto camera = stream();
  ASSERT_TRUE(camera);
  // The first frame comes when the stream starts, the others on the camera's grid, so the second
  // may follow it at once. Two seconds pass after the second, unless this thread sleeps through
  // them.
  ASSERT_TRUE(camera->grab(kPatience));
  StatusCode code = StatusCode::kOk;
  for (int tries = 0; tries < 3 && code == StatusCode::kOk; ++tries) {
    code = camera->grab(std::chrono::milliseconds(20)).status().code();
  }
  EXPECT_EQ(code, StatusCode::kOutOfRange);
  ASSERT_TRUE(camera->grab(kPatience)) << "silent for longer than it takes to ask after it";
  camera->stop();
  EXPECT_EQ(camera->grab(kPatience).status().code(), StatusCode::kOutOfRange);
}

TEST(AravisUsb, CamerasWithoutPermissionAreNamed) {
  const test::TemporaryFolder folder;
  const auto add = [&folder](const std::string& device, const std::string& number,
                             const std::string& interface_class, const std::string& subclass) {
    const std::filesystem::path devices(folder.path());
    std::filesystem::create_directories(devices / device);
    std::filesystem::create_directories(devices / (device + ":1.0"));
    std::ofstream(devices / device / "busnum") << "2\n";
    std::ofstream(devices / device / "devnum") << number << '\n';
    std::ofstream(devices / device / "manufacturer") << "Point Grey\n";
    std::ofstream(devices / device / "product") << "Bumblebee\n";
    std::ofstream(devices / device / "serial") << number << "77\n";
    std::ofstream(devices / (device + ":1.0") / "bInterfaceClass") << interface_class << '\n';
    std::ofstream(devices / (device + ":1.0") / "bInterfaceSubClass") << subclass << '\n';
  };
  add("2-1", "5", "ef", "05");  // a camera
  add("2-2", "6", "ef", "02");  // not one
  add("2-3", "7", "ef", "05");  // a camera that may be opened
  std::filesystem::create_directories(folder / "dev/002");
  std::ofstream(folder / "dev/002/006") << "";
  std::ofstream(folder / "dev/002/007") << "";
  const auto closed = aravis::closedUsbCameras(folder.path(), folder / "dev");
  ASSERT_EQ(closed.size(), 1U);
  EXPECT_EQ(closed[0].serial, "577");
  EXPECT_EQ(closed[0].model, "Bumblebee");
  EXPECT_NE(closed[0].problem.find("permission"), std::string::npos);
  EXPECT_TRUE(aravis::closedUsbCameras(folder / "nowhere", folder / "dev").empty());
}

}  // namespace
}  // namespace scanner::bumblebee
