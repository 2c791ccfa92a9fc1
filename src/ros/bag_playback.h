#pragma once

#include <rosbag/message_instance.h>

#include <set>
#include <string>
#include <vector>

#include "ros/stream_merger.h"
#include "scanner/ros/bag_reader.h"
#include "scanner/ros/static_transforms.h"

namespace scanner::bridge {

/// The message, or nothing with the reason in `error`.
template <typename Message>
boost::shared_ptr<Message> read(const rosbag::MessageInstance& instance, std::string* error) {
  try {
    boost::shared_ptr<Message> message = instance.instantiate<Message>();
    if (!message) *error = "has the wrong type, " + instance.getDataType();
    return message;
  } catch (const std::exception& e) {
    *error = std::string("cannot be read: ") + e.what();
  }
  return nullptr;
}

/// One run through the file: converts, checks and hands on every message.
class Playback {
 public:
  Playback(const Topics& topics, const Result<StereoCalibration>& calibration,
           const StaticTransforms& transforms, const BagHandlers& handlers);

  /// False when a handler asked to stop.
  bool take(const rosbag::MessageInstance& instance);
  void finish() { merger_.finish(); }
  BagStatistics statistics();
  Trajectory takeGroundTruth() { return std::move(ground_truth_); }

 private:
  struct Stream {
    StampTracker tracker;
    std::size_t unusable = 0;
  };

  void note(const std::string& kind, const std::string& line);
  template <typename Message>
  boost::shared_ptr<Message> convert(const rosbag::MessageInstance& instance);
  bool acceptStamp(Stream& stream, Time stamp, const rosbag::MessageInstance& instance);
  void reject(Stream& stream, const rosbag::MessageInstance& instance, const std::string& why);
  bool takeImage(const rosbag::MessageInstance& instance, bool left);
  bool takeImu(const rosbag::MessageInstance& instance);
  void takeInfo(const rosbag::MessageInstance& instance, bool left);
  void takeTruth(const rosbag::MessageInstance& instance);
  void turn(ImuSample& sample, const std::string& frame);
  void noteUnpaired(const std::vector<Time>& stamps, const std::string& topic);

  const Topics& topics_;
  const Result<StereoCalibration>& calibration_;
  const StaticTransforms& transforms_;
  StreamMerger merger_;
  Stream left_, right_, imu_, truth_;
  std::set<Time> left_images_, left_infos_;
  Trajectory ground_truth_;
  std::set<std::string> noted_;
  BagStatistics statistics_;
};

}  // namespace scanner::bridge
