#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "scanner/core/status.h"

namespace scanner::bridge {

struct EurocOptions {
  /// Keep inertial samples up to the last image + margin (all earlier ones are kept: they help the
  /// filters to settle), and truth from first image - margin to last image + margin.
  bool limit_to_images = true;
  double margin_s = 1.0;
};

struct EurocSummary {
  std::size_t pairs = 0;
  std::size_t unpaired =
      0;  ///< images of either camera without a partner of the same stamp: left out
  std::size_t imu_samples = 0;
  std::size_t truth_poses = 0;   ///< 0 when the folder has no state_groundtruth_estimate0
  double focal_length_px = 0.0;  ///< after rectification
  double baseline_m = 0.0;
};

/// Writes an ASL/EuRoC folder (Burri et al., IJRR 2016; `directory` is mav0 or holds it) as a bag
/// with the scanner's topics: raw mono images, camera_info with K, D and a rectification from the
/// sensors' T_BS (cv::stereoRectify, alpha 0), inertial samples without orientation, /tf_static and
/// /ground_truth/pose. base_link is the inertial sensor's frame. Recorded time = stamp; the same
/// input gives the same bytes. The bag is written beside its place and renamed when whole.
///
/// kIoError or kInvalidInput in one line naming file and line. `progress(done, total)` is called
/// per pair and may return false to stop, which leaves no bag (kIoError "interrupted").
Result<EurocSummary> importEuroc(
    const std::string& directory, const std::string& bag_path, const EurocOptions& options = {},
    const std::function<bool(std::size_t, std::size_t)>& progress = {});

}  // namespace scanner::bridge
