#include "scanner/bumblebee/driver.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "bumblebee/scripted_camera.h"
#include "support/temporary_folder.h"

namespace scanner::bumblebee {
namespace {

using test::CameraScript;

constexpr std::chrono::seconds kPatience{5};  ///< what a busy machine may take

DriverOptions quick() {
  DriverOptions options;
  options.transport = TransportChoice::kAravis;
  options.rate_hz = 100.0;
  options.auto_exposure = false;
  options.frame_timeout_s = 0.2;
  options.retry_min_s = 0.01;
  options.retry_max_s = 0.05;
  return options;
}

/// Collects pairs, and waits for things to happen.
class Collector {
 public:
  Driver::Callback callback() {
    return [this](const CapturedPair& pair) {
      const std::lock_guard<std::mutex> lock(mutex_);
      pairs_.push_back(pair);
      changed_.notify_all();
    };
  }
  bool waitFor(std::size_t count) {
    std::unique_lock<std::mutex> lock(mutex_);
    return changed_.wait_for(lock, kPatience, [&] { return pairs_.size() >= count; });
  }
  std::vector<CapturedPair> pairs() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return pairs_;
  }
  void clear() {
    const std::lock_guard<std::mutex> lock(mutex_);
    pairs_.clear();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<CapturedPair> pairs_;
};

/// Statistics are polled: nothing in the interface tells when they change.
template <typename Condition>
bool eventually(const DriverCore& driver, const Condition& condition) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  std::mutex mutex;
  std::unique_lock<std::mutex> lock(mutex);
  std::condition_variable timer;
  while (std::chrono::steady_clock::now() < end) {
    if (condition(driver.statistics())) return true;
    timer.wait_for(lock, std::chrono::milliseconds(5));
  }
  return false;
}

class DriverTest : public testing::Test {
 protected:
  DriverTest() {
    script_.capabilities.exposure_s = ControlRange{1e-5, 0.05};
    script_.capabilities.gain_db = ControlRange{0.0, 24.0};
    script_.capabilities.rate_hz = ControlRange{0.5, 200.0};
    script_.capabilities.frame_counter = true;
  }
  std::unique_ptr<DriverCore> drive(const DriverOptions& options = quick()) {
    return std::make_unique<DriverCore>(options, collector_.callback(), script_.bus());
  }
  void give(std::uint64_t counter) { script_.give(CameraScript::frame(counter)); }

  CameraScript script_;
  Collector collector_;
};

TEST_F(DriverTest, PublishesPairsWithOneStampAndUnwrappedNumbers) {
  auto driver = drive();
  for (const std::uint64_t counter : {65533U, 65534U, 65535U, 1U, 2U, 6U, 7U}) give(counter);
  ASSERT_TRUE(collector_.waitFor(7));
  const std::vector<CapturedPair> pairs = collector_.pairs();
  const std::uint64_t numbers[] = {1, 2, 3, 4, 5, 9, 10};
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(pairs[i].number, numbers[i]);
    EXPECT_EQ(pairs[i].frame.left.data.at<std::uint8_t>(1, 1), 90);
    EXPECT_EQ(pairs[i].exposure_s, 0.004);
    if (i > 0) {
      EXPECT_GT(pairs[i].frame.stamp, pairs[i - 1].frame.stamp);
    }
  }
  EXPECT_TRUE(eventually(*driver, [](const DriverStatistics& s) { return s.pairs == 7; }));
  const DriverStatistics s = driver->statistics();
  EXPECT_EQ(s.state, DriverState::kStreaming);
  EXPECT_EQ(s.problem, "");
  EXPECT_EQ(s.dropped, 3U) << "3, 4 and 5";
  EXPECT_EQ(s.damaged, 0U);
  EXPECT_EQ(s.connections, 1U);
  EXPECT_EQ(s.stamps, StampSource::kCounter);
  EXPECT_GT(s.rate_hz, 0.0);
  EXPECT_NEAR(s.mean_level[0], 90.0 / 255.0, 1e-9);
  EXPECT_EQ(s.camera.serial, "12345");
}

TEST_F(DriverTest, DamagedFramesAreCountedOnceAndNeverPublished) {
  auto driver = drive();
  give(1);
  CameraScript::Frame lost = CameraScript::frame(2);
  lost.status = Status(StatusCode::kIoError, "packets are missing");
  script_.give(lost);
  CameraScript::Frame small = CameraScript::frame(3);
  small.bytes = std::make_shared<const std::vector<std::uint8_t>>(63);
  small.counter.reset();
  script_.give(small);
  CameraScript::Frame nothing;
  script_.give(nothing);
  give(4);
  give(4);  // again
  give(5);
  ASSERT_TRUE(collector_.waitFor(3));
  const std::vector<CapturedPair> pairs = collector_.pairs();
  EXPECT_EQ(pairs[0].number, 1U);
  EXPECT_EQ(pairs[1].number, 4U);
  EXPECT_EQ(pairs[2].number, 5U);
  ASSERT_TRUE(eventually(*driver, [](const DriverStatistics& s) { return s.pairs == 3; }));
  EXPECT_EQ(driver->statistics().damaged, 4U);
  EXPECT_EQ(driver->statistics().dropped, 4U) << "the gap of two is made of damaged frames";
}

TEST_F(DriverTest, ACounterThatIsResetIsNoGap) {
  auto driver = drive();
  for (const std::uint64_t counter : {5000U, 5001U, 3U, 4U, 60000U, 60001U}) give(counter);
  ASSERT_TRUE(collector_.waitFor(6));
  EXPECT_EQ(collector_.pairs().back().number, 6U);
  EXPECT_EQ(driver->statistics().dropped, 0U);
}

TEST_F(DriverTest, ReconnectsAndKeepsNumbersStampsAndSettings) {
  auto driver = drive();
  give(1);
  give(2);
  ASSERT_TRUE(collector_.waitFor(2));
  DriverOptions changed = quick();
  changed.exposure_s = 0.002;
  changed.gain_db = 6.0;
  EXPECT_TRUE(driver->reconfigure(changed));
  EXPECT_EQ(script_.read([&] { return script_.controls.exposure_s.value_or(0.0); }), 0.002);
  script_.edit([&] {
    script_.open = Status(StatusCode::kIoError, "no permission: /dev/bus/usb/001/002");
    script_.controls = {};  // the camera forgets
  });
  script_.give(Status(StatusCode::kIoError, "the camera is gone"));
  EXPECT_TRUE(eventually(*driver, [](const DriverStatistics& s) {
    return s.state == DriverState::kSearching &&
           s.problem.find("no permission") != std::string::npos;
  })) << driver->statistics().problem;
  EXPECT_EQ(script_.read([&] { return script_.alive; }), 0) << "closed";
  EXPECT_EQ(driver->readRegister(0).status().code(), StatusCode::kOutOfRange);
  script_.edit([&] { script_.open = Status::ok(); });
  give(65401);
  ASSERT_TRUE(collector_.waitFor(3));
  const std::vector<CapturedPair> pairs = collector_.pairs();
  EXPECT_EQ(pairs[2].number, 3U);
  EXPECT_GT(pairs[2].frame.stamp, pairs[1].frame.stamp);
  EXPECT_EQ(pairs[2].exposure_s, 0.002);
  EXPECT_EQ(pairs[2].gain_db, 6.0);
  EXPECT_TRUE(eventually(*driver, [](const DriverStatistics& s) { return s.pairs == 3; }));
  EXPECT_EQ(driver->statistics().connections, 2U);
  EXPECT_EQ(driver->statistics().problem, "");
  EXPECT_EQ(driver->statistics().dropped, 0U);
}

TEST_F(DriverTest, ASilentCameraIsSaidAndOpenedAgain) {
  auto driver = drive();
  give(1);
  ASSERT_TRUE(collector_.waitFor(1));
  EXPECT_TRUE(eventually(*driver, [](const DriverStatistics& s) {
    return s.problem.find("silent") != std::string::npos;
  }));
  EXPECT_TRUE(eventually(*driver, [&](const DriverStatistics&) {
    return script_.read([&] { return script_.opened.size(); }) >= 2;
  }));
  give(1);
  ASSERT_TRUE(collector_.waitFor(2));
  EXPECT_TRUE(eventually(*driver, [](const DriverStatistics& s) { return s.connections == 2; }));
}

TEST_F(DriverTest, OnlyDamagedFramesAreNoStream) {
  auto driver = drive();
  std::atomic<bool> done{false};
  std::thread damage([&] {
    std::mutex mutex;
    std::unique_lock<std::mutex> lock(mutex);
    std::condition_variable timer;
    while (!done) {
      CameraScript::Frame frame = CameraScript::frame(1);
      frame.status = Status(StatusCode::kIoError, "3 packets are missing");
      script_.give(frame);
      timer.wait_for(lock, std::chrono::milliseconds(10));
    }
  });
  EXPECT_TRUE(eventually(*driver, [](const DriverStatistics& s) {
    return s.problem.find("only damaged frames") != std::string::npos &&
           s.problem.find("3 packets") != std::string::npos;
  })) << driver->statistics().problem;
  EXPECT_EQ(driver->statistics().connections, 0U);
  done = true;
  damage.join();
  EXPECT_TRUE(collector_.pairs().empty());
}

TEST_F(DriverTest, TroubleWhileSettingUpIsSaidAndRetriedWithBackOff) {
  script_.configure = Status(StatusCode::kUnsupported, "no 1024x768");
  DriverOptions options = quick();
  options.retry_min_s = 0.05;
  options.retry_max_s = 0.4;
  const auto begin = std::chrono::steady_clock::now();
  auto driver = drive(options);
  EXPECT_TRUE(eventually(*driver, [&](const DriverStatistics& s) {
    return s.problem == "no 1024x768" && script_.read([&] { return script_.opened.size(); }) >= 4;
  }));
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(350))
      << "50, 100 and 200 ms lie between four attempts";
  script_.edit([&] {
    script_.configure = Status::ok();
    script_.start = Status(StatusCode::kIoError, "camera busy");
  });
  EXPECT_TRUE(
      eventually(*driver, [](const DriverStatistics& s) { return s.problem == "camera busy"; }));
  script_.edit([&] { script_.start = Status::ok(); });
  give(1);
  EXPECT_TRUE(collector_.waitFor(1));
}

TEST_F(DriverTest, AnAddressMayBeASerialNumber) {
  CameraIdentity usb;
  usb.transport = Transport::kUsb;
  usb.address = "1.7";
  usb.serial = "12345";
  script_.listed = {usb};
  script_.open = Status(StatusCode::kIoError, "busy");
  DriverOptions options = quick();
  options.transport = TransportChoice::kAuto;
  options.address = "12345";
  auto driver = drive(options);
  EXPECT_TRUE(eventually(*driver, [](const DriverStatistics& s) {
    return s.problem == "aravis: busy; usb: busy; dc1394: busy";
  })) << driver->statistics().problem;
  const auto opened = script_.read([&] { return script_.opened; });
  ASSERT_GE(opened.size(), 4U);
  using Opened = std::pair<Transport, std::string>;
  EXPECT_EQ(opened[0], Opened(Transport::kAravis, "12345"));
  EXPECT_EQ(opened[1], Opened(Transport::kUsb, "12345"));
  EXPECT_EQ(opened[2], Opened(Transport::kUsb, "1.7")) << "by the list";
  EXPECT_EQ(opened[3], Opened(Transport::kDc1394, "12345"));
}

TEST_F(DriverTest, AutoExposureMovesBothEyesAndReportsWhatIsInForce) {
  DriverOptions options = quick();
  options.auto_exposure = true;
  auto driver = drive(options);
  for (std::uint64_t i = 1; i <= 12; ++i) script_.give(CameraScript::frame(i, 20, 24));
  ASSERT_TRUE(collector_.waitFor(12));
  const std::vector<CapturedPair> pairs = collector_.pairs();
  EXPECT_NEAR(pairs.front().exposure_s, 0.004, 1e-9);
  EXPECT_GT(pairs.back().exposure_s * std::pow(10.0, pairs.back().gain_db / 20.0), 0.02);
  EXPECT_LE(pairs.back().exposure_s, options.auto_exposure_max_s + 1e-9);
  EXPECT_NEAR(pairs.back().exposure_s * 1e5, std::round(pairs.back().exposure_s * 1e5), 1e-6)
      << "as the camera took it";
  const ExposureSetting before = script_.read([&] {
    return ExposureSetting{*script_.controls.exposure_s, *script_.controls.gain_db};
  });
  // The camera goes and comes: it goes on from there, and is not dark again.
  script_.edit([&] { script_.controls = {}; });
  script_.give(Status(StatusCode::kIoError, "gone"));
  give(1);
  ASSERT_TRUE(collector_.waitFor(13));
  EXPECT_NEAR(collector_.pairs().back().exposure_s, before.exposure_s, 2e-5);
  EXPECT_EQ(collector_.pairs().back().gain_db, before.gain_db);
}

TEST_F(DriverTest, ReconfigureGivesTheCamerasAnswer) {
  auto driver = drive();
  EXPECT_THROW(driver->reconfigure([] {
    DriverOptions bad;
    bad.exposure_s = -1.0;
    return bad;
  }()),
               ConfigurationError);
  give(1);
  ASSERT_TRUE(collector_.waitFor(1));
  DriverOptions options = quick();
  options.gain_db = 30.0;
  Status status = driver->reconfigure(options);
  EXPECT_EQ(status.code(), StatusCode::kOutOfRange);
  EXPECT_NE(status.message().find("gain_db = 30"), std::string::npos);
  EXPECT_EQ(driver->statistics().gain_db, 24.0) << "the nearest";
  EXPECT_EQ(driver->statistics().problem, status.message());
  script_.edit([&] { script_.set = Status(StatusCode::kInvalidInput, "refused"); });
  options.gain_db = 3.0;
  EXPECT_EQ(driver->reconfigure(options).message(), "refused");
  EXPECT_EQ(driver->statistics().gain_db, 24.0) << "read back, not believed";
  script_.edit([&] { script_.set = Status::ok(); });
  EXPECT_TRUE(driver->reconfigure(options));
  EXPECT_EQ(driver->statistics().gain_db, 3.0);
  EXPECT_EQ(driver->statistics().problem, "");
  EXPECT_EQ(driver->readRegister(0x1F20).value(), 0x1F20U);
}

TEST_F(DriverTest, TheCallbackMayCallBackAndMayThrow) {
  std::unique_ptr<DriverCore> driver;
  std::mutex mutex;
  std::condition_variable changed;
  int calls = 0;
  std::unique_lock<std::mutex> lock(mutex);
  driver = std::make_unique<DriverCore>(
      quick(),
      [&](const CapturedPair&) {
        const std::lock_guard<std::mutex> guard(mutex);
        EXPECT_TRUE(driver->reconfigure(quick()));
        EXPECT_TRUE(driver->readRegister(0));
        ++calls;
        changed.notify_all();
        if (calls == 1) throw std::runtime_error("no disk");
      },
      script_.bus());
  give(1);
  EXPECT_TRUE(changed.wait_for(lock, kPatience, [&] { return calls == 1; }));
  EXPECT_TRUE(eventually(*driver, [](const DriverStatistics& s) {
    return s.problem.find("no disk") != std::string::npos;
  }));
  give(2);
  EXPECT_TRUE(changed.wait_for(lock, kPatience, [&] { return calls == 2; }));
  lock.unlock();
  driver.reset();
}

TEST_F(DriverTest, EndsAtOnceWhateverItWaitsFor) {
  DriverOptions options = quick();
  options.retry_min_s = options.retry_max_s = 60.0;
  script_.open = Status(StatusCode::kIoError, "none");
  const auto begin = std::chrono::steady_clock::now();
  auto driver = drive(options);
  EXPECT_TRUE(eventually(*driver, [](const DriverStatistics& s) { return !s.problem.empty(); }));
  driver.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
  EXPECT_EQ(script_.read([&] { return script_.alive; }), 0);
}

TEST(DriverOptions, AreDescribedAndChecked) {
  DriverOptions options;
  options.transport = TransportChoice::kDc1394;
  options.bus.iso_speed_mbps = 800;
  DriverOptions again;
  loadOptions(dumpOptions(options), "bumblebee", again);
  EXPECT_EQ(again.transport, TransportChoice::kDc1394);
  EXPECT_EQ(again.bus.iso_speed_mbps, 800);
  const auto refused = [](const std::string& yaml_key, DriverOptions bad) {
    try {
      const Driver driver(bad, [](const CapturedPair&) {});
    } catch (const ConfigurationError& error) {
      EXPECT_NE(std::string(error.what()).find(yaml_key), std::string::npos) << error.what();
      return true;
    }
    return false;
  };
  options = {};
  options.rate_hz = 0.0;
  EXPECT_TRUE(refused("rate_hz", options));
  options = {};
  options.retry_max_s = 0.1;
  EXPECT_TRUE(refused("retry_max_s", options));
  options = {};
  options.transport = TransportChoice::kFile;
  EXPECT_TRUE(refused("address", options));
  options = {};
  options.bus.iso_speed_mbps = 123;
  EXPECT_TRUE(refused("bus.iso_speed_mbps", options));
  EXPECT_THROW(Driver(DriverOptions(), nullptr), ConfigurationError);
}

TEST(DriverOnFiles, ARecordingIsPlayedToItsEnd) {
  const test::TemporaryFolder folder;
  for (const char* name : {"left1.png", "right1.png", "left3.png", "right3.png"}) {
    ASSERT_TRUE(cv::imwrite(folder / name, cv::Mat(12, 16, CV_8UC1, cv::Scalar(name[0]))));
  }
  ASSERT_TRUE(cv::imwrite(folder / "left2.png", cv::Mat(12, 16, CV_8UC1)));  // alone
  DriverOptions options = quick();
  options.transport = TransportChoice::kFile;
  options.address = folder.path();
  options.bus.file_rate_hz = 50.0;
  Collector collector;
  const DriverCore driver(options, collector.callback(), CameraBus::system());
  EXPECT_TRUE(eventually(
      driver, [](const DriverStatistics& s) { return s.state == DriverState::kStopped; }));
  const DriverStatistics s = driver.statistics();
  EXPECT_EQ(s.problem.rfind("end of recording", 0), 0U) << s.problem;
  EXPECT_EQ(s.pairs, 2U);
  EXPECT_EQ(s.damaged, 1U);
  EXPECT_EQ(s.dropped, 1U);
  EXPECT_EQ(s.stamps, StampSource::kDeviceClock);
  const std::vector<CapturedPair> pairs = collector.pairs();
  ASSERT_EQ(pairs.size(), 2U);
  EXPECT_EQ(pairs[1].number, 3U);
  EXPECT_EQ(pairs[0].frame.left.data.at<std::uint8_t>(0, 0), 'l');
  EXPECT_EQ(pairs[0].frame.right.data.at<std::uint8_t>(0, 0), 'r');
}

}  // namespace
}  // namespace scanner::bumblebee
