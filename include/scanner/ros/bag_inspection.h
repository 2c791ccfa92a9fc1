#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "scanner/core/camera.h"
#include "scanner/ros/bag_reader.h"

namespace scanner::bridge {

/// Brightness of one camera over the whole recording (8-bit values).
struct ExposureSummary {
  double mean = 0.0;             ///< 0..255
  double saturated_share = 0.0;  ///< of the pixels, 250 and above
  double black_share = 0.0;      ///< of the pixels, 5 and below
};

/// What the inertial samples say about their own units.
struct InertialSummary {
  double mean_acceleration = 0.0;   ///< magnitude as recorded; 9.8 when it is m/s^2
  double rate_percentile_95 = 0.0;  ///< magnitude as recorded
  /// Rotation by the rates over rotation by the orientations, as recorded: 1 for rad/s, 57 for
  /// deg/s. 0 when it cannot be told (no orientation, or no motion).
  double rate_scale = 0.0;
  double oriented_share = 0.0;     ///< of the samples, with orientation
  std::size_t frames_covered = 0;  ///< pairs with samples on both sides of their stamp
};

/// How well one configuration's disparity range suits the recording.
struct SuitabilitySummary {
  std::string config;
  double min_depth_m = 0.0;  ///< working range of the configuration on this rig
  double max_depth_m = 0.0;
  double share = 0.0;  ///< of the disparities that the scene shows, inside the range
};

struct BagInspection {
  std::string bag;
  std::vector<std::string> problems;  ///< each keeps the recording from being scanned
  std::vector<std::string> warnings;  ///< each costs quality or data
  BagStatistics statistics;
  std::optional<StereoCalibration> calibration;
  std::optional<Rig> rig;
  ExposureSummary left, right;
  InertialSummary inertial;
  /// Depths that the pictures show (2nd to 98th percentile over a few frames); 0 when unknown.
  double near_m = 0.0;
  double far_m = 0.0;
  std::vector<SuitabilitySummary> suitability;  ///< the chosen configuration first

  bool scannable() const { return problems.empty(); }
};

/// Reads the whole recording and judges it. `config`: field, thesis, room or a file. Trouble with
/// the file is among the problems; throws ConfigurationError for a bad configuration only.
BagInspection inspectBag(const std::string& path, const std::string& config, int threads,
                         const Topics& topics = {});

/// For a person, about thirty lines.
std::string toText(const BagInspection& inspection);
/// The same, machine readable. Keys stay stable.
std::string toJson(const BagInspection& inspection);

}  // namespace scanner::bridge
