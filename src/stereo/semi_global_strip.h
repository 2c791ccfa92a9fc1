#pragma once

#include <hwy/aligned_allocator.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "scanner/stereo/options.h"
#include "stereo/matcher.h"
#include "stereo/semi_global_simd.h"

namespace scanner::stereo {

/// What semi-global matching compares, for both eyes. Right images are mirrored; all have a border
/// that census windows and rows of costs may read.
class SemiGlobalImages {
 public:
  SemiGlobalImages(const cv::Mat& left, const cv::Mat& right, const simd::CellLayout& layout,
                   int census_radius);

  int radius() const { return radius_; }
  const std::uint8_t* leftGray(int y) const { return row(left_gray_, y); }
  const std::uint8_t* rightGray(int y) const { return row(right_gray_, y); }
  /// Images that are compared by absolute difference: 0 half the grey, 1 gradient along the row.
  const std::uint8_t* leftValue(std::size_t kind, int y) const { return row(left_[kind], y); }
  const std::uint8_t* rightValue(std::size_t kind, int y) const { return row(right_[kind], y); }

  static std::size_t bytes(cv::Size image, const simd::CellLayout& layout, int census_radius);

 private:
  cv::Mat withBorder(const cv::Mat& image, int width_beyond) const;
  const std::uint8_t* row(const cv::Mat& image, int y) const {
    return image.ptr<std::uint8_t>(y + radius_) + radius_;
  }

  int radius_;
  cv::Mat left_gray_, right_gray_, left_[2], right_[2];
};

/// Disparities and cells of a pixel for this search.
simd::CellLayout makeLayout(int width, DisparitySearch search);

/// Number of directions whose path costs are summed.
int pathCount(const SemiGlobalOptions& options);

/// Rows that are matched in one go, from the size of the image alone, so that the result does not
/// depend on the number of threads.
int stripRows(const simd::CellLayout& layout, int height, const SemiGlobalOptions& options);

/// Matches one strip of rows after the other; holds the memory that this takes. Paths start some
/// rows outside the strip, so that strips differ little from sweeps over the whole image.
class SemiGlobalStrip {
 public:
  SemiGlobalStrip(const simd::CellLayout& layout, const MatcherOptions& options, int rows);

  /// Rows [begin, end) of `out`, at most `rows` of them. Ambiguous pixels of `out.left` become
  /// kAmbiguousDisparity.
  void match(const SemiGlobalImages& images, int begin, int end, Candidates& out);

  static constexpr float kAmbiguousDisparity = -1.0F;
  static std::size_t bytes(const simd::CellLayout& layout, const SemiGlobalOptions& options,
                           int rows);

 private:
  void fillPenalties();
  void startSweep();
  void computeCost(const SemiGlobalImages& images, int y);
  simd::SweepRow rowOf(const SemiGlobalImages& images, int y, int previous, int direction,
                       std::size_t step);
  void select(const simd::SweepRow& row, int y, Candidates& out);

  simd::CellLayout layout_;
  SemiGlobalOptions options_;
  std::size_t row_cells_;
  int planes_;
  std::vector<std::uint8_t> left_census_, right_census_, outside_, padding_, least_;
  std::vector<std::uint16_t> right_sum_, right_index_, around_;
  std::vector<std::int16_t> index_;
  hwy::AlignedFreeUniquePtr<std::uint8_t[]> cost_, cells_;
  hwy::AlignedFreeUniquePtr<std::uint16_t[]> sums_;
  std::array<std::uint8_t, 256> large_step_{};
  simd::Selection selection_;
};

}  // namespace scanner::stereo
