// Rate of the whole stereo node, messages in, messages out: see stereo_rate.launch.
//
// The node lives in this process, as in a nodelet manager: what it publishes is not copied. Pairs
// of a recording are published so that two are always on their way, one being worked on and one
// waiting; they get new stamps, so that a short recording can be sent again and again.
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/PointCloud2.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <map>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "scanner/ros/stereo_node.h"

namespace scanner::bench {
namespace {

constexpr int kInFlight = 2;
constexpr int kWarmUp = 3;
constexpr double kPatience_s = 60.0;

struct Pair {
  sensor_msgs::ImageConstPtr left, right;
  sensor_msgs::CameraInfoConstPtr left_info, right_info;
  bool complete() const { return left && right && left_info && right_info; }
};

std::vector<Pair> readPairs(const std::string& path, std::size_t count) {
  rosbag::Bag bag(path);
  std::map<ros::Time, Pair> pairs;
  std::size_t complete = 0;
  for (const rosbag::MessageInstance& message : rosbag::View(bag)) {
    const auto take = [&](const char* topic, auto Pair::*member) {
      if (message.getTopic() != topic) return;
      using Pointer = std::decay_t<decltype(std::declval<Pair>().*member)>;
      const Pointer value =
          message.instantiate<std::remove_const_t<typename Pointer::element_type>>();
      if (value == nullptr) return;
      Pair& pair = pairs[value->header.stamp];
      pair.*member = value;
      if (pair.complete()) ++complete;
    };
    take("/bumblebee/left/image_raw", &Pair::left);
    take("/bumblebee/right/image_raw", &Pair::right);
    take("/bumblebee/left/camera_info", &Pair::left_info);
    take("/bumblebee/right/camera_info", &Pair::right_info);
    if (complete >= count) break;
  }
  std::vector<Pair> out;
  for (const auto& [stamp, pair] : pairs) {
    if (pair.complete()) out.push_back(pair);
  }
  if (out.empty()) throw std::runtime_error(path + " has no complete pair");
  return out;
}

template <typename Message>
boost::shared_ptr<const Message> stamped(const boost::shared_ptr<const Message>& message,
                                         const ros::Time& stamp) {
  auto copy = boost::make_shared<Message>(*message);
  copy->header.stamp = stamp;
  return copy;
}

class Bench {
 public:
  explicit Bench(std::vector<Pair> pairs) : pairs_(std::move(pairs)) {
    left_ = nh_.advertise<sensor_msgs::Image>("bumblebee/left/image_raw", 10);
    right_ = nh_.advertise<sensor_msgs::Image>("bumblebee/right/image_raw", 10);
    left_info_ = nh_.advertise<sensor_msgs::CameraInfo>("bumblebee/left/camera_info", 10);
    right_info_ = nh_.advertise<sensor_msgs::CameraInfo>("bumblebee/right/camera_info", 10);
    points_ = nh_.subscribe("stereo/points", 10, &Bench::onPoints, this);
  }

  /// Seconds between the clouds, after the first few.
  std::vector<double> run(std::size_t clouds) {
    connect();
    for (int i = 0; i < kInFlight; ++i) send();
    while (ros::ok() && arrivals_.size() < clouds + kWarmUp) {
      const std::size_t before = arrivals_.size();
      const ros::WallTime start = ros::WallTime::now();
      while (ros::ok() && arrivals_.size() == before) {
        ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
        if ((ros::WallTime::now() - start).toSec() > kPatience_s) {
          throw std::runtime_error("no cloud came");
        }
      }
    }
    std::vector<double> out;
    for (std::size_t i = kWarmUp + 1; i < arrivals_.size(); ++i) {
      out.push_back((arrivals_[i] - arrivals_[i - 1]).toSec());
    }
    return out;
  }

  std::size_t points() const { return valid_ / std::max<std::size_t>(arrivals_.size(), 1); }

 private:
  void connect() {
    const ros::WallTime start = ros::WallTime::now();
    const auto ready = [&] {
      return left_.getNumSubscribers() > 0 && right_.getNumSubscribers() > 0 &&
             left_info_.getNumSubscribers() > 0 && right_info_.getNumSubscribers() > 0 &&
             points_.getNumPublishers() > 0;
    };
    while (ros::ok() && !ready()) {
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
      if ((ros::WallTime::now() - start).toSec() > kPatience_s) {
        throw std::runtime_error("the node does not subscribe");
      }
    }
  }

  void send() {
    const Pair& pair = pairs_[sent_ % pairs_.size()];
    const ros::Time stamp = ros::Time(1000.0) + ros::Duration(0.1 * static_cast<double>(sent_));
    ++sent_;
    left_info_.publish(stamped(pair.left_info, stamp));
    right_info_.publish(stamped(pair.right_info, stamp));
    left_.publish(stamped(pair.left, stamp));
    right_.publish(stamped(pair.right, stamp));
  }

  void onPoints(const sensor_msgs::PointCloud2ConstPtr& cloud) {
    arrivals_.push_back(ros::WallTime::now());
    valid_ += cloud->data.size() / std::max<std::size_t>(cloud->point_step, 1);
    send();
  }

  ros::NodeHandle nh_;
  ros::Publisher left_, right_, left_info_, right_info_;
  ros::Subscriber points_;
  std::vector<Pair> pairs_;
  std::size_t sent_ = 0, valid_ = 0;
  std::vector<ros::WallTime> arrivals_;
};

int run() {
  const ros::NodeHandle private_nh("~");
  const auto bag = private_nh.param<std::string>("bag", "");
  const int clouds = std::max(2, private_nh.param("clouds", 60));
  const bridge::StereoNode node(ros::NodeHandle(), ros::NodeHandle("stereo_node"));
  Bench bench(readPairs(bag, 10));
  std::vector<double> intervals = bench.run(static_cast<std::size_t>(clouds));
  double sum = 0.0;
  for (const double interval : intervals) sum += interval;
  std::sort(intervals.begin(), intervals.end());
  std::printf("%zu clouds of %zu pixels: %.2f Hz; interval median %.1f ms, longest %.1f ms\n",
              intervals.size(), bench.points(), static_cast<double>(intervals.size()) / sum,
              1e3 * intervals[intervals.size() / 2], 1e3 * intervals.back());
  return 0;
}

}  // namespace
}  // namespace scanner::bench

int main(int argc, char** argv) {
  ros::init(argc, argv, "stereo_rate");
  try {
    return scanner::bench::run();
  } catch (const std::exception& e) {
    std::fprintf(stderr, "stereo_rate: %s\n", e.what());
    return 1;
  }
}
