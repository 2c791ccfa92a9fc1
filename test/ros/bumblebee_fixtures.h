#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <algorithm>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "scanner/core/options.h"
#include "scanner/ros/conversions.h"
#include "scanner/simulation/emulated_bumblebee.h"

/// A camera that shows numbered pictures, and what listens to the node.
namespace scanner::test {

using bridge::fromRos;
using simulation::EmulatedBumblebee;
using simulation::Exposure;

inline constexpr double kPatience_s = 20.0;
inline constexpr int kWidth = 160, kHeight = 120;

inline bool eventually(const std::function<bool()>& done) {
  const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(kPatience_s);
  while (!done()) {
    if (ros::WallTime::now() > deadline || !ros::ok()) return false;
    ros::WallDuration(0.02).sleep();
  }
  return true;
}

/// Other for each eye, pixel and frame; the first pixel tells the frame.
inline std::uint8_t pixel(int eye, int number, int x, int y) {
  return static_cast<std::uint8_t>(number + 7 * x + 13 * y + 101 * eye * (x + y > 0 ? 1 : 0));
}

inline Image picture(int eye, int number) {
  Image image{cv::Mat(kHeight, kWidth, CV_8UC1), PixelFormat::kBayerRggb8};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      image.data.at<std::uint8_t>(y, x) = pixel(eye, number, x, y);
    }
  }
  return image;
}

inline bool isPicture(const sensor_msgs::Image& image, int eye) {
  if (image.data.size() != static_cast<std::size_t>(kWidth * kHeight)) return false;
  const cv::Mat wanted = picture(eye, image.data[0]).data;
  return std::equal(image.data.begin(), image.data.end(), wanted.datastart);
}

/// A camera that shows numbered pictures, and what settings it was given.
class Camera {
 public:
  explicit Camera(const std::string& serial) : camera_(options(serial), source()) {}
  EmulatedBumblebee& device() { return camera_; }
  Exposure exposure() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return exposure_;
  }

 private:
  static EmulatedBumblebee::Options options(const std::string& serial) {
    EmulatedBumblebee::Options options;
    options.serial = serial;
    options.width_px = kWidth;
    options.height_px = kHeight;
    return options;
  }
  EmulatedBumblebee::FrameSource source() {
    return [this](std::uint64_t number, const Exposure& exposure) {
      const std::lock_guard<std::mutex> lock(mutex_);
      exposure_ = exposure;
      const int shown = static_cast<int>(number % 256);
      return StereoFrame{{}, picture(0, shown), picture(1, shown)};
    };
  }

  mutable std::mutex mutex_;
  Exposure exposure_;
  EmulatedBumblebee camera_;  // last: its thread calls the source
};

template <typename Message>
class Inbox {
 public:
  Inbox(ros::NodeHandle& nh, const std::string& topic)
      : subscriber_(nh.subscribe<Message>(
            topic, 0, [this](const typename Message::ConstPtr& m) { take(m); })) {}
  std::vector<typename Message::ConstPtr> all() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }
  std::size_t size() const { return all().size(); }

 private:
  void take(const typename Message::ConstPtr& m) {
    const std::lock_guard<std::mutex> lock(mutex_);
    messages_.push_back(m);
  }
  mutable std::mutex mutex_;
  std::vector<typename Message::ConstPtr> messages_;
  ros::Subscriber subscriber_;
};

/// The newest status of each name.
class DiagnosticsInbox {
 public:
  explicit DiagnosticsInbox(ros::NodeHandle& nh)
      : subscriber_(nh.subscribe<diagnostic_msgs::DiagnosticArray>(
            "/diagnostics", 100,
            [this](const diagnostic_msgs::DiagnosticArray::ConstPtr& m) { take(*m); })) {}
  diagnostic_msgs::DiagnosticStatus of(const std::string& node) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = newest_.find(node + ": bumblebee");
    return found == newest_.end() ? diagnostic_msgs::DiagnosticStatus() : found->second;
  }
  std::string value(const std::string& node, const std::string& key) const {
    for (const diagnostic_msgs::KeyValue& v : of(node).values) {
      if (v.key == key) return v.value;
    }
    return "";
  }
  bool says(const std::string& node, int level, const std::string& text) const {
    const diagnostic_msgs::DiagnosticStatus status = of(node);
    return status.level == level && status.message.find(text) != std::string::npos;
  }

 private:
  void take(const diagnostic_msgs::DiagnosticArray& array) {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const diagnostic_msgs::DiagnosticStatus& status : array.status) {
      newest_[status.name] = status;
    }
  }
  mutable std::mutex mutex_;
  std::map<std::string, diagnostic_msgs::DiagnosticStatus> newest_;
  ros::Subscriber subscriber_;
};

inline constexpr int kOk = diagnostic_msgs::DiagnosticStatus::OK;
inline constexpr int kWarn = diagnostic_msgs::DiagnosticStatus::WARN;
inline constexpr int kError = diagnostic_msgs::DiagnosticStatus::ERROR;

/// What one node publishes.
struct PairTopics {
  explicit PairTopics(ros::NodeHandle& nh, const std::string& place = "")
      : left(nh, place + "/bumblebee/left/image_raw"),
        right(nh, place + "/bumblebee/right/image_raw"),
        left_info(nh, place + "/bumblebee/left/camera_info"),
        right_info(nh, place + "/bumblebee/right/camera_info") {}
  bool pairs(std::size_t count) const { return left.size() >= count && right.size() >= count; }

  Inbox<sensor_msgs::Image> left, right;
  Inbox<sensor_msgs::CameraInfo> left_info, right_info;
};

template <typename Message>
std::vector<Time> stamps(const Inbox<Message>& inbox) {
  std::vector<Time> times;
  for (const auto& message : inbox.all()) times.push_back(fromRos(message->header.stamp));
  return times;
}

inline void expectIncreasing(const std::vector<Time>& times) {
  for (std::size_t i = 1; i < times.size(); ++i) EXPECT_LT(times[i - 1], times[i]) << i;
}

/// Every picture is one that the camera took, of the right eye, and both of a pair are of the same
/// exposure.
inline void expectRightPictures(const PairTopics& topics) {
  std::map<Time, int> number;
  for (const auto& left : topics.left.all()) {
    EXPECT_TRUE(isPicture(*left, 0));
    number[fromRos(left->header.stamp)] = left->data.at(0);
  }
  std::size_t pairs = 0;
  for (const auto& right : topics.right.all()) {
    EXPECT_TRUE(isPicture(*right, 1));
    const auto left = number.find(fromRos(right->header.stamp));
    if (left == number.end()) continue;
    ++pairs;
    EXPECT_EQ(right->data.at(0), left->second);
  }
  // Two subscriptions do not begin at the same moment; nor do they end there.
  EXPECT_GE(pairs + 4, topics.right.size());
}

inline void expectCamera(const sensor_msgs::CameraInfo& info, double fx, double p3) {
  EXPECT_EQ(info.width, static_cast<unsigned>(kWidth));
  EXPECT_EQ(info.height, static_cast<unsigned>(kHeight));
  EXPECT_EQ(info.distortion_model, "plumb_bob");
  EXPECT_EQ(info.K[0], fx);
  EXPECT_EQ(info.D.at(0), -0.31);
  EXPECT_EQ(info.P[0], 168.0);
  EXPECT_EQ(info.P[3], p3);
}

/// Bounds of the numbers that a description names.
class BoundsOf : public OptionVisitor {
 public:
  std::map<std::string, Bounds> bounds;
  std::map<std::string, double> defaults;

  void option(const char*, bool&, const char*) override {}
  void option(const char* name, int& value, Bounds b, const char* unit, const char* text) override {
    double number = value;
    option(name, number, b, unit, text);
  }
  void option(const char* name, double& value, Bounds b, const char*, const char*) override {
    bounds.emplace(name, b);
    defaults[name] = value;
  }
  void option(const char*, std::string&, const char*) override {}

 protected:
  std::size_t chooseIndex(const char*, std::size_t selected, const std::vector<std::string>&,
                          const char*) override {
    return selected;
  }
  void beginGroup(const char*, const char*) override {}
  void endGroup() override {}
};

}  // namespace scanner::test
