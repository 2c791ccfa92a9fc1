#pragma once

#include <string>

#include "scanner/core/se3.h"
#include "scanner/core/status.h"

namespace scanner {

/// TUM format: `stamp tx ty tz qx qy qz qw` a line, stamp in seconds with nine decimals, '#' starts
/// a comment. Written atomically.
Status writeTum(const std::string& path, const Trajectory& trajectory);
/// Names file and line of the first thing that is wrong (NaN, wrong count, time going backwards).
Result<Trajectory> readTum(const std::string& path);

/// Pose at `stamp` by interpolation; kOutOfRange outside the trajectory, or in a gap longer than
/// `max_gap`.
Result<Eigen::Isometry3d> poseAt(const Trajectory& trajectory, Time stamp, Duration max_gap);

}  // namespace scanner
