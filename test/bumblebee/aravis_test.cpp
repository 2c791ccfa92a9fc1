#include <arv.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <thread>

#include "bumblebee/aravis_support.h"
#include "bumblebee/transports.h"
#include "scanner/simulation/emulated_bumblebee.h"
#include "support/camera_port_lock.h"
#include "support/temporary_folder.h"

namespace scanner::bumblebee {
namespace {

using simulation::EmulatedBumblebee;
using simulation::Exposure;
using Steady = std::chrono::steady_clock;

constexpr Duration kPatience = std::chrono::seconds(10);  ///< what a busy machine may take
constexpr std::uint64_t kFirstId = 65401;                 ///< of the emulated camera
const char* const kHere = "127.0.0.1";

double secondsSince(Steady::time_point begin) {
  return std::chrono::duration<double>(Steady::now() - begin).count();
}

std::uint64_t numberOf(std::uint64_t id) {
  return id >= kFirstId ? id - kFirstId : id - 1 + (65536 - kFirstId);
}

/// Without any symmetry, other for each eye and frame.
cv::Mat pattern(cv::Size size, int eye, std::uint64_t number) {
  cv::Mat image(size, CV_8UC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const int value = 7 * x + 13 * y + 101 * eye + 29 * static_cast<int>(number);
      image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(value);
    }
  }
  return image;
}

std::vector<std::uint8_t> bytesOf(const cv::Mat& left, const cv::Mat& right) {
  std::vector<std::uint8_t> bytes;
  for (int y = 0; y < left.rows; ++y) {
    for (int x = 0; x < left.cols; ++x) {
      bytes.push_back(left.at<std::uint8_t>(y, x));
      bytes.push_back(right.at<std::uint8_t>(y, x));
    }
  }
  return bytes;
}

class AravisTest : public testing::Test {
 protected:
  void plug(double rate_hz, int width = 128, int height = 96) {
    size_ = {width, height};
    EmulatedBumblebee::Options options;
    options.width_px = width;
    options.height_px = height;
    options.rate_hz = rate_hz;
    options.exposure = {0.001, 2.0};
    device_ = std::make_unique<EmulatedBumblebee>(
        options, [this](std::uint64_t number, const Exposure& exposure) {
          const std::lock_guard<std::mutex> guard(mutex_);
          exposure_ = exposure;
          if (device_) times_[number] = device_->frameTime();
          return StereoFrame{{},
                             {pattern(size_, 0, number), PixelFormat::kMono8},
                             {pattern(size_, 1, number), PixelFormat::kMono8}};
        });
  }
  Exposure exposure() {
    const std::lock_guard<std::mutex> guard(mutex_);
    return exposure_;
  }
  std::map<std::uint64_t, Time> times() {
    const std::lock_guard<std::mutex> guard(mutex_);
    return times_;
  }
  static std::unique_ptr<StereoCamera> open(const TransportOptions& options = {}) {
    auto camera = openAravis(kHere, options);
    EXPECT_TRUE(camera) << camera.status().message();
    return camera ? std::move(*camera) : nullptr;
  }
  static std::unique_ptr<StereoCamera> stream(const Controls& controls = {}) {
    auto camera = open();
    if (!camera) return nullptr;
    const auto format = camera->configure(0, 0, controls);
    EXPECT_TRUE(format) << format.status().message();
    const Status started = camera->start();
    EXPECT_TRUE(started) << started.message();
    return format && started ? std::move(camera) : nullptr;
  }
  /// Of the emulated camera's whole picture.
  void expectRight(const RawFrame& frame) const {
    ASSERT_TRUE(frame.status) << frame.status.message();
    ASSERT_TRUE(frame.counter);
    const std::uint64_t number = numberOf(*frame.counter);
    EXPECT_EQ(*frame.bytes, bytesOf(pattern(size_, 0, number), pattern(size_, 1, number)))
        << "frame " << number;
  }

  test::CameraPortLock lock_;
  cv::Size size_;
  std::mutex mutex_;
  Exposure exposure_;
  std::map<std::uint64_t, Time> times_;
  std::unique_ptr<EmulatedBumblebee> device_;  // last: its thread uses the others
};

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
  for (int i = 0; i < 4; ++i) {
    const auto frame = camera->grab(kPatience);
    ASSERT_TRUE(frame) << frame.status().message();
    expectRight(*frame);
  }
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

TEST_F(AravisTest, LostPacketsAreCountedAndNoWrongFramePasses) {
  plug(30.0, 512, 384);  // 50 packets a frame
  const auto camera = stream();
  ASSERT_TRUE(camera);
  auto frame = camera->grab(kPatience);
  ASSERT_TRUE(frame);
  device_->setLostPackets(0.01);
  // A busy machine loses packets of its own, before and after those that are left out here.
  std::uint64_t good = frame->status ? 1 : 0;
  std::uint64_t damaged = 1 - good;
  std::uint64_t gaps = 0;
  bool sound_again = false;
  const std::uint64_t first = numberOf(*frame->counter);
  std::uint64_t last = first;
  for (int i = 0; i < 90; ++i) {
    if (i == 80) device_->setLostPackets(0.0);
    frame = camera->grab(kPatience);
    ASSERT_TRUE(frame) << frame.status().message();
    ASSERT_TRUE(frame->counter);
    const std::uint64_t number = numberOf(*frame->counter);
    ASSERT_GT(number, last);
    gaps += number - last - 1;
    last = number;
    if (frame->status) {
      ++good;
      expectRight(*frame);
      sound_again = i > 80;
    } else {
      ++damaged;
      EXPECT_EQ(frame->status.code(), StatusCode::kNotEnoughData);
      EXPECT_TRUE(frame->bytes->empty());
      EXPECT_NE(frame->status.message().find("packets lost"), std::string::npos);
    }
  }
  EXPECT_TRUE(sound_again);
  EXPECT_EQ(good + damaged + gaps, last - first + 1);
  EXPECT_GT(damaged, 10U) << "40 % of 80";
  EXPECT_LT(damaged, 60U);
  const TransportStatistics statistics = camera->statistics();
  EXPECT_EQ(statistics.incomplete, damaged);
  EXPECT_EQ(statistics.frames, good);
  EXPECT_GE(statistics.lost_packets, damaged);
  EXPECT_LT(statistics.lost_packets, 100U) << "about 40 of 4000";
}

TEST_F(AravisTest, ASlowReaderGetsTheNewestFrames) {
  plug(100.0);
  TransportOptions options;
  options.buffers = 4;
  const auto camera = open(options);
  ASSERT_TRUE(camera && camera->configure(0, 0, {}) && camera->start());
  ASSERT_TRUE(camera->grab(kPatience));
  const std::uint64_t before = device_->framesTaken();
  const auto begin = Steady::now();
  while (device_->framesTaken() < before + 20 && secondsSince(begin) < 10.0) {
    std::this_thread::yield();
  }
  const auto frame = camera->grab(kPatience);
  ASSERT_TRUE(frame);
  expectRight(*frame);
  EXPECT_GT(numberOf(*frame->counter), before + 10);
  EXPECT_GT(camera->statistics().overruns, 10U);
}

TEST_F(AravisTest, UnplugIsNoticedAndTheCameraComesBack) {
  plug(30.0);
  auto camera = stream();
  ASSERT_TRUE(camera);
  ASSERT_TRUE(camera->grab(kPatience));
  device_->unplug();
  auto begin = Steady::now();
  for (;;) {
    const auto frame = camera->grab(kPatience);
    if (frame) continue;
    EXPECT_EQ(frame.status().code(), StatusCode::kIoError);
    EXPECT_NE(frame.status().message().find("gone"), std::string::npos);
    break;
  }
  EXPECT_LT(secondsSince(begin), 6.0);
  begin = Steady::now();
  EXPECT_EQ(camera->setControls({}).code(), StatusCode::kIoError);
  EXPECT_EQ(camera->start().code(), StatusCode::kIoError);
  camera.reset();
  EXPECT_LT(secondsSince(begin), 2.0) << "does not wait for farewells";
  EXPECT_FALSE(openAravis(kHere, {}));
  device_->plug();
  camera = stream();
  ASSERT_TRUE(camera);
  for (int i = 0; i < 3; ++i) {
    const auto frame = camera->grab(kPatience);
    ASSERT_TRUE(frame) << frame.status().message();
    expectRight(*frame);
  }
}

TEST_F(AravisTest, ARestartedCameraIsGoneAsWell) {
  plug(30.0);
  const auto camera = stream();
  ASSERT_TRUE(camera);
  ASSERT_TRUE(camera->grab(kPatience));
  device_->unplug();
  device_->plug();  // answers, but knows nothing of us
  Status status;
  const auto begin = Steady::now();
  while (status.code() != StatusCode::kIoError && secondsSince(begin) < 10.0) {
    status = camera->grab(kPatience).status();
  }
  EXPECT_EQ(status.code(), StatusCode::kIoError) << status.message();
}

TEST_F(AravisTest, ABusyCameraSaysSo) {
  plug(30.0);
  {
    const auto camera = stream();
    ASSERT_TRUE(camera);
    const auto second = openAravis(kHere, {});
    EXPECT_EQ(second.status().code(), StatusCode::kIoError);
    EXPECT_NE(second.status().message().find("busy"), std::string::npos)
        << second.status().message();
    const auto frame = camera->grab(kPatience);
    ASSERT_TRUE(frame);
    expectRight(*frame);
  }
  EXPECT_TRUE(openAravis(kHere, {})) << "free again";
}

TEST_F(AravisTest, StartsAndStopsAgainAndAgain) {
  plug(100.0);
  auto camera = stream();
  ASSERT_TRUE(camera);
  std::uint64_t last = 0;
  for (int i = 0; i < 5; ++i) {
    const auto frame = camera->grab(kPatience);
    ASSERT_TRUE(frame) << frame.status().message();
    expectRight(*frame);
    EXPECT_GE(*frame->counter, last);
    last = *frame->counter;
    camera->stop();
    camera->stop();
    EXPECT_EQ(camera->statistics().frames, 1U);
    ASSERT_TRUE(camera->start());
    ASSERT_TRUE(camera->start()) << "no harm";
  }
  camera.reset();  // while streaming
  EXPECT_TRUE(stream());
}

TEST_F(AravisTest, StopWakesAGrabInAnotherThread) {
  plug(0.2);
  const auto camera = stream();
  ASSERT_TRUE(camera);
  ASSERT_TRUE(camera->grab(kPatience));
  std::thread grabber([&] {
    EXPECT_EQ(camera->grab(std::chrono::seconds(60)).status().code(), StatusCode::kOutOfRange);
  });
  camera->stop();
  grabber.join();
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

/// Aravis' fake camera with another GenICam model, whose registers the test writes.
class OtherCameraTest : public AravisTest {
 protected:
  void plugModel(const std::vector<std::pair<std::string, std::string>>& changes) {
    ArvFakeCamera* const model = arv_fake_camera_new("MODEL");
    std::size_t size = 0;
    const char* const xml = arv_fake_camera_get_genicam_xml(model, &size);
    std::string text(xml, size);
    g_object_unref(model);
    for (const auto& [from, to] : changes) {
      const std::size_t place = text.find(from);
      ASSERT_NE(place, std::string::npos) << from;
      text.replace(place, from.size(), to);
    }
    const std::string path = folder_ / "model.xml";
    std::ofstream(path) << text;
    camera_.reset(arv_gv_fake_camera_new_full(kHere, "MODEL", path.c_str()));
    ASSERT_TRUE(camera_ && arv_gv_fake_camera_is_running(camera_.get()));
    write(ARV_FAKE_CAMERA_REGISTER_SENSOR_WIDTH, 64);
    write(ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT, 48);
    write(ARV_FAKE_CAMERA_REGISTER_WIDTH, 64);
    write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, 48);
  }
  void write(std::uint32_t address, std::uint32_t value) {
    arv_fake_camera_write_register(arv_gv_fake_camera_get_fake_camera(camera_.get()), address,
                                   value);
  }

  test::TemporaryFolder folder_;
  aravis::Object<ArvGvFakeCamera> camera_;
};

TEST_F(OtherCameraTest, WithoutMono16IsRefusedWithWhatItHas) {
  plugModel({{"EnumEntry Name=\"Mono16\"", "EnumEntry Name=\"Mono12\""},
             {"<Value>17825799</Value>", "<Value>17825797</Value>"}});
  const auto camera = open();
  ASSERT_TRUE(camera);
  const auto format = camera->configure(0, 0, {});
  EXPECT_EQ(format.status().code(), StatusCode::kUnsupported);
  EXPECT_NE(format.status().message().find("BayerRG8, Mono8, RGB8, Mono12"), std::string::npos)
      << format.status().message();
}

TEST_F(OtherCameraTest, FeaturesOfRicherCameras) {
  plugModel({{"<Max>10</Max>", "<Max>480</Max>"},  // GainRaw: too large for dB
             {"<!-- Analog control -->", R"(
      <Enumeration Name="PixelColorFilter"><EnumEntry Name="BayerGB"><Value>2</Value></EnumEntry>
        <Value>2</Value></Enumeration>
      <Float Name="DeviceTemperature"><Value>41.5</Value></Float>
      <Enumeration Name="BalanceRatioSelector"><EnumEntry Name="Red"><Value>0</Value></EnumEntry>
        <EnumEntry Name="Blue"><Value>1</Value></EnumEntry><Value>0</Value></Enumeration>
      <Float Name="BalanceRatio"><Value>1.5</Value><Min>0.25</Min><Max>4.0</Max></Float>)"}});
  const auto camera = open();
  ASSERT_TRUE(camera);
  const Capabilities c = camera->capabilities();
  ASSERT_TRUE(c.gain_db);
  EXPECT_NEAR(c.gain_db->max, 48.0, 1e-9);
  ASSERT_TRUE(c.white_balance);
  EXPECT_EQ(c.white_balance->min, 0.25);
  EXPECT_EQ(c.white_balance->max, 4.0);
  EXPECT_TRUE(c.temperature);
  EXPECT_EQ(camera->temperatureC(), 41.5);
  Controls controls;
  controls.gain_db = 12.3;
  controls.white_balance_blue = 2.0;
  const auto format = camera->configure(0, 0, controls);
  ASSERT_TRUE(format) << format.status().message();
  EXPECT_EQ(format->pixels, PixelFormat::kBayerGbrg8);
  const auto now = camera->controls();
  ASSERT_TRUE(now);
  EXPECT_NEAR(*now->gain_db, 12.3, 1e-9);
  EXPECT_EQ(*now->white_balance_blue, 2.0);
}

TEST_F(OtherCameraTest, AFrameOfAnotherKindIsDamagedAndTheNextIsGood) {
  plugModel({});
  const auto camera = stream();
  ASSERT_TRUE(camera);
  const auto next = [&](bool good) {
    for (int i = 0; i < 100; ++i) {
      auto frame = camera->grab(kPatience);
      if (!frame || frame->status.isOk() == good) return frame;
    }
    return Result<RawFrame>(Status(StatusCode::kIoError, "never"));
  };
  ASSERT_TRUE(next(true));
  write(ARV_FAKE_CAMERA_REGISTER_WIDTH, 32);
  auto frame = next(false);
  ASSERT_TRUE(frame) << frame.status().message();
  EXPECT_EQ(frame->status.code(), StatusCode::kInvalidInput) << frame->status.message();
  write(ARV_FAKE_CAMERA_REGISTER_WIDTH, 64);
  ASSERT_TRUE(next(true));
  write(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT, ARV_PIXEL_FORMAT_BAYER_RG_8);
  frame = next(false);
  ASSERT_TRUE(frame) << frame.status().message();
  EXPECT_EQ(frame->status.code(), StatusCode::kUnsupported) << frame->status.message();
  EXPECT_TRUE(frame->bytes->empty());
  write(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT, ARV_PIXEL_FORMAT_MONO_16);
  ASSERT_TRUE(next(true));
}

void stampBackwards(ArvBuffer* buffer, void* count, guint32 /*exposure*/, guint32 /*gain*/,
                    ArvPixelFormat /*format*/) {
  const int i = (*static_cast<std::atomic<int>*>(count))++;
  arv_buffer_set_timestamp(buffer, i == 3 ? 5 : 1'000'000U * static_cast<unsigned>(i));
}

TEST_F(OtherCameraTest, AClockThatRunsBackwardsIsNotBelieved) {
  plugModel({});
  std::atomic<int> count{0};  // the first stamp is 0
  arv_fake_camera_set_fill_pattern(arv_gv_fake_camera_get_fake_camera(camera_.get()),
                                   &stampBackwards, &count);
  auto camera = stream();
  ASSERT_TRUE(camera);
  std::vector<bool> stamped;
  for (int i = 0; i < 6; ++i) {
    const auto frame = camera->grab(kPatience);
    ASSERT_TRUE(frame) << frame.status().message();
    stamped.push_back(frame->device_time.has_value());
  }
  EXPECT_EQ(stamped, (std::vector<bool>{false, true, true, false, false, false}));
  camera.reset();
  camera_.reset();  // before `count` goes
}

}  // namespace
}  // namespace scanner::bumblebee
