#include "ros/bag_player.h"

#include <ros/init.h>
#include <rosgraph_msgs/Clock.h>
#include <topic_tools/shape_shifter.h>

#include <algorithm>

namespace scanner::bridge {
namespace {

const ros::Duration kClockStep(0.01);
const ros::WallDuration kPoll(0.05);

}  // namespace

BagPlayer::BagPlayer(const ros::NodeHandle& nh, const std::string& path,
                     const std::vector<std::string>& topics)
    : nh_(nh), bag_(path, rosbag::bagmode::Read) {
  view_ = std::make_unique<rosbag::View>(bag_, rosbag::TopicQuery(topics));
  constexpr std::uint32_t kUnbounded = 0;
  for (const rosbag::ConnectionInfo* connection : view_->getConnections()) {
    if (publishers_.count(connection->topic) > 0) continue;
    topic_tools::ShapeShifter shape;
    shape.morph(connection->md5sum, connection->datatype, connection->msg_def, "");
    publishers_[connection->topic] = shape.advertise(nh_, connection->topic, kUnbounded);
  }
  clock_ = nh_.advertise<rosgraph_msgs::Clock>("/clock", 100, true);
  publishClock(view_->getBeginTime());
}

Status BagPlayer::waitForSubscribers(
    const std::map<std::string, std::set<std::string>>& subscribers, ros::WallDuration patience) {
  const ros::WallTime deadline = ros::WallTime::now() + patience;
  for (const auto& [topic, publisher] : publishers_) {
    const auto expected = subscribers.find(topic);
    const std::size_t count = expected == subscribers.end() ? 0 : expected->second.size();
    while (publisher.getNumSubscribers() < count) {
      if (!ros::ok() || ros::WallTime::now() > deadline) {
        return Status(StatusCode::kNotEnoughData, "not all subscribers of " + topic + " connected");
      }
      kPoll.sleep();
    }
  }
  return Status::ok();
}

void BagPlayer::publishClock(const ros::Time& time) {
  rosgraph_msgs::Clock message;
  message.clock = clock_at_ = time;
  clock_.publish(message);
}

void BagPlayer::advanceTo(const ros::Time& time, double rate) {
  const ros::Time begin = view_->getBeginTime();
  while (ros::ok() && clock_at_ < time) {
    const ros::Time next = std::min(time, clock_at_ + kClockStep);
    const ros::WallTime due = wall_start_ + ros::WallDuration((next - begin).toSec() / rate);
    // Behind schedule: straight to the message, one clock step for it.
    if (due < ros::WallTime::now()) return publishClock(time);
    ros::WallTime::sleepUntil(due);
    publishClock(next);
  }
}

Status BagPlayer::play(double rate) {
  wall_start_ = ros::WallTime::now();
  for (const rosbag::MessageInstance& instance : *view_) {
    advanceTo(instance.getTime(), rate);
    if (!ros::ok()) return Status(StatusCode::kIoError, "interrupted");
    try {
      const auto message = instance.instantiate<topic_tools::ShapeShifter>();
      publishers_.at(instance.getTopic()).publish(message);
    } catch (const std::exception& e) {
      return Status(StatusCode::kIoError, bag_.getFileName() + ": " + e.what());
    }
  }
  return Status::ok();
}

}  // namespace scanner::bridge
