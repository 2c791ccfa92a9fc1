#include "stereo/coarse.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "stereo/matcher.h"

namespace scanner::stereo {
namespace {

/// Side of the window over which the eyes must look alike.
constexpr int kWindow = 7;
/// Of those, this many pixels must have a disparity.
constexpr int kMinWindowPixels = kWindow * kWindow / 2;
/// Least squared correlation of the two windows (0.8^2), and least variance of either, grey levels
/// squared: below it, a window is flat and looks like any other.
constexpr double kMinCorrelation2 = 0.64;
constexpr double kMinVariance = 4.0;
/// Largest disagreement of the two directions, coarse px.
constexpr int kTolerance = 1;

/// With so many columns more on the left and right, the border replicated.
cv::Mat widened(const cv::Mat& image, int left, int right) {
  cv::Mat out;
  cv::copyMakeBorder(image, out, 0, 0, left, right, cv::BORDER_REPLICATE);
  return out;
}

MatcherOptions coarseOptions() {
  MatcherOptions options;
  options.method = MatchMethod::kSemiGlobal;
  options.semi_global = SemiGlobalOptions();
  options.semi_global.window_px = 5;
  // The eyes may be exposed differently.
  options.semi_global.gray_limit = 0;
  options.validation.texture_threshold = 2.0;
  options.validation.uniqueness_percent = 5.0;
  return options;
}

/// Sums for the correlation of the window about each pixel with its counterpart.
struct Windows {
  cv::Mat left, right, left2, right2, product, count;  ///< CV_32SC1
};

cv::Mat windowSum(const cv::Mat& image) {
  cv::Mat out;
  cv::boxFilter(image, out, CV_32S, cv::Size(kWindow, kWindow), cv::Point(-1, -1), false,
                cv::BORDER_REPLICATE);
  return out;
}

/// Removes disparities about which the left picture and the warped right one do not look alike.
/// Smoothness finds a disparity for every pair of pictures, related or not; this asks whether they
/// really correspond.
void removeUnlike(const cv::Mat& left, const cv::Mat& right, cv::Mat& disparity) {
  // Windows are compared on pixels that have a disparity; elsewhere both are 0.
  cv::Mat l(left.size(), CV_16UC1, cv::Scalar(0)), r = l.clone(), n = l.clone(), ll = l.clone(),
                                                   rr = l.clone(), lr = l.clone();
  for (int y = 0; y < left.rows; ++y) {
    const short* d = disparity.ptr<short>(y);
    for (int x = 0; x < left.cols; ++x) {
      const int other = x - d[x];
      if (d[x] == kNoCoarseDisparity || other < 0 || other >= left.cols) continue;
      const int a = left.at<std::uint8_t>(y, x), b = right.at<std::uint8_t>(y, other);
      l.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(a);
      r.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(b);
      n.at<std::uint16_t>(y, x) = 1;
      ll.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(a * a);
      rr.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(b * b);
      lr.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(a * b);
    }
  }
  const Windows w{windowSum(l),  windowSum(r),  windowSum(ll),
                  windowSum(rr), windowSum(lr), windowSum(n)};
  for (int y = 0; y < left.rows; ++y) {
    for (int x = 0; x < left.cols; ++x) {
      // n^2 times variances and covariance; below 2^53, so exact in double.
      const double count = w.count.at<int>(y, x);
      const double a = w.left.at<int>(y, x), b = w.right.at<int>(y, x);
      const double aa = count * w.left2.at<int>(y, x) - a * a;
      const double bb = count * w.right2.at<int>(y, x) - b * b;
      const double ab = count * w.product.at<int>(y, x) - a * b;
      const double least = kMinVariance * count * count;
      const bool alike = count >= kMinWindowPixels && aa >= least && bb >= least / 4.0 &&
                         ab > 0.0 && ab * ab >= kMinCorrelation2 * aa * bb;
      if (!alike) disparity.at<short>(y, x) = kNoCoarseDisparity;
    }
  }
}

}  // namespace

cv::Mat boxReduced(const cv::Mat& image, int factor) {
  if (factor <= 1 || image.empty()) return image;
  cv::Mat out(image.rows / factor, image.cols / factor, CV_8UC1);
  const auto area = static_cast<unsigned>(factor * factor);
  const auto width = static_cast<std::size_t>(factor);
  std::vector<unsigned> sums(static_cast<std::size_t>(image.cols));
  for (int y = 0; y < out.rows; ++y) {
    std::fill(sums.begin(), sums.end(), 0U);
    for (int i = 0; i < factor; ++i) {
      const std::uint8_t* row = image.ptr(y * factor + i);
      for (std::size_t x = 0; x < sums.size(); ++x) sums[x] += row[x];
    }
    std::uint8_t* to = out.ptr(y);
    for (int x = 0; x < out.cols; ++x) {
      const std::size_t begin = static_cast<std::size_t>(x) * width;
      unsigned sum = area / 2;
      for (std::size_t i = 0; i < width; ++i) sum += sums[begin + i];
      to[x] = static_cast<std::uint8_t>(sum / area);
    }
  }
  return out;
}

std::size_t texturedPixels(const cv::Mat& gray) {
  cv::Mat wide, squares;
  gray.convertTo(wide, CV_16U);
  cv::multiply(wide, wide, squares);
  const cv::Mat sum = windowSum(wide), sum2 = windowSum(squares);
  constexpr int kArea = kWindow * kWindow;
  constexpr double kLeast = kMinVariance * kArea * kArea;
  std::size_t count = 0;
  for (int y = 0; y < gray.rows; ++y) {
    const int* a = sum.ptr<int>(y);
    const int* aa = sum2.ptr<int>(y);
    for (int x = 0; x < gray.cols; ++x) {
      const double mean = a[x];
      count += static_cast<double>(kArea) * aa[x] - mean * mean >= kLeast ? 1U : 0U;
    }
  }
  return count;
}

CoarsePair coarsePair(const RectifiedPair& pair, int factor) {
  CoarsePair out;
  out.factor = factor;
  out.left = boxReduced(pair.left_gray, factor);
  out.right = boxReduced(pair.right_gray, factor);
  const auto mask = [&](const cv::Mat& valid) -> cv::Mat {
    return valid.empty() ? cv::Mat() : cv::Mat(boxReduced(valid != 0, factor) == 255);
  };
  out.left_valid = mask(pair.left_valid);
  out.right_valid = mask(pair.right_valid);
  return out;
}

CoarsePair withRowsMoved(const CoarsePair& pair, int rows) {
  CoarsePair out = pair;
  out.right = pair.right.clone();
  // What comes in from outside is not valid.
  out.right_valid = cv::Mat(pair.right.size(), CV_8UC1, cv::Scalar(0));
  for (int y = 0; y < out.right.rows; ++y) {
    const int from = y + rows;
    if (from < 0 || from >= out.right.rows) continue;
    pair.right.row(from).copyTo(out.right.row(y));
    if (pair.right_valid.empty()) {
      out.right_valid.row(y).setTo(255);
    } else {
      pair.right_valid.row(from).copyTo(out.right_valid.row(y));
    }
  }
  return out;
}

CoarseMatch coarseMatch(const CoarsePair& pair, int min_px, int max_px, int min_piece,
                        int threads) {
  // The matcher knows no negative disparities: a left picture that is moved to the right has
  // d + shift instead.
  const int shift = std::max(0, -min_px), width = pair.left.cols;
  CoarseMatch out;
  out.pixels = pair.left.total();
  out.disparity = cv::Mat(pair.left.size(), CV_16SC1, cv::Scalar(kNoCoarseDisparity));
  const DisparitySearch search{min_px + shift, std::min(max_px, width - 1) + shift};
  if (search.max_px <= search.min_px || std::min(pair.left.rows, width) <= kWindow) return out;
  const Candidates found =
      makeSemiGlobalMatcher(coarseOptions())
          ->match(widened(pair.left, shift, 0), widened(pair.right, 0, shift), search, threads);
  for (int y = 0; y < pair.left.rows; ++y) {
    const float* d = found.left.ptr<float>(y) + shift;
    const short* back = found.right.ptr<short>(y);
    short* to = out.disparity.ptr<short>(y);
    for (int x = 0; x < width; ++x) {
      if (d[x] != d[x]) continue;
      const int whole = static_cast<int>(std::lround(d[x]));
      const int other = x + shift - whole;
      if (other < 0 || other >= width) continue;
      if (back[other] == kNoDisparity || std::abs(back[other] - whole) > kTolerance) continue;
      if (!pair.left_valid.empty() && pair.left_valid.at<std::uint8_t>(y, x) == 0) continue;
      if (!pair.right_valid.empty() && pair.right_valid.at<std::uint8_t>(y, other) == 0) continue;
      to[x] = static_cast<short>(whole - shift);
    }
  }
  removeUnlike(pair.left, pair.right, out.disparity);
  cv::filterSpeckles(out.disparity, kNoCoarseDisparity, min_piece - 1, kTolerance);
  out.found = static_cast<std::size_t>(cv::countNonZero(out.disparity != kNoCoarseDisparity));
  return out;
}

}  // namespace scanner::stereo
