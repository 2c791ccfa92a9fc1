#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "scanner/core/camera.h"
#include "scanner/core/image.h"
#include "scanner/core/imu.h"
#include "scanner/core/se3.h"
#include "scanner/core/status.h"

namespace scanner::bridge {

class StaticTransforms;

/// Where a recording keeps what (docs/architecture.md).
struct Topics {
  std::string left_image = "/bumblebee/left/image_raw";
  std::string right_image = "/bumblebee/right/image_raw";
  std::string left_info = "/bumblebee/left/camera_info";
  std::string right_info = "/bumblebee/right/camera_info";
  std::string imu = "/mti/imu/data";
  std::string ground_truth = "/ground_truth/pose";  ///< PoseStamped of base_link in map; optional
  std::string tf_static = "/tf_static";
  std::string base_frame = "base_link";
  /// Used when the images carry no frame_id.
  std::string camera_frame = "bumblebee_left_optical";
};

/// What one topic brought. Times are header stamps.
struct TopicStatistics {
  std::string topic;
  std::size_t messages = 0;    ///< readable ones
  std::size_t backward = 0;    ///< stamp not after the one before: skipped
  std::size_t unusable = 0;    ///< wrong encoding or size, NaN, wrong type ...: skipped
  std::size_t gaps = 0;        ///< intervals longer than three times the median one
  double rate_hz = 0.0;        ///< 1 / median interval; 0 when unknown
  double longest_gap_s = 0.0;  ///< longest interval
  double mean_delay_s = 0.0;   ///< record time minus header stamp
  double max_delay_s = 0.0;    ///< largest magnitude of the same
  Time first;
  Time last;
};

struct BagStatistics {
  TopicStatistics left, right, imu, ground_truth;
  std::size_t frames = 0;         ///< pairs delivered
  std::size_t unpaired_left = 0;  ///< left images without a right one of the same stamp
  std::size_t unpaired_right = 0;
  std::size_t images_without_info = 0;  ///< left images without a camera_info of the same stamp
  std::size_t calibration_changes = 0;  ///< camera_infos that differ from the first
  std::size_t unreadable = 0;           ///< messages that the file could not give (corrupt chunk)
  std::size_t imu_oriented = 0;         ///< samples with orientation
  /// One line for each kind of trouble, the first occurrence named; in order of occurrence.
  std::vector<std::string> notes;
};

/// Callbacks of BagReader::play. Either may be empty. Returning false ends the reading early.
struct BagHandlers {
  std::function<bool(const StereoFrame&)> frame;
  std::function<bool(const ImuSample&)> imu;
};

/// A recording: raw pairs, inertial samples, calibration, rig and (when recorded) truth.
///
/// Trouble inside the data is counted and skipped; trouble with the file is a Status. Not
/// thread-safe. Reading twice gives the same sequence twice.
class BagReader {
 public:
  /// Opens and indexes the file, and reads the first calibration, the static transforms and the
  /// first picture's header. kIoError in one line for a file that is absent, truncated, corrupt or
  /// not indexed (naming `rosbag reindex` where that helps).
  static Result<BagReader> open(const std::string& path, const Topics& topics = {});

  BagReader(BagReader&&) noexcept;
  BagReader& operator=(BagReader&&) noexcept;
  ~BagReader();

  const std::string& path() const;
  const Topics& topics() const;

  /// First thing that keeps this recording from being scanned: a missing topic, an unusable
  /// calibration, a picture whose size is not that of its camera_info. The rig is not part of it
  /// (it may come from a file).
  Status checkScannable() const;
  /// From the first camera_info of either side; passes validate() of core/camera.h.
  const Result<StereoCalibration>& calibration() const;
  /// From /tf_static: base_link to the frame that the left images name, through any chain.
  const Result<Rig>& rig() const;
  /// All of /tf_static.
  const StaticTransforms& transforms() const;
  /// Pairs to expect, from the index (for a progress bar).
  std::size_t expectedFrames() const;
  /// Topics in the file, sorted, with their types ("/a sensor_msgs/Image").
  std::vector<std::string> contents() const;

  /// Plays the file once, ordered by header stamp: before a frame come all inertial samples up to
  /// its stamp and, unless the samples end or pause there, the first one after it. Pairs are images
  /// of exactly equal stamps. Samples of a sensor mounted turned to base_link are turned into it
  /// (/tf_static). Statistics are complete when play() returns, also after an early end.
  BagStatistics play(const BagHandlers& handlers);
  /// What the last play() found on the truth topic; empty when the bag has none.
  const Trajectory& groundTruth() const;

 private:
  struct Contents;
  explicit BagReader(std::unique_ptr<Contents> contents);
  std::unique_ptr<Contents> contents_;
};

}  // namespace scanner::bridge
