#pragma once

#include <rosbag/bag.h>

#include <functional>
#include <string>

#include "scanner/core/camera.h"
#include "scanner/core/image.h"
#include "scanner/core/imu.h"
#include "scanner/core/se3.h"
#include "scanner/ros/bag_reader.h"

namespace scanner::bridge {

inline constexpr const char* kRightCameraFrame = "bumblebee_right_optical";

/// Writes a bag with the scanner's topics beside its place (PATH.active). Recorded time = stamp, so
/// that the same input gives the same bytes; whoever calls keeps to the order of time. Throws what
/// rosbag throws. Not thread-safe.
class RecordingWriter {
 public:
  explicit RecordingWriter(const std::string& path, bool compressed = false);
  /// Removes the unfinished file unless commit() was called.
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;

  /// /tf_static, latched: raw left optical in base_link, right in left.
  void writeTransforms(Time stamp, const Eigen::Isometry3d& T_base_left,
                       const Eigen::Isometry3d& T_left_right);
  void writeFrame(const StereoFrame& frame, const StereoCalibration& calibration);
  void writeImu(const ImuSample& sample);
  void writeTruth(const StampedPose& pose);
  /// Closes the bag and moves it to its place.
  void commit();

 private:
  void writeEye(Time stamp, const Image& image, const CameraModel& camera, const std::string& frame,
                const std::string& image_topic, const std::string& info_topic);

  std::string path_;
  Topics topics_;
  rosbag::Bag bag_;
  bool committed_ = false;
};

/// Runs `write` on a new recording at `path` and commits it when the status is ok; what is thrown
/// while writing (a full disk, a folder that is not there) becomes kIoError naming the file. On
/// failure there is no file, and one that was there before stays.
Status writeRecording(const std::string& path, bool compressed,
                      const std::function<Status(RecordingWriter&)>& write);

}  // namespace scanner::bridge
