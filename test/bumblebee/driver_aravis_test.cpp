#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <map>
#include <mutex>
#include <vector>

#include "scanner/bumblebee/driver.h"
#include "scanner/simulation/emulated_bumblebee.h"
#include "support/camera_port_lock.h"

// The whole driver against an emulated camera on the network: nothing in between is replaced.
namespace scanner::bumblebee {
namespace {

using simulation::EmulatedBumblebee;

constexpr std::chrono::seconds kPatience{20};  ///< what a busy machine may take
const cv::Size kSize{256, 192};

/// Grey values that tell eye, place and frame.
cv::Mat picture(int eye, std::uint64_t number) {
  cv::Mat image(kSize, CV_8UC1);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      const int value = 3 * x + 5 * y + 40 * eye + static_cast<int>(number % 64);
      image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(value % 200);
    }
  }
  return image;
}

class DriverOnAravis : public testing::Test {
 protected:
  DriverOnAravis()
      : camera_(cameraOptions(),
                [this](std::uint64_t n, const auto& exposure) { return take(n, exposure); }) {}

  static EmulatedBumblebee::Options cameraOptions() {
    EmulatedBumblebee::Options options;
    options.width_px = kSize.width;
    options.height_px = kSize.height;
    return options;
  }
  static DriverOptions driverOptions() {
    DriverOptions options;
    options.transport = TransportChoice::kAravis;
    options.address = "SIM0001";
    options.rate_hz = 30.0;
    options.auto_exposure = false;
    options.frame_timeout_s = 1.0;
    options.retry_min_s = 0.1;
    options.retry_max_s = 0.3;
    return options;
  }
  StereoFrame take(std::uint64_t number, const simulation::Exposure& exposure) {
    const std::lock_guard<std::mutex> lock(mutex_);
    truth_.push_back({camera_.frameTime() + fromSeconds(0.5 * exposure.exposure_s), number});
    seen_exposure_ = exposure;
    return {
        {}, {picture(0, number), PixelFormat::kMono8}, {picture(1, number), PixelFormat::kMono8}};
  }
  Driver::Callback callback() {
    return [this](const CapturedPair& pair) {
      const std::lock_guard<std::mutex> lock(mutex_);
      pairs_.push_back(pair);
      changed_.notify_all();
    };
  }
  /// Until there are `count` more pairs than now.
  bool waitForMore(std::size_t count) {
    std::unique_lock<std::mutex> lock(mutex_);
    const std::size_t goal = pairs_.size() + count;
    return changed_.wait_for(lock, kPatience, [&] { return pairs_.size() >= goal; });
  }
  template <typename Condition>
  bool eventually(const Condition& condition) {
    std::unique_lock<std::mutex> lock(mutex_);
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      changed_.wait_for(lock, std::chrono::milliseconds(10));
    }
    return true;
  }
  /// Every published pair is, byte by byte, one that was taken; stamps and numbers increase.
  void expectSound() {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      const cv::Mat& left = pairs_[i].frame.left.data;
      ASSERT_EQ(left.size(), kSize);
      const std::uint64_t number = left.at<std::uint8_t>(0, 0);
      EXPECT_EQ(cv::norm(left, picture(0, number), cv::NORM_INF), 0.0) << i;
      EXPECT_EQ(cv::norm(pairs_[i].frame.right.data, picture(1, number), cv::NORM_INF), 0.0) << i;
      if (i == 0) continue;
      EXPECT_GT(pairs_[i].frame.stamp, pairs_[i - 1].frame.stamp);
      EXPECT_GT(pairs_[i].number, pairs_[i - 1].number);
    }
  }

  test::CameraPortLock lock_;
  std::mutex mutex_;
  std::condition_variable changed_;
  struct Truth {
    Time mid_exposure;
    std::uint64_t number;
  };
  std::vector<Truth> truth_;
  std::vector<CapturedPair> pairs_;
  simulation::Exposure seen_exposure_;
  EmulatedBumblebee camera_;
};

TEST_F(DriverOnAravis, StreamsWithStampsOfTheCamera) {
  const Driver driver(driverOptions(), callback());
  ASSERT_TRUE(waitForMore(30)) << driver.statistics().problem;
  const DriverStatistics s = driver.statistics();
  EXPECT_EQ(s.state, DriverState::kStreaming);
  EXPECT_EQ(s.camera.serial, "SIM0001");
  EXPECT_EQ(s.stamps, StampSource::kDeviceClock);
  EXPECT_EQ(s.format.width_px, kSize.width);
  EXPECT_GT(s.rate_hz, 5.0);
  EXPECT_GT(s.bandwidth_Bps, 5.0 * 2 * kSize.area());
  expectSound();
  const std::lock_guard<std::mutex> lock(mutex_);
  // The first stamps wait for the fit; what latency remains is the loopback's.
  double worst = 0.0;
  for (std::size_t i = 10; i < pairs_.size(); ++i) {
    double nearest = 1.0;
    for (const Truth& truth : truth_) {
      const double error = toSeconds(pairs_[i].frame.stamp - truth.mid_exposure);
      if (std::abs(error) < std::abs(nearest)) nearest = error;
    }
    worst = std::max(worst, std::abs(nearest));
  }
  RecordProperty("worst_stamp_error_us", static_cast<int>(worst * 1e6));
  EXPECT_LT(worst, 0.012) << "well below half a period";
}

TEST_F(DriverOnAravis, ReconfiguresWhileStreamingAndExposesByItself) {
  DriverOptions options = driverOptions();
  Driver driver(options, callback());
  ASSERT_TRUE(waitForMore(2)) << driver.statistics().problem;
  options.exposure_s = 0.0015;
  options.gain_db = 5.0;
  const Status status = driver.reconfigure(options);
  EXPECT_TRUE(status) << status.message();
  EXPECT_TRUE(eventually([&] {
    return std::abs(seen_exposure_.exposure_s - 0.0015) < 1e-5 && seen_exposure_.gain_db == 5.0;
  }));
  ASSERT_TRUE(waitForMore(2));
  EXPECT_NEAR(driver.statistics().exposure_s, 0.0015, 1e-5);
  EXPECT_EQ(driver.statistics().gain_db, 5.0);
  options.auto_exposure = true;
  options.auto_target = 0.2;  // the pictures stay at 0.39, so it goes down
  EXPECT_TRUE(driver.reconfigure(options));
  EXPECT_TRUE(eventually(
      [&] { return seen_exposure_.gain_db == 0.0 && seen_exposure_.exposure_s < 0.0014; }));
  expectSound();
}

TEST_F(DriverOnAravis, LostPacketsAreDamagedFramesAndNeverPictures) {
  const Driver driver(driverOptions(), callback());
  ASSERT_TRUE(waitForMore(3)) << driver.statistics().problem;
  camera_.setLostPackets(0.05);
  EXPECT_TRUE(eventually([&] { return driver.statistics().dropped >= 5; }))
      << driver.statistics().dropped;
  camera_.setLostPackets(0.0);
  ASSERT_TRUE(waitForMore(5));
  EXPECT_EQ(driver.statistics().state, DriverState::kStreaming);
  EXPECT_GE(driver.statistics().dropped, driver.statistics().damaged);
  expectSound();
}

TEST_F(DriverOnAravis, RecoversFromUnpluggingByItself) {
  DriverOptions options = driverOptions();
  Driver driver(options, callback());
  ASSERT_TRUE(waitForMore(3)) << driver.statistics().problem;
  options.gain_db = 4.0;
  EXPECT_TRUE(driver.reconfigure(options));
  for (std::uint64_t round = 1; round <= 2; ++round) {
    camera_.unplug();
    EXPECT_TRUE(eventually([&] {
      const DriverStatistics s = driver.statistics();
      return s.state != DriverState::kStreaming && !s.problem.empty();
    }));
    camera_.plug();
    ASSERT_TRUE(waitForMore(3)) << driver.statistics().problem;
    EXPECT_EQ(driver.statistics().connections, 1 + round);
    EXPECT_EQ(driver.statistics().gain_db, 4.0) << "kept";
    EXPECT_EQ(driver.statistics().problem, "");
  }
  expectSound();
}

}  // namespace
}  // namespace scanner::bumblebee
