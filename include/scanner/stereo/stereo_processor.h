#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <string>

#include "scanner/core/camera.h"
#include "scanner/core/cloud.h"
#include "scanner/core/image.h"
#include "scanner/core/status.h"
#include "scanner/stereo/condition.h"
#include "scanner/stereo/match.h"
#include "scanner/stereo/options.h"
#include "scanner/stereo/range_tracker.h"
#include "scanner/stereo/rectify.h"
#include "scanner/stereo/trouble.h"

namespace scanner::stereo {

struct StereoStatistics {
  MatchStatistics match;
  std::size_t points = 0;      ///< pixels with a finite point
  std::size_t normals = 0;     ///< pixels with a finite normal
  double density = 0.0;        ///< points / pixels
  double mean_sigma_px = 0.0;  ///< of the disparity, over the points; 0 without points
  double mean_sigma_m = 0.0;   ///< of the depth, likewise
  double rectify_s = 0.0, match_s = 0.0, triangulate_s = 0.0, normals_s = 0.0;  ///< wall time
};

/// The stereo stage from raw pair to organised cloud with colour, sigma and normals. Immutable
/// after construction; process() may be called from several threads.
class StereoProcessor {
 public:
  struct Output {
    RectifiedPair rectified;
    DisparityImage disparity;
    OrganizedCloud cloud;  ///< rectified left optical frame
    StereoStatistics statistics;
    /// What is wrong with the pictures. Looked for in what brightness shows of every frame, and
    /// thoroughly where few pixels match. A hopeless pair has no disparity at all.
    Trouble trouble;
  };

  /// Throws ConfigurationError for a calibration or options that cannot be worked with (among them
  /// a disparity range wider than the image). threads >= 1.
  StereoProcessor(const StereoCalibration& calibration, const StereoOptions& options, int threads);

  /// Fails as Rectifier::rectify does. A pair without any match is ok: a cloud of NaN, density 0,
  /// and `trouble` says why. `tracker`, of the sequence that the frame belongs to, chooses the
  /// disparities that are searched; without one all that are configured are.
  Result<Output> process(const StereoFrame& frame, RangeTracker* tracker = nullptr) const;

  /// For one sequence of frames.
  RangeTracker makeRangeTracker() const;

  const StereoCalibration& calibration() const { return rectifier_.calibration(); }
  const StereoOptions& options() const { return options_; }

 private:
  DisparityImage search(const RectifiedPair& pair, RangeTracker* tracker,
                        MatchStatistics& statistics) const;

  Rectifier rectifier_;
  StereoOptions options_;
  int threads_;
};

/// The conditioned view that registration takes: points with a finite normal, conditioned in the
/// world frame, given in base_link. `T_base_optical` is the pose of the *rectified* left optical
/// frame (Rig::rectifiedCameraPose); of `T_world_base` only the orientation matters (world z up).
/// kInvalidInput for a pose that is not finite, kNotEnoughData when fewer than
/// `options.min_points` remain. `statistics` may be null; it is filled in either case of data.
Result<View> makeView(int index, const OrganizedCloud& cloud,
                      const Eigen::Isometry3d& T_base_optical,
                      const Eigen::Isometry3d& T_world_base, const ConditioningOptions& options,
                      ConditioningStatistics* statistics);

}  // namespace scanner::stereo
