#include "scanner/stereo/range_tracker.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "stereo/coarse.h"

namespace scanner::stereo {
namespace {

/// The quick look's pixels, in pixels of the full size.
constexpr int kFactor = 4;
/// Matches this close to an end of the range, px, may belong to a surface that goes on beyond it.
constexpr int kEnd = 2;
/// Ranges end on steps of this, so that they do not change with every frame.
constexpr int kStep = 8;

SearchRange joined(const SearchRange& a, const SearchRange& b) {
  return {std::min(a.min_px, b.min_px), std::max(a.max_px, b.max_px)};
}

/// The range of a histogram without the thinnest part of either end, which holds fewer than
/// `least` entries. `first` is the value of bin 0.
std::optional<SearchRange> spanOf(const std::vector<std::size_t>& histogram, int first,
                                  std::size_t least) {
  const auto end = [&](auto begin, auto stop) -> std::ptrdiff_t {
    std::size_t sum = 0;
    for (auto it = begin; it != stop; ++it) {
      sum += *it;
      if (sum >= least) return it - begin;
    }
    return -1;
  };
  const std::ptrdiff_t low = end(histogram.begin(), histogram.end());
  const std::ptrdiff_t high = end(histogram.rbegin(), histogram.rend());
  const auto last = static_cast<std::ptrdiff_t>(histogram.size()) - 1 - high;
  if (low < 0 || last < low) return std::nullopt;
  return SearchRange{first + static_cast<int>(low), first + static_cast<int>(last)};
}

/// What the pair shows, in pixels of the full size, or nothing when too little matches.
std::optional<SearchRange> quickLook(const RectifiedPair& pair, const SearchRange& bounds,
                                     int min_surface_px, double min_share, int threads) {
  const CoarsePair coarse = coarsePair(pair, kFactor);
  const int low = bounds.min_px / kFactor;
  const int high = (bounds.max_px + kFactor - 1) / kFactor;
  // Half of what a surface must cover: its rim does not match at this size.
  const int piece = std::max(2, min_surface_px / (2 * kFactor * kFactor));
  const CoarseMatch found = coarseMatch(coarse, low, high, piece, threads);
  if (static_cast<double>(found.found) < min_share * static_cast<double>(found.pixels)) {
    return std::nullopt;
  }
  std::vector<std::size_t> histogram(static_cast<std::size_t>(high - low + 1), 0);
  for (auto it = found.disparity.begin<short>(); it != found.disparity.end<short>(); ++it) {
    if (*it != kNoCoarseDisparity) ++histogram[static_cast<std::size_t>(*it - low)];
  }
  // Even the smallest piece counts, so that its ends are those of the whole.
  const auto span = spanOf(histogram, low, 1);
  if (!span) return std::nullopt;
  // A coarse pixel stands for disparities up to half of it to either side, and what it says about
  // a row of pixels may be off by one.
  return SearchRange{(span->min_px - 1) * kFactor, (span->max_px + 1) * kFactor};
}

}  // namespace

RangeTracker::RangeTracker(const RangeOptions& options, SearchRange bounds, int min_surface_px)
    : options_(options), bounds_(bounds), min_surface_px_(min_surface_px), range_(bounds) {
  if (bounds.min_px < 0 || bounds.min_px >= bounds.max_px) {
    throw ConfigurationError("stereo.range: bounds " + std::to_string(bounds.min_px) + " to " +
                             std::to_string(bounds.max_px) + " px are not 0 <= min < max");
  }
  if (options.margin_px < 0 || options.memory_frames < 0) {
    throw ConfigurationError("stereo.range: margin_px and memory_frames must not be negative");
  }
}

SearchRange RangeTracker::choose(const RectifiedPair& pair, int threads) {
  range_ = bounds_;
  state_ = RangeState::kFixed;
  if (options_.mode == RangeMode::kFixed) return range_;
  const cv::Mat& left = pair.left_gray;
  if (left.empty() || left.type() != CV_8UC1 || pair.right_gray.type() != CV_8UC1 ||
      pair.right_gray.size() != left.size() || left.cols <= bounds_.max_px) {
    throw std::invalid_argument("RangeTracker: needs two CV_8UC1 images wider than the bounds");
  }
  state_ = RangeState::kLost;
  std::optional<SearchRange> seen =
      quickLook(pair, bounds_, min_surface_px_, options_.min_matched_share, threads);
  if (!seen) return range_;
  state_ = RangeState::kTracking;
  for (const SearchRange& before : memory_) seen = joined(*seen, before);
  const int low = seen->min_px - options_.margin_px - bounds_.min_px;
  const int high = seen->max_px + options_.margin_px - bounds_.min_px + 1;
  if (!open_low_) range_.min_px = bounds_.min_px + std::max(0, low) / kStep * kStep;
  if (!open_high_) {
    const int steps = (std::max(0, high) + kStep - 1) / kStep;
    range_.max_px = std::min(bounds_.max_px, bounds_.min_px + std::max(1, steps) * kStep - 1);
  }
  return range_;
}

void RangeTracker::update(const cv::Mat& disparity_px) {
  if (options_.mode == RangeMode::kFixed || options_.memory_frames == 0) return;
  std::vector<std::size_t> histogram(static_cast<std::size_t>(range_.count()), 0);
  for (auto it = disparity_px.begin<float>(); it != disparity_px.end<float>(); ++it) {
    if (*it != *it) continue;
    const int bin = static_cast<int>(std::lround(*it)) - range_.min_px;
    ++histogram[static_cast<std::size_t>(std::clamp(bin, 0, range_.count() - 1))];
  }
  const auto least = static_cast<std::size_t>(std::max(1, min_surface_px_));
  const auto pile = [&](auto begin) {
    std::size_t sum = 0;
    for (int i = 0; i <= std::min(kEnd, range_.count() - 1); ++i) sum += *begin++;
    return sum >= least;
  };
  open_low_ = range_.min_px > bounds_.min_px && pile(histogram.begin());
  open_high_ = range_.max_px < bounds_.max_px && pile(histogram.rbegin());
  if (const auto span = spanOf(histogram, range_.min_px, least)) memory_.push_back(*span);
  while (memory_.size() > static_cast<std::size_t>(options_.memory_frames)) memory_.pop_front();
}

void RangeTracker::reset() {
  memory_.clear();
  open_low_ = open_high_ = false;
  range_ = bounds_;
}

}  // namespace scanner::stereo
