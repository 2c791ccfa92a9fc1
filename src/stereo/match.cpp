#include "scanner/stereo/match.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

#include "scanner/core/parallel.h"
#include "scanner/stereo/fill.h"
#include "stereo/matcher.h"
#include "stereo/refine.h"
#include "stereo/validate.h"

namespace scanner::stereo {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
/// Uniform error of a whole-pixel disparity.
constexpr double kWholePixelSigma = 0.2886751345948129;
/// A flake is smaller than the smallest surface by this factor.
constexpr int kFlakeShare = 4;
/// Typical error of the fit of the cost.
constexpr double kCostFitSigma = 0.15;

void requireImages(const RectifiedPair& pair) {
  const cv::Size size = pair.left_gray.size();
  const auto mask_ok = [&](const cv::Mat& mask) {
    return mask.empty() || (mask.type() == CV_8UC1 && mask.size() == size);
  };
  if (pair.left_gray.empty() || pair.left_gray.type() != CV_8UC1 ||
      pair.right_gray.type() != CV_8UC1 || pair.right_gray.size() != size ||
      !mask_ok(pair.left_valid) || !mask_ok(pair.right_valid)) {
    throw std::invalid_argument("match: needs two CV_8UC1 images of equal size");
  }
}

void requireFit(const MatcherOptions& options, const cv::Size& size) {
  const int window = options.method == MatchMethod::kBlock
                         ? std::max(options.block.window_px, options.block.edge_mask_px)
                         : options.semi_global.window_px;
  if (window >= std::min(size.width, size.height)) {
    throw ConfigurationError("stereo.matcher: a window of " + std::to_string(window) +
                             " px does not fit into an image of " + std::to_string(size.width) +
                             "x" + std::to_string(size.height));
  }
  if (options.max_disparity_px < size.width) return;
  throw ConfigurationError(
      "stereo.matcher.max_disparity_px = " + std::to_string(options.max_disparity_px) +
      " must be below the image's width " + std::to_string(size.width));
}

std::unique_ptr<Matcher> makeMatcher(const MatcherOptions& options) {
  return options.method == MatchMethod::kBlock ? makeBlockMatcher(options)
                                               : makeSemiGlobalMatcher(options);
}

cv::Mat lowPassed(const cv::Mat& image) {
  cv::Mat out;
  cv::GaussianBlur(image, out, cv::Size(3, 3), 0.0);  // the 3x3 binomial
  return out;
}

cv::Mat refinementImage(const cv::Mat& gray, double sigma_px) {
  cv::Mat out;
  gray.convertTo(out, CV_32F);
  if (sigma_px <= 0.0) return out;
  const int size = 2 * static_cast<int>(std::ceil(3.0 * sigma_px)) + 1;
  cv::GaussianBlur(out, out, cv::Size(size, size), sigma_px);
  return out;
}

void roundToPixels(cv::Mat& disparity) {
  for (int y = 0; y < disparity.rows; ++y) {
    float* row = disparity.ptr<float>(y);
    for (int x = 0; x < disparity.cols; ++x) row[x] = std::round(row[x]);
  }
}

/// The fraction of a pixel and its standard deviation. Returns the number of pixels given up.
std::size_t refine(const RectifiedPair& pair, const MatcherOptions& options, int threads,
                   cv::Mat& disparity, cv::Mat& sigma) {
  const RefinementOptions& r = options.refinement;
  if (r.subpixel_refinement == SubpixelRefinement::kGradient) {
    const double share = options.validation.residual ? options.validation.max_residual_share
                                                     : std::numeric_limits<double>::infinity();
    return refineByGradient(refinementImage(pair.left_gray, r.prefilter_sigma_px),
                            refinementImage(pair.right_gray, r.prefilter_sigma_px),
                            pair.right_valid, r, share, threads, disparity, sigma);
  }
  const bool whole = r.subpixel_refinement == SubpixelRefinement::kNone;
  if (whole) roundToPixels(disparity);
  const double own = whole ? kWholePixelSigma : kCostFitSigma;
  sigma = cv::Mat(disparity.size(), CV_32FC1, cv::Scalar(std::hypot(own, r.floor_px)));
  return 0;
}

}  // namespace

DisparityImage match(const RectifiedPair& pair, const MatcherOptions& options, int threads,
                     MatchStatistics* statistics) {
  validate(options);
  requireImages(pair);
  requireFit(options, pair.left_gray.size());
  const ValidationOptions& v = options.validation;
  const bool low_pass = options.method == MatchMethod::kBlock && options.block.low_pass;
  const cv::Mat left = low_pass ? lowPassed(pair.left_gray) : pair.left_gray;
  const cv::Mat right = low_pass ? lowPassed(pair.right_gray) : pair.right_gray;

  MatchStatistics counts;
  counts.pixels = pair.left_gray.total();
  const auto valid = [](const cv::Mat& d) {
    return static_cast<std::size_t>(cv::countNonZero(d == d));
  };
  const DisparitySearch search{options.min_disparity_px, options.max_disparity_px};
  const std::unique_ptr<Matcher> matcher = makeMatcher(options);
  const Candidates found = matcher->match(left, right, search, threads);
  counts.working_memory_bytes = matcher->workingMemory(left.size(), search, threads);
  cv::Mat disparity = found.left;
  counts.untextured = found.untextured;
  counts.ambiguous = found.ambiguous;
  counts.matched = valid(disparity);
  const auto remove_outside = [&] {
    return removeOutside(search.min_px, search.max_px, 0, pair.left_valid, pair.right_valid,
                         disparity, threads);
  };
  counts.outside = remove_outside();
  if (v.back_and_forth) {
    counts.back_and_forth =
        removeInconsistent(found.right, v.back_and_forth_tolerance_px, disparity, threads);
  }
  if (v.surface) {
    counts.surface = removeSmallSurfaces(v.surface_step_px, v.surface_size_px, disparity, threads);
  }
  cv::Mat sigma;
  counts.refinement = refine(pair, options, threads, disparity, sigma);
  counts.outside += remove_outside();
  // Only the gradient gives every pixel a sigma of its own.
  if (v.precision && options.refinement.subpixel_refinement == SubpixelRefinement::kGradient) {
    counts.precision = removeImprecise(sigma, v.max_sigma_px, disparity, threads);
  }
  // Again, for the flakes that the tests since have cut off; they passed as parts of large pieces.
  if (v.surface) {
    counts.surface +=
        removeSmallSurfaces(v.surface_step_px, v.surface_size_px / kFlakeShare, disparity, threads);
  }
  sigma.setTo(kNan, ~(disparity == disparity));  // OpenCV: NaN != NaN is not always true
  if (options.interpolation.reach_px > 0.0) {
    const cv::Mat& guide = pair.left_color.empty() ? pair.left_gray : pair.left_color;
    counts.interpolated = interpolate(guide, options.interpolation, threads, disparity, sigma);
    if (!pair.left_valid.empty()) {
      disparity.setTo(kNan, pair.left_valid == 0);
      sigma.setTo(kNan, pair.left_valid == 0);
    }
  }
  counts.valid = valid(disparity);
  if (statistics != nullptr) *statistics = counts;
  return {pair.stamp, disparity, sigma, static_cast<double>(options.min_disparity_px),
          static_cast<double>(options.max_disparity_px)};
}

}  // namespace scanner::stereo
