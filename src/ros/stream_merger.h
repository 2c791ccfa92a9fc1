#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "scanner/ros/bag_reader.h"

namespace scanner::bridge {

/// Collects one topic's stamps and turns them into TopicStatistics.
class StampTracker {
 public:
  /// False when `stamp` is not after the newest one: the message is to be skipped.
  bool accept(Time stamp, Time recorded);
  TopicStatistics statistics(const std::string& topic, std::size_t unusable) const;
  std::optional<Time> newest() const { return newest_; }
  std::size_t backward() const { return backward_; }

 private:
  std::size_t messages_ = 0;
  std::size_t backward_ = 0;
  std::optional<Time> first_, newest_;
  std::vector<double> intervals_s_;
  double delay_sum_s_ = 0.0;
  double delay_max_s_ = 0.0;
};

/// Pairs images by exact stamp and merges pairs and samples by stamp (see BagReader::play). Each
/// stream must come in with increasing stamps; streams may lag behind each other by up to `window`.
class StreamMerger {
 public:
  StreamMerger(const BagHandlers& handlers, Duration window)
      : handlers_(handlers), window_(window) {}

  /// Each returns false when a handler asked to stop.
  bool addLeft(Time stamp, Image image);
  bool addRight(Time stamp, Image image);
  bool addImu(const ImuSample& sample);
  bool finish();

  std::size_t frames() const { return delivered_; }
  const std::vector<Time>& unpairedLeft() const { return unpaired_left_; }
  const std::vector<Time>& unpairedRight() const { return unpaired_right_; }

 private:
  void pair(Time stamp);
  void prune();
  bool advance(Time stamp);
  bool release(Time horizon);
  bool deliverImu();

  BagHandlers handlers_;
  Duration window_;
  std::map<Time, Image> left_, right_;  ///< waiting for their partners
  std::optional<Time> newest_left_, newest_right_, newest_;
  std::map<Time, StereoFrame> frames_;  ///< waiting for the horizon
  std::deque<ImuSample> samples_;
  std::optional<Time> newest_sample_;  ///< delivered
  std::size_t delivered_ = 0;
  std::vector<Time> unpaired_left_, unpaired_right_;
};

}  // namespace scanner::bridge
