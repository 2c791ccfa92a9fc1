#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "bumblebee/transports.h"
#include "scanner/simulation/emulated_bumblebee.h"
#include "support/camera_port_lock.h"

/// An emulated GigE camera on the loopback interface, and our transport that streams from it.
namespace scanner::bumblebee {

using Steady = std::chrono::steady_clock;

inline constexpr Duration kPatience = std::chrono::seconds(10);  ///< what a busy machine may take
inline constexpr std::uint64_t kFirstId = 65401;                 ///< of the emulated camera
inline const char* const kHere = "127.0.0.1";

inline double secondsSince(Steady::time_point begin) {
  return std::chrono::duration<double>(Steady::now() - begin).count();
}

inline std::uint64_t numberOf(std::uint64_t id) {
  return id >= kFirstId ? id - kFirstId : id - 1 + (65536 - kFirstId);
}

/// Without any symmetry, other for each eye and frame.
inline cv::Mat pattern(cv::Size size, int eye, std::uint64_t number) {
  cv::Mat image(size, CV_8UC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const int value = 7 * x + 13 * y + 101 * eye + 29 * static_cast<int>(number);
      image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(value);
    }
  }
  return image;
}

inline std::vector<std::uint8_t> bytesOf(const cv::Mat& left, const cv::Mat& right) {
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
    simulation::EmulatedBumblebee::Options options;
    options.width_px = width;
    options.height_px = height;
    options.rate_hz = rate_hz;
    options.exposure = {0.001, 2.0};
    device_ = std::make_unique<simulation::EmulatedBumblebee>(
        options, [this](std::uint64_t number, const simulation::Exposure& exposure) {
          const std::lock_guard<std::mutex> guard(mutex_);
          exposure_ = exposure;
          if (device_) times_[number] = device_->frameTime();
          return StereoFrame{{},
                             {pattern(size_, 0, number), PixelFormat::kMono8},
                             {pattern(size_, 1, number), PixelFormat::kMono8}};
        });
  }
  simulation::Exposure exposure() {
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
  simulation::Exposure exposure_;
  std::map<std::uint64_t, Time> times_;
  std::unique_ptr<simulation::EmulatedBumblebee> device_;  // last: its thread uses the others
};

}  // namespace scanner::bumblebee
