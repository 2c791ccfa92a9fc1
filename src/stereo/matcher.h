#pragma once

#include <cstddef>
#include <memory>
#include <opencv2/core.hpp>

#include "scanner/stereo/options.h"

namespace scanner::stereo {

/// Whole disparities that are searched, both ends included; 0 <= min_px <= max_px < image width.
struct DisparitySearch {
  int min_px = 0;
  int max_px = 0;
  int count() const { return max_px - min_px + 1; }
};

/// In `Candidates::right`: no disparity.
constexpr short kNoDisparity = -1;

/// What a matcher finds, before the tests that every method shares (validate.h) and refinement.
struct Candidates {
  cv::Mat left;   ///< CV_32FC1, px, fraction by a fit of the cost; NaN: none, untextured, ambiguous
  cv::Mat right;  ///< CV_16SC1, best whole disparity of each *right* pixel, or kNoDisparity
  std::size_t untextured = 0;  ///< left pixels that the texture test removed
  std::size_t ambiguous = 0;   ///< left pixels that the uniqueness test removed
};

/// A way to find the disparity of every pixel of a rectified pair.
///
/// Left pixel x and disparity d mean right pixel x - d on the same row. Columns whose range leaves
/// the right image in part keep the rest of it; a pixel for which no disparity of the range is
/// inside has none. Immutable; match() may be called from several threads. Same bytes for any
/// `threads` (>= 1) and any instruction set.
class Matcher {
 public:
  virtual ~Matcher() = default;
  /// Both images CV_8UC1, of equal size, low-passed where the options say so.
  virtual Candidates match(const cv::Mat& left, const cv::Mat& right, DisparitySearch search,
                           int threads) const = 0;
  /// Bytes that match() allocates at most besides its result.
  virtual std::size_t workingMemory(cv::Size image, DisparitySearch search, int threads) const = 0;
};

/// Sum of absolute differences over a window (thesis table 3.1). Reads `block`, and `texture*`,
/// `uniqueness*` of `validation`.
std::unique_ptr<Matcher> makeBlockMatcher(const MatcherOptions& options);

/// Semi-global matching (Hirschmueller 2008). Reads `semi_global`, and `texture*`, `uniqueness*` of
/// `validation`.
std::unique_ptr<Matcher> makeSemiGlobalMatcher(const MatcherOptions& options);

}  // namespace scanner::stereo
