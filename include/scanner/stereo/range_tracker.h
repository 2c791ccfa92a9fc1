#pragma once

#include <deque>
#include <opencv2/core.hpp>

#include "scanner/stereo/options.h"
#include "scanner/stereo/rectify.h"

namespace scanner::stereo {

/// Whole disparities to search, both ends included.
struct SearchRange {
  int min_px = 0;
  int max_px = 0;
  int count() const { return max_px - min_px + 1; }
};

/// How a range came about.
enum class RangeState {
  kFixed,     ///< mode fixed: the configured bounds
  kLost,      ///< next to nothing matches: the configured bounds
  kTracking,  ///< what this picture and the last ones show, with margins
};

/// Chooses the disparities to search in each frame of a sequence: what a quick match of this pair
/// at a quarter of its size finds within the whole bounds, joined with what the last frames
/// really had, plus margins. A near object is therefore found in the first frame that shows it.
/// An end at which the last frame's disparities pile up opens to the bound at once; a pair that
/// shows next to nothing gets the whole bounds.
///
/// Decides from the pictures only: the same sequence of pairs gives the same ranges, on any number
/// of threads, instruction set and machine. With `memory_frames` 0 a range depends on its own pair
/// alone, so that frames left out before it change nothing. Not thread-safe; one per sequence:
///
///     const SearchRange range = tracker.choose(pair, threads);
///     matcher.min_disparity_px = range.min_px, matcher.max_disparity_px = range.max_px;
///     const DisparityImage found = match(pair, matcher, threads);
///     tracker.update(found.disparity_px);
class RangeTracker {
 public:
  /// `bounds`: the widest search, as configured. `min_surface_px`: the least number of pixels that
  /// a surface covers to be kept (ValidationOptions::surface_size_px); what is smaller does not
  /// widen the range. Throws ConfigurationError for options out of range, or bounds that are not
  /// 0 <= min < max.
  RangeTracker(const RangeOptions& options, SearchRange bounds, int min_surface_px);

  /// The range for this pair. Images CV_8UC1 of equal size, wider than `bounds`; else throws
  /// std::invalid_argument.
  SearchRange choose(const RectifiedPair& pair, int threads);

  /// Tells what came out of the range last chosen: CV_32FC1, NaN where invalid.
  void update(const cv::Mat& disparity_px);

  /// Forgets the sequence: the next frame starts as the first one did.
  void reset();

  RangeState state() const { return state_; }
  SearchRange range() const { return range_; }  ///< as last chosen
  SearchRange bounds() const { return bounds_; }

 private:
  RangeOptions options_;
  SearchRange bounds_;
  int min_surface_px_;
  RangeState state_ = RangeState::kFixed;
  SearchRange range_;
  std::deque<SearchRange> memory_;  ///< what the last frames had, oldest first
  bool open_low_ = false, open_high_ = false;
};

}  // namespace scanner::stereo
