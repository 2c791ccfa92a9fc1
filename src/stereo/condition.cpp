#include "scanner/stereo/condition.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace scanner::stereo {
namespace {

/// With fewer points there is no distribution to speak of.
constexpr std::size_t kMinPoints = 3;
/// Guards against a stray point kilometres away.
constexpr double kMaxBins = 1e6;

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

/// Of the sample (n - 1).
double standardDeviation(const std::vector<double>& values) {
  if (values.size() < 2) return 0.0;
  const double n = static_cast<double>(values.size());
  double mean = 0.0, squares = 0.0;
  for (const double v : values) mean += v / n;
  for (const double v : values) squares += (v - mean) * (v - mean);
  return std::sqrt(squares / (n - 1.0));
}

struct Ground {
  double height_m;
  double half_width_m;
};

/// Eq. 4.2-4.4 on the heights of the finite points.
std::optional<Ground> findGround(const std::vector<double>& z, const ConditioningOptions& o) {
  const auto [low, high] = std::minmax_element(z.begin(), z.end());
  const double bottom = *low, range = *high - *low;
  const double bins = std::ceil(range / o.ground_resolution_m);  // eq. 4.2
  if (!(bins >= 2.0) || bins > kMaxBins) return std::nullopt;
  const auto n = static_cast<std::size_t>(bins);
  const double resolution = range / bins;  // eq. 4.3
  std::vector<double> counts(n, 0.0);
  for (const double value : z) {
    const auto bin = static_cast<std::size_t>((value - bottom) / resolution);
    counts[std::min(bin, n - 1)] += 1.0;
  }
  const double threshold = median(counts) + o.ground_sigmas * standardDeviation(counts);
  const auto candidate = std::find_if(counts.begin(), counts.end(),
                                      [&](double count) { return count > threshold; });  // eq. 4.4
  if (candidate == counts.end()) return std::nullopt;
  const auto first = static_cast<double>(candidate - counts.begin());
  if (!o.ground_spans_bins) return Ground{bottom + (first + 0.5) * resolution, resolution};
  const auto end =
      std::find_if(candidate, counts.end(), [&](double count) { return !(count > threshold); });
  const auto width = static_cast<double>(end - candidate);
  return Ground{bottom + (first + 0.5 * width) * resolution, (0.5 * width + 0.5) * resolution};
}

/// Eq. 4.6 for one axis.
std::vector<bool> outliers(const std::vector<double>& values, double sigmas) {
  std::vector<bool> out(values.size(), false);
  const double centre = median(values);
  const double limit = sigmas * standardDeviation(values);
  if (!(limit > 0.0)) return out;  // all the same: nobody is further out than the others
  for (std::size_t i = 0; i < values.size(); ++i) out[i] = std::abs(values[i] - centre) >= limit;
  return out;
}

std::size_t count(const std::vector<bool>& flags) {
  return static_cast<std::size_t>(std::count(flags.begin(), flags.end(), true));
}

/// Eq. 4.5. Empty when there is no ground, or what looks like it is the subject.
std::vector<bool> groundPoints(const std::vector<double>& z, const ConditioningOptions& options,
                               ConditioningStatistics& s) {
  const std::optional<Ground> ground = findGround(z, options);
  if (!ground) return {};
  std::vector<bool> is_ground(z.size());
  for (std::size_t i = 0; i < z.size(); ++i) {
    is_ground[i] = std::abs(z[i] - ground->height_m) <= ground->half_width_m;
  }
  const std::size_t points = count(is_ground);
  if (static_cast<double>(points) > options.ground_max_share * static_cast<double>(z.size())) {
    return {};
  }
  s.ground_found = true;
  s.ground_height_m = ground->height_m;
  s.ground_half_width_m = ground->half_width_m;
  s.ground = points;
  return is_ground;
}

}  // namespace

Conditioned condition(const PointCloud& cloud_in_world, const ConditioningOptions& options) {
  validate(options);
  Conditioned result;
  ConditioningStatistics& s = result.statistics;
  s.points = cloud_in_world.size();
  std::vector<std::size_t> finite;
  std::vector<double> x, y, z;
  for (std::size_t i = 0; i < cloud_in_world.size(); ++i) {
    const Eigen::Vector3f& p = cloud_in_world.points[i];
    if (!p.allFinite()) continue;
    finite.push_back(i);
    x.push_back(static_cast<double>(p.x()));
    y.push_back(static_cast<double>(p.y()));
    z.push_back(static_cast<double>(p.z()));
  }
  s.not_finite = s.points - finite.size();
  std::vector<bool> ground, far_x, far_y;
  if (finite.size() >= kMinPoints) {
    if (options.remove_ground) ground = groundPoints(z, options, s);
    if (options.remove_outliers) {
      far_x = outliers(x, options.outlier_sigmas);
      far_y = outliers(y, options.outlier_sigmas);
      s.outliers_x = count(far_x);
      s.outliers_y = count(far_y);
    }
  }
  const auto flagged = [](const std::vector<bool>& flags, std::size_t i) {
    return !flags.empty() && flags[i];
  };
  for (std::size_t i = 0; i < finite.size(); ++i) {
    if (flagged(ground, i) || flagged(far_x, i) || flagged(far_y, i)) continue;  // eq. 4.7
    result.kept.push_back(finite[i]);
  }
  s.kept = result.kept.size();
  return result;
}

}  // namespace scanner::stereo
