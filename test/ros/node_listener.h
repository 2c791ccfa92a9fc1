#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

/// What listens to a node under test.
namespace scanner::test {

/// Polls until it is done; false when a busy machine's patience has ended.
inline bool eventually(const std::function<bool()>& done, double patience_s = 40.0) {
  const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(patience_s);
  while (!done()) {
    if (ros::WallTime::now() > deadline || !ros::ok()) return false;
    ros::WallDuration(0.02).sleep();
  }
  return true;
}

/// Everything that a topic brought.
template <typename Message>
class Inbox {
 public:
  Inbox(ros::NodeHandle& nh, const std::string& topic)
      : subscriber_(nh.subscribe<Message>(
            topic, 0, [this](const typename Message::ConstPtr& m) { take(*m); })) {}
  std::vector<Message> all() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }
  std::size_t size() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_.size();
  }
  /// Waits until `count` more have come.
  bool more(std::size_t count) const {
    return eventually([this, wanted = size() + count] { return size() >= wanted; });
  }

 private:
  void take(const Message& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    messages_.push_back(message);
  }
  mutable std::mutex mutex_;
  std::vector<Message> messages_;
  ros::Subscriber subscriber_;
};

/// The newest status of each name ("mti_node: mti").
class DiagnosticsInbox {
 public:
  explicit DiagnosticsInbox(ros::NodeHandle& nh)
      : subscriber_(nh.subscribe<diagnostic_msgs::DiagnosticArray>(
            "/diagnostics", 100,
            [this](const diagnostic_msgs::DiagnosticArray::ConstPtr& m) { take(*m); })) {}
  diagnostic_msgs::DiagnosticStatus of(const std::string& name) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto found = newest_.find(name);
    return found == newest_.end() ? diagnostic_msgs::DiagnosticStatus() : found->second;
  }
  std::string value(const std::string& name, const std::string& key) const {
    for (const diagnostic_msgs::KeyValue& v : of(name).values) {
      if (v.key == key) return v.value;
    }
    return "";
  }
  /// Waits until the level is that and the message contains the text.
  bool says(const std::string& name, int level, const std::string& text) const {
    return eventually([&] {
      const diagnostic_msgs::DiagnosticStatus status = of(name);
      return status.level == level && status.message.find(text) != std::string::npos;
    });
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

}  // namespace scanner::test
