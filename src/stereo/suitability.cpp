#include "scanner/stereo/suitability.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "stereo/coarse.h"

namespace scanner::stereo {
namespace {

constexpr int kReducedWidth = 320;
/// Least size, coarse px, of a piece of surface that counts.
constexpr int kMinPiece = 30;
constexpr double kMinMatched = 0.03;

/// All disparities of a pair at reduced size, in pixels of the full size, ascending.
std::vector<double> roughDisparities(const RectifiedPair& pair, int threads, std::size_t* pixels) {
  const int factor = std::max(1, (pair.left_gray.cols + kReducedWidth / 2) / kReducedWidth);
  const CoarsePair coarse = coarsePair(pair, factor);
  const CoarseMatch match = coarseMatch(coarse, 0, coarse.left.cols / 2, kMinPiece, threads);
  std::vector<double> values;
  values.reserve(match.found);
  for (auto it = match.disparity.begin<short>(); it != match.disparity.end<short>(); ++it) {
    if (*it != kNoCoarseDisparity) values.push_back(static_cast<double>(*it * factor));
  }
  std::sort(values.begin(), values.end());
  *pixels = match.pixels;
  return values;
}

std::string format(const char* pattern, double a, double b, double c, double d) {
  char line[200];
  // cppcheck-suppress wrongPrintfScanfArgNum ; the pattern is the caller's
  std::snprintf(line, sizeof(line), pattern, a, b, c, d);
  return line;
}

}  // namespace

double depthSigma(double depth_m, double focal_px, double baseline_m, double sigma_px) {
  return depth_m * depth_m * sigma_px / (focal_px * baseline_m);
}

double depthForSigma(double sigma_m, double focal_px, double baseline_m, double sigma_px) {
  return std::sqrt(sigma_m * focal_px * baseline_m / sigma_px);
}

DepthRange workingRange(const StereoCalibration& calibration, const StereoOptions& options) {
  const double fb = calibration.focalLength() * calibration.baseline();
  const double offset = calibration.disparityOffset();
  const double nearest = options.matcher.max_disparity_px - offset;
  const double farthest = options.matcher.min_disparity_px - offset;
  DepthRange range{options.depth.min_depth_m, options.depth.max_depth_m};
  if (nearest <= 0.0) return {options.depth.max_depth_m, options.depth.min_depth_m};
  range.min_depth_m = std::max(range.min_depth_m, fb / nearest);
  if (farthest > 0.0) range.max_depth_m = std::min(range.max_depth_m, fb / farthest);
  return range;
}

DisparityRange disparityRange(const StereoCalibration& calibration, const DepthRange& depths) {
  if (!(depths.min_depth_m > 0.0) || !(depths.max_depth_m >= depths.min_depth_m)) {
    throw ConfigurationError("disparityRange: depths must be positive and in order");
  }
  const double fb = calibration.focalLength() * calibration.baseline();
  const double offset = calibration.disparityOffset();
  return {std::floor(fb / depths.max_depth_m + offset),
          std::ceil(fb / depths.min_depth_m + offset)};
}

Result<DisparityRange> measureDisparities(const RectifiedPair& pair, int threads) {
  std::size_t pixels = 0;
  const std::vector<double> values = roughDisparities(pair, threads, &pixels);
  if (static_cast<double>(values.size()) < kMinMatched * static_cast<double>(pixels)) {
    return Status(StatusCode::kNotEnoughData,
                  "the eyes of this pair share too little texture to measure disparities");
  }
  const auto quantile = [&](double q) {
    return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
  };
  return DisparityRange{quantile(0.02), quantile(0.98)};
}

std::string describeMismatch(const RectifiedPair& pair, const StereoCalibration& calibration,
                             const StereoOptions& options, int threads) {
  std::size_t pixels = 0;
  const std::vector<double> values = roughDisparities(pair, threads, &pixels);
  if (static_cast<double>(values.size()) < kMinMatched * static_cast<double>(pixels)) {
    return "the eyes of this pair share too little texture to measure disparities";
  }
  const double low = options.matcher.min_disparity_px, high = options.matcher.max_disparity_px;
  const auto begin = std::lower_bound(values.begin(), values.end(), low);
  const auto end = std::upper_bound(values.begin(), values.end(), high);
  const double inside = static_cast<double>(end - begin) / static_cast<double>(values.size());
  if (inside >= 0.25) return {};
  const double shown_low = values[values.size() / 50];
  const double shown_high = values[values.size() - 1 - values.size() / 50];
  const DepthRange depths = workingRange(calibration, options);
  return format("%.0f %% of what the pair shows lies in the searched range: ", 100.0 * inside, 0, 0,
                0) +
         format("disparities are %.0f to %.0f px, searched are %.0f to %.0f px ", shown_low,
                shown_high, low, high) +
         format("(%.2f to %.2f m)", depths.min_depth_m, depths.max_depth_m, 0, 0);
}

}  // namespace scanner::stereo
