#include "scanner/stereo/suitability.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "scanner/stereo/match.h"

namespace scanner::stereo {
namespace {

constexpr int kReducedWidth = 320;
constexpr double kMinMatched = 0.03;
constexpr double kDark = 12.0, kBright = 250.0;
constexpr double kMinContrast = 3.0;
constexpr double kMaxBrightnessRatio = 4.0;

cv::Mat reduced(const cv::Mat& image, double scale, int interpolation) {
  cv::Mat out;
  if (!image.empty()) cv::resize(image, out, cv::Size(), scale, scale, interpolation);
  return out;
}

/// All disparities of a pair at reduced size, in pixels of the full size, ascending.
std::vector<double> roughDisparities(const RectifiedPair& pair, int threads, std::size_t* pixels) {
  const double scale =
      std::min(1.0, static_cast<double>(kReducedWidth) / std::max(1, pair.left_gray.cols));
  RectifiedPair small;
  small.left_gray = reduced(pair.left_gray, scale, cv::INTER_AREA);
  small.right_gray = reduced(pair.right_gray, scale, cv::INTER_AREA);
  small.left_valid = reduced(pair.left_valid, scale, cv::INTER_NEAREST);
  small.right_valid = reduced(pair.right_valid, scale, cv::INTER_NEAREST);
  MatcherOptions options;
  options.method = MatchMethod::kSemiGlobal;
  options.min_disparity_px = 0;
  options.max_disparity_px = std::max(1, small.left_gray.cols / 2 - 1);
  options.validation.uniqueness_percent = 10.0;
  options.validation.texture_threshold = 2.0;
  options.validation.surface_size_px = 60;
  const cv::Mat disparity = match(small, options, threads).disparity_px;
  std::vector<double> values;
  for (auto it = disparity.begin<float>(); it != disparity.end<float>(); ++it) {
    if (!std::isnan(*it)) values.push_back(static_cast<double>(*it) / scale);
  }
  std::sort(values.begin(), values.end());
  *pixels = disparity.total();
  return values;
}

struct Brightness {
  double mean, contrast, saturated;
};

Brightness brightness(const cv::Mat& gray) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(gray, mean, deviation);
  const double share = static_cast<double>(cv::countNonZero(gray >= kBright)) /
                       static_cast<double>(std::max<std::size_t>(1, gray.total()));
  return {mean[0], deviation[0], share};
}

std::string describeEye(const Brightness& b) {
  if (b.mean < kDark && b.contrast < kDark) return "is black (lens cap, or exposure too short)";
  if (b.saturated > 0.5) return "is saturated (exposure too long)";
  if (b.contrast < kMinContrast) return "shows nothing (covered, or no texture)";
  return {};
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

std::string describeTrouble(const RectifiedPair& pair, int threads) {
  if (pair.left_gray.empty() || pair.right_gray.empty()) return "an image is empty";
  const Brightness left = brightness(pair.left_gray), right = brightness(pair.right_gray);
  const std::string left_trouble = describeEye(left), right_trouble = describeEye(right);
  if (!left_trouble.empty() && !right_trouble.empty()) return "both images: left " + left_trouble;
  if (!left_trouble.empty()) return "left image " + left_trouble;
  if (!right_trouble.empty()) return "right image " + right_trouble;
  const double ratio =
      std::max(left.mean, right.mean) / std::max(1.0, std::min(left.mean, right.mean));
  if (ratio > kMaxBrightnessRatio) {
    return std::string(left.mean < right.mean ? "left" : "right") +
           " image is much darker than the other";
  }
  std::size_t pixels = 0;
  const std::size_t as_given = roughDisparities(pair, threads, &pixels).size();
  RectifiedPair swapped;
  swapped.left_gray = pair.right_gray;
  swapped.right_gray = pair.left_gray;
  const std::size_t exchanged = roughDisparities(swapped, threads, &pixels).size();
  const double share = static_cast<double>(pixels) * kMinMatched;
  if (static_cast<double>(exchanged) > share && exchanged > 3 * as_given) {
    return "left and right image seem to be swapped";
  }
  if (static_cast<double>(as_given) < share) {
    return "the two images do not match (not rectified, not synchronised, or no texture)";
  }
  return {};
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
