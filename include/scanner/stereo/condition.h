#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "scanner/core/cloud.h"
#include "scanner/stereo/options.h"

namespace scanner::stereo {

/// What was removed. A point may count as ground and as outlier at once (union, thesis eq. 4.7).
struct ConditioningStatistics {
  std::size_t points = 0;
  std::size_t not_finite = 0;
  bool ground_found = false;
  double ground_height_m = std::numeric_limits<double>::quiet_NaN();      ///< centre of its bin
  double ground_half_width_m = std::numeric_limits<double>::quiet_NaN();  ///< r of eq. 4.3
  std::size_t ground = 0;
  std::size_t outliers_x = 0;
  std::size_t outliers_y = 0;
  std::size_t kept = 0;
};

struct Conditioned {
  std::vector<std::size_t> kept;  ///< indices into the cloud, ascending
  ConditioningStatistics statistics;
};

/// Finds ground and outliers of one view (thesis eq. 4.2-4.7). `cloud_in_world`: z up, metres; only
/// the orientation and scale of the frame matter. NaN points are never kept; an empty cloud keeps
/// nothing. A bin that holds more than `ground_max_share` of the points is the subject (a
/// horizontal surface being scanned), not ground, and stays.
Conditioned condition(const PointCloud& cloud_in_world, const ConditioningOptions& options);

}  // namespace scanner::stereo
