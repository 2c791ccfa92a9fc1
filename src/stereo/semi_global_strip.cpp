#include "stereo/semi_global_strip.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <new>
#include <opencv2/imgproc.hpp>

#include "stereo/census_simd.h"

namespace scanner::stereo {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr int kStripRows = 128;
/// Rows before the strip (and after it, where it is swept both ways) that only start the paths.
constexpr int kWarmUpRows = 32;
/// The sums of a strip that is swept both ways are kept; where the image is wide it has less rows.
constexpr std::size_t kMaxSumBytes = std::size_t{64} << 20;
constexpr int kMinStripRows = 32;

std::size_t asSize(int value) { return static_cast<std::size_t>(value); }

bool bothWays(const SemiGlobalOptions& o) { return o.paths == SemiGlobalPaths::kEight; }

/// Elements of a mirrored right row (simd::CostRow).
std::size_t mirroredLength(const simd::CellLayout& l) {
  return asSize(l.width + l.min_disparity + l.padded + simd::kRowSlack);
}

std::size_t leftLength(const simd::CellLayout& l) { return asSize(l.width + simd::kRowSlack); }

std::size_t cellBytes(const simd::CellLayout& l) {
  return (3 * asSize(l.width) + 1) * simd::slotStride(l) + simd::kCellAlignment;
}

std::size_t rowCells(const simd::CellLayout& l) { return asSize(l.width) * asSize(l.padded); }

/// Rows of sums: those of the strip and one for rows that nobody reads, or one only.
std::size_t sumRows(const SemiGlobalOptions& o, int rows) {
  return bothWays(o) ? asSize(rows) + 1 : 1;
}

cv::Mat mirrored(const cv::Mat& image) {
  cv::Mat out;
  cv::flip(image, out, 1);
  return out;
}

/// Half the grey, so that a difference counts half.
cv::Mat halved(const cv::Mat& image) {
  cv::Mat out;
  image.convertTo(out, CV_8U, 0.5);
  return out;
}

/// Twice the slope along the row in grey levels per pixel, around 128.
cv::Mat slope(const cv::Mat& image) {
  cv::Mat gradient, out;
  cv::Sobel(image, gradient, CV_16S, 1, 0);
  gradient.convertTo(out, CV_8U, 0.25, 128.0);
  return out;
}

/// Where a V with sides of equal slope through the three sums has its tip, from the middle one.
/// Absolute differences and Hamming distances are nearer to that than to a parabola, which pulls
/// towards whole pixels.
float fraction(const std::uint16_t* around, int paths) {
  const int before = around[0], at = around[1], after = around[2];
  const int highest = std::max(before, after);
  if (highest >= paths * simd::kNoCost || highest <= at) return 0.0F;
  return static_cast<float>(before - after) / static_cast<float>(2 * (highest - at));
}

void censusOf(const std::uint8_t* const* rows, const simd::CellLayout& layout, int radius,
              bool is_mirrored, std::size_t length, std::vector<std::uint8_t>& planes) {
  std::array<std::uint8_t*, simd::kMaxCensusPlanes> out{};
  for (std::size_t p = 0; p * length < planes.size(); ++p) out[p] = planes.data() + p * length;
  simd::censusRow({rows, layout.width, radius, radius, is_mirrored, out.data()});
}

}  // namespace

SemiGlobalImages::SemiGlobalImages(const cv::Mat& left, const cv::Mat& right,
                                   const simd::CellLayout& layout, int census_radius)
    : radius_(census_radius) {
  const int beyond = static_cast<int>(mirroredLength(layout)) - layout.width;
  left_gray_ = withBorder(left, simd::kRowSlack);
  right_gray_ = withBorder(mirrored(right), simd::kRowSlack);
  left_[0] = withBorder(halved(left), 0);
  right_[0] = withBorder(mirrored(halved(right)), beyond);
  left_[1] = withBorder(slope(left), 0);
  right_[1] = withBorder(mirrored(slope(right)), beyond);
}

cv::Mat SemiGlobalImages::withBorder(const cv::Mat& image, int width_beyond) const {
  cv::Mat out;
  cv::copyMakeBorder(image, out, radius_, radius_, radius_, radius_ + width_beyond,
                     cv::BORDER_REPLICATE);
  return out;
}

std::size_t SemiGlobalImages::bytes(cv::Size image, const simd::CellLayout& layout,
                                    int census_radius) {
  const std::size_t border = 2 * asSize(census_radius);
  const std::size_t rows = asSize(image.height) + border;
  const std::size_t columns = asSize(image.width) + border;
  const std::size_t beyond = mirroredLength(layout) - asSize(image.width);
  const std::size_t kept = rows * (6 * columns + 2 * asSize(simd::kRowSlack) + 2 * beyond);
  return kept + 4 * asSize(image.area());  // and what is on the way to them: 16 bit, 8 bit, mirror
}

simd::CellLayout makeLayout(int width, DisparitySearch search) {
  const int padded =
      (search.count() + simd::kCellAlignment - 1) / simd::kCellAlignment * simd::kCellAlignment;
  return {width, search.min_px, search.count(), padded};
}

int pathCount(const SemiGlobalOptions& o) { return bothWays(o) ? 8 : 5; }

int stripRows(const simd::CellLayout& layout, int height, const SemiGlobalOptions& options) {
  int rows = kStripRows;
  if (bothWays(options)) {
    const std::size_t row_bytes = rowCells(layout) * sizeof(std::uint16_t);
    rows = std::clamp(static_cast<int>(kMaxSumBytes / row_bytes), kMinStripRows, kStripRows);
  }
  const int strips = (height + rows - 1) / rows;
  return (height + strips - 1) / strips;
}

SemiGlobalStrip::SemiGlobalStrip(const simd::CellLayout& layout, const MatcherOptions& options,
                                 int rows)
    : layout_(layout),
      options_(options.semi_global),
      row_cells_(rowCells(layout)),
      planes_(simd::censusPlanes(options_.window_px / 2, options_.window_px / 2)),
      left_census_(asSize(planes_) * leftLength(layout)),
      right_census_(asSize(planes_) * mirroredLength(layout)),
      outside_(mirroredLength(layout), 0),
      padding_(asSize(layout.padded), 0),
      least_(3 * asSize(layout.width) + 1),
      right_sum_(mirroredLength(layout)),
      right_index_(mirroredLength(layout)),
      around_(3 * asSize(layout.width)),
      index_(asSize(layout.width)),
      cost_(hwy::AllocateAligned<std::uint8_t>(row_cells_)),
      cells_(hwy::AllocateAligned<std::uint8_t>(cellBytes(layout))),
      sums_(hwy::AllocateAligned<std::uint16_t>(row_cells_ * sumRows(options_, rows))) {
  if (cost_ == nullptr || cells_ == nullptr || sums_ == nullptr) throw std::bad_alloc();
  std::fill(outside_.begin() + layout.width, outside_.end(), std::uint8_t{255});
  std::fill(padding_.begin() + layout.count, padding_.end(), simd::kNoCost);
  fillPenalties();
  selection_.paths = pathCount(options_);
  if (options.validation.uniqueness) {
    selection_.uniqueness_percent = cvRound(options.validation.uniqueness_percent);
  }
  selection_.index = index_.data();
  selection_.around = around_.data();
  selection_.right_sum = right_sum_.data();
  selection_.right_index = right_index_.data();
}

std::size_t SemiGlobalStrip::bytes(const simd::CellLayout& l, const SemiGlobalOptions& o,
                                   int rows) {
  const std::size_t planes = asSize(simd::censusPlanes(o.window_px / 2, o.window_px / 2));
  const std::size_t width = asSize(l.width);
  return sizeof(SemiGlobalStrip) + rowCells(l) * (1 + 2 * sumRows(o, rows)) + cellBytes(l) +
         planes * (leftLength(l) + mirroredLength(l)) + 5 * mirroredLength(l) + asSize(l.padded) +
         11 * width + 1 + std::size_t{6} * HWY_ALIGNMENT;
}

/// A step of more than one disparity is cheaper where the grey changes as well, which is where the
/// borders of things are.
void SemiGlobalStrip::fillPenalties() {
  for (int difference = 0; difference < 256; ++difference) {
    const int eased = options_.large_step_penalty -
                      options_.large_step_penalty * difference / options_.edge_contrast;
    large_step_[asSize(difference)] = static_cast<std::uint8_t>(
        std::max(eased, std::min(options_.edge_step_penalty, options_.large_step_penalty)));
  }
}

void SemiGlobalStrip::startSweep() {
  std::memset(cells_.get(), simd::kNoCost, cellBytes(layout_));
  std::fill(least_.begin(), least_.end(), simd::kNoCost);
}

void SemiGlobalStrip::computeCost(const SemiGlobalImages& images, int y) {
  const std::size_t left_length = leftLength(layout_), right_length = mirroredLength(layout_);
  const int r = images.radius();
  std::vector<const std::uint8_t*> left_rows, right_rows;
  for (int i = -r; i <= r; ++i) {
    left_rows.push_back(images.leftGray(y + i));
    right_rows.push_back(images.rightGray(y + i));
  }
  censusOf(left_rows.data(), layout_, r, false, left_length, left_census_);
  censusOf(right_rows.data(), layout_, r, true, right_length, right_census_);
  simd::CostRow row;
  row.census_planes = planes_;
  for (std::size_t p = 0; p < asSize(planes_); ++p) {
    row.left_census[p] = left_census_.data() + p * left_length;
    row.right_census[p] = right_census_.data() + p * right_length;
  }
  for (std::size_t kind = 0; kind < 2; ++kind) {
    row.left_value[kind] = images.leftValue(kind, y);
    row.right_value[kind] = images.rightValue(kind, y);
  }
  row.limit[0] = options_.gray_limit;
  row.limit[1] = options_.gradient_limit;
  row.right_outside = outside_.data();
  row.padding = padding_.data();
  row.cost = cost_.get();
  simd::costRow(layout_, row);
}

simd::SweepRow SemiGlobalStrip::rowOf(const SemiGlobalImages& images, int y, int previous,
                                      int direction, std::size_t step) {
  simd::SweepRow row;
  row.direction = direction;
  row.step = step;
  row.cost = cost_.get();
  row.gray = images.leftGray(y);
  row.previous_gray = images.leftGray(previous);
  row.small_step = options_.small_step_penalty;
  row.large_step = large_step_.data();
  const std::size_t width = asSize(layout_.width);
  std::uint8_t* cells = cells_.get() + simd::kCellAlignment;
  for (std::size_t p = 0; p < 3; ++p) {
    row.vertical[p] = {cells + p * width * simd::slotStride(layout_), least_.data() + p * width};
  }
  row.horizontal = {cells + 3 * width * simd::slotStride(layout_), least_.data() + 3 * width};
  return row;
}

void SemiGlobalStrip::select(const simd::SweepRow& row, int y, Candidates& out) {
  const int nothing = selection_.paths * simd::kNoCost;
  std::fill(right_sum_.begin(), right_sum_.end(), static_cast<std::uint16_t>(nothing));
  simd::sweepRow(layout_, row, &selection_);
  float* left = out.left.ptr<float>(y);
  short* right = out.right.ptr<short>(y);
  for (int x = 0; x < layout_.width; ++x) {
    const int index = index_[asSize(x)];
    left[x] = index == simd::kAmbiguous ? kAmbiguousDisparity : kNan;
    if (index >= 0) {
      left[x] = static_cast<float>(layout_.min_disparity + index) +
                fraction(around_.data() + 3 * asSize(x), selection_.paths);
    }
    // Mirrored element i of the right row belongs to cell i - (width - 1 - x) - min_disparity.
    const std::size_t i = asSize(layout_.width - 1 - x);
    right[x] = right_sum_[i] < nothing ? static_cast<short>(layout_.min_disparity + right_index_[i])
                                       : kNoDisparity;
  }
}

void SemiGlobalStrip::match(const SemiGlobalImages& images, int begin, int end, Candidates& out) {
  const bool both = bothWays(options_);
  const int first = std::max(0, begin - kWarmUpRows);
  const auto sums_of = [&](int y) {
    const bool kept = both && y >= begin && y < end;
    const std::size_t unread = both ? asSize(end - begin) : 0;
    return sums_.get() + (kept ? asSize(y - begin) : unread) * row_cells_;
  };
  startSweep();
  for (int y = first; y < end; ++y) {
    computeCost(images, y);
    simd::SweepRow row = rowOf(images, y, std::max(first, y - 1), 1, asSize(y - first));
    row.sums_out = sums_of(y);
    simd::sweepRow(layout_, row, nullptr);
    if (both || y < begin) continue;
    row.direction = -1;
    row.from_above = false;
    row.sums_in = row.sums_out;
    select(row, y, out);
  }
  if (!both) return;
  const int last = std::min(out.left.rows, end + kWarmUpRows) - 1;
  startSweep();
  for (int y = last; y >= begin; --y) {
    computeCost(images, y);
    simd::SweepRow row = rowOf(images, y, std::min(last, y + 1), -1, asSize(last - y));
    row.sums_out = sums_of(y);
    if (y >= end) {
      simd::sweepRow(layout_, row, nullptr);
      continue;
    }
    row.sums_in = row.sums_out;
    select(row, y, out);
  }
}

}  // namespace scanner::stereo
