#include "ros/stream_merger.h"

#include <algorithm>
#include <cmath>

namespace scanner::bridge {
namespace {

/// An interval this many times the median one is a gap.
constexpr double kGapFactor = 3.0;

}  // namespace

bool StampTracker::accept(Time stamp, Time recorded) {
  ++messages_;
  if (newest_ && stamp <= *newest_) {
    ++backward_;
    return false;
  }
  if (newest_) intervals_s_.push_back(toSeconds(stamp - *newest_));
  if (!first_) first_ = stamp;
  newest_ = stamp;
  const double delay = toSeconds(recorded - stamp);
  delay_sum_s_ += delay;
  if (std::abs(delay) > std::abs(delay_max_s_)) delay_max_s_ = delay;
  return true;
}

TopicStatistics StampTracker::statistics(const std::string& topic, std::size_t unusable) const {
  TopicStatistics s;
  s.topic = topic;
  s.messages = messages_ + unusable;
  s.backward = backward_;
  s.unusable = unusable;
  s.first = first_.value_or(Time());
  s.last = newest_.value_or(Time());
  s.max_delay_s = delay_max_s_;
  const std::size_t accepted = messages_ - backward_;
  if (accepted > 0) s.mean_delay_s = delay_sum_s_ / static_cast<double>(accepted);
  if (intervals_s_.empty()) return s;
  std::vector<double> sorted = intervals_s_;
  std::sort(sorted.begin(), sorted.end());
  const double median = sorted[sorted.size() / 2];
  s.rate_hz = 1.0 / median;
  s.longest_gap_s = sorted.back();
  s.gaps = static_cast<std::size_t>(
      sorted.end() - std::upper_bound(sorted.begin(), sorted.end(), kGapFactor * median));
  return s;
}

bool StreamMerger::addLeft(Time stamp, Image image) {
  left_.emplace(stamp, std::move(image));
  newest_left_ = stamp;
  pair(stamp);
  return advance(stamp);
}

bool StreamMerger::addRight(Time stamp, Image image) {
  right_.emplace(stamp, std::move(image));
  newest_right_ = stamp;
  pair(stamp);
  return advance(stamp);
}

bool StreamMerger::addImu(const ImuSample& sample) {
  samples_.push_back(sample);
  return advance(sample.stamp);
}

void StreamMerger::pair(Time stamp) {
  const auto left = left_.find(stamp);
  const auto right = right_.find(stamp);
  if (left != left_.end() && right != right_.end()) {
    frames_.emplace(stamp, StereoFrame{stamp, std::move(left->second), std::move(right->second)});
    left_.erase(left);
    right_.erase(right);
  }
  prune();
}

void StreamMerger::prune() {
  // Stamps only grow, so an image older than the newest of the other side stays alone.
  while (newest_right_ && !left_.empty() && left_.begin()->first < *newest_right_) {
    unpaired_left_.push_back(left_.begin()->first);
    left_.erase(left_.begin());
  }
  while (newest_left_ && !right_.empty() && right_.begin()->first < *newest_left_) {
    unpaired_right_.push_back(right_.begin()->first);
    right_.erase(right_.begin());
  }
}

bool StreamMerger::advance(Time stamp) {
  newest_ = newest_ ? std::max(*newest_, stamp) : stamp;
  return release(*newest_ - window_);
}

bool StreamMerger::deliverImu() {
  const ImuSample sample = samples_.front();
  samples_.pop_front();
  newest_sample_ = sample.stamp;
  return !handlers_.imu || handlers_.imu(sample);
}

bool StreamMerger::release(Time horizon) {
  while (!frames_.empty() && frames_.begin()->first <= horizon) {
    const Time stamp = frames_.begin()->first;
    bool reached = newest_sample_ && *newest_sample_ >= stamp;
    while (!reached && !samples_.empty()) {
      reached = samples_.front().stamp >= stamp;
      if (!deliverImu()) return false;
    }
    const StereoFrame frame = std::move(frames_.begin()->second);
    frames_.erase(frames_.begin());
    ++delivered_;
    if (handlers_.frame && !handlers_.frame(frame)) return false;
  }
  while (!samples_.empty() && samples_.front().stamp <= horizon) {
    if (!deliverImu()) return false;
  }
  return true;
}

bool StreamMerger::finish() {
  for (const auto& [stamp, image] : left_) unpaired_left_.push_back(stamp);
  for (const auto& [stamp, image] : right_) unpaired_right_.push_back(stamp);
  left_.clear();
  right_.clear();
  return release(Time::max());
}

}  // namespace scanner::bridge
