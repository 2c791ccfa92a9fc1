#include <hwy/aligned_allocator.h>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include "scanner/core/parallel.h"
#include "stereo/block_matcher_simd.h"
#include "stereo/edge_enhance.h"
#include "stereo/matcher.h"

namespace scanner::stereo {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

std::size_t toSize(int value) { return static_cast<std::size_t>(value); }

/// Differences are cut where the sum over the window would leave 16 bits, and below 128, as the
/// kernel demands. The default (window 13, edge limit 31) never comes near.
int differenceLimit(int window) {
  return std::min(127, (simd::kNoBlockCost - 1) / (window * window));
}

/// Rows that one task matches; more with a large window, whose first row costs as many again.
std::size_t rowsPerChunk(int window) { return toSize(std::max(96, 6 * window)); }

/// Fraction of a pixel from two straight lines of opposite slope through the least cost and its
/// neighbours: a sum of absolute differences rises linearly on both sides of its minimum, so that a
/// parabola would pull towards whole pixels (Shimizu and Okutomi 2001).
float fraction(const std::uint16_t* around) {
  if (around[0] == simd::kNoBlockCost || around[2] == simd::kNoBlockCost) return 0.0F;
  const int rise = std::max(around[0], around[2]) - around[1];
  if (rise == 0) return 0.0F;
  return 0.5F * static_cast<float>(around[0] - around[2]) / static_cast<float>(rise);
}

/// Both images after edge enhancement; the right one mirrored and continued past its left border.
struct Enhanced {
  cv::Mat left, right;
};

cv::Mat mirrored(const cv::Mat& image, std::size_t row_size) {
  cv::Mat out(image.rows, static_cast<int>(row_size), CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    const std::uint8_t* from = image.ptr<std::uint8_t>(y);
    std::uint8_t* to = out.ptr<std::uint8_t>(y);
    std::reverse_copy(from, from + image.cols, to);
    std::fill(to + image.cols, to + row_size, from[0]);
  }
  return out;
}

/// Sum over the window of the absolute values that texture is judged by, one row after the other.
class TextureRows {
 public:
  TextureRows(const cv::Mat& left, const BlockMatcherOptions& options)
      : left_(left), options_(options), columns_(toSize(left.cols)), prefix_(columns_.size() + 1) {}

  void add(int y, int sign) {
    if (y < 0 || y >= left_.rows) return;
    const std::uint8_t* row = left_.ptr<std::uint8_t>(y);
    if (options_.edge_enhancement != EdgeEnhancement::kNone) {
      for (int x = 0; x < left_.cols; ++x) {
        columns_[toSize(x)] += sign * std::abs(row[x] - options_.edge_limit);
      }
      return;
    }
    // Without edge enhancement there is no zero level: the step from the pixel before stands for
    // it.
    for (int x = 1; x < left_.cols; ++x) {
      columns_[toSize(x)] += sign * std::abs(row[x] - row[x - 1]);
    }
  }

  void integrate() {
    for (std::size_t x = 0; x < columns_.size(); ++x) prefix_[x + 1] = prefix_[x] + columns_[x];
  }

  int at(int x) const {
    const int radius = options_.window_px / 2;
    return prefix_[toSize(std::min(left_.cols, x + radius + 1))] -
           prefix_[toSize(std::max(0, x - radius))];
  }

 private:
  const cv::Mat& left_;
  const BlockMatcherOptions& options_;
  std::vector<int> columns_, prefix_;
};

/// Buffers of one task.
struct Workspace {
  explicit Workspace(const simd::BlockLayout& layout)
      : columns(hwy::AllocateAligned<std::uint16_t>(simd::columnSums(layout))),
        windows(hwy::AllocateAligned<std::uint16_t>(simd::windowSums(layout))),
        costs(hwy::AllocateAligned<std::uint16_t>(simd::costCells(layout))),
        right_cost(simd::rightCells(layout)),
        right_column(simd::rightCells(layout)),
        best(toSize(layout.width)),
        around(3 * toSize(layout.width)),
        ambiguous(toSize(layout.width)),
        zeros(simd::rightRowSize(layout), 0) {
    if (!columns || !windows || !costs) throw std::bad_alloc();
    std::fill_n(columns.get(), simd::columnSums(layout), std::uint16_t{0});
  }

  static std::size_t bytes(const simd::BlockLayout& layout) {
    const std::size_t cells = simd::columnSums(layout) + simd::windowSums(layout) +
                              simd::costCells(layout) + 2 * simd::rightCells(layout) +
                              4 * toSize(layout.width);
    return cells * sizeof(std::uint16_t) + toSize(layout.width) + simd::rightRowSize(layout) +
           2 * sizeof(int) * (toSize(layout.width) + 1);
  }

  hwy::AlignedFreeUniquePtr<std::uint16_t[]> columns, windows, costs;
  std::vector<std::uint16_t> right_cost, right_column;
  std::vector<std::int16_t> best;
  std::vector<std::uint16_t> around;
  std::vector<std::uint8_t> ambiguous;
  std::vector<std::uint8_t> zeros;  ///< stands for rows outside the image
};

struct Counts {
  std::size_t untextured = 0, ambiguous = 0;
};

class BlockMatcher : public Matcher {
 public:
  explicit BlockMatcher(const MatcherOptions& options)
      : options_(options.block), validation_(options.validation) {
    if (options_.window_px < 1 || options_.window_px % 2 == 0) {
      throw ConfigurationError("stereo.matcher.block.window_px must be odd");
    }
  }

  Candidates match(const cv::Mat& left, const cv::Mat& right, DisparitySearch search,
                   int threads) const override;
  std::size_t workingMemory(cv::Size image, DisparitySearch search, int threads) const override;

 private:
  simd::BlockLayout layoutOf(int width, DisparitySearch search) const;
  Counts matchRows(const simd::BlockLayout& layout, const Enhanced& images, int begin, int end,
                   Candidates& out) const;
  void readLeft(const simd::BlockLayout& layout, const Workspace& work, const TextureRows& texture,
                float* disparity, Counts& counts) const;

  BlockMatcherOptions options_;
  ValidationOptions validation_;
};

simd::BlockLayout BlockMatcher::layoutOf(int width, DisparitySearch search) const {
  simd::BlockLayout layout;
  layout.width = width;
  layout.min_disparity = search.min_px;
  layout.count = search.count();
  layout.padded =
      (layout.count + simd::kBlockAlignment - 1) / simd::kBlockAlignment * simd::kBlockAlignment;
  layout.radius = options_.window_px / 2;
  layout.shift = options_.shift_px;
  layout.limit = differenceLimit(options_.window_px);
  layout.cut =
      options_.edge_enhancement == EdgeEnhancement::kNone || 2 * options_.edge_limit > layout.limit;
  return layout;
}

void readRight(const simd::BlockLayout& layout, const Workspace& work, short* disparity) {
  std::fill_n(disparity, layout.width, kNoDisparity);
  for (int x = 0; x < layout.width - layout.min_disparity; ++x) {
    const std::size_t i = simd::rightElement(layout, x);
    if (work.right_cost[i] == simd::kNoBlockCost) continue;
    disparity[x] = static_cast<short>(work.right_column[i] - x);
  }
}

void BlockMatcher::readLeft(const simd::BlockLayout& layout, const Workspace& work,
                            const TextureRows& texture, float* disparity, Counts& counts) const {
  const double area = static_cast<double>(options_.window_px) * options_.window_px;
  const int least_texture =
      validation_.texture ? static_cast<int>(std::ceil(validation_.texture_threshold * area)) : 0;
  for (int x = 0; x < layout.width; ++x) {
    const std::size_t i = toSize(x);
    disparity[x] = kNan;
    if (work.best[i] < 0) continue;
    if (validation_.texture && texture.at(x) < least_texture) {
      ++counts.untextured;
    } else if (validation_.uniqueness && work.ambiguous[i] != 0) {
      ++counts.ambiguous;
    } else {
      disparity[x] = static_cast<float>(layout.min_disparity + work.best[i]) +
                     fraction(work.around.data() + 3 * i);
    }
  }
}

Counts BlockMatcher::matchRows(const simd::BlockLayout& layout, const Enhanced& images, int begin,
                               int end, Candidates& out) const {
  Workspace work(layout);
  TextureRows texture(images.left, options_);
  Counts counts;
  const auto rowOf = [&](const cv::Mat& image, int y) {
    return y < 0 || y >= image.rows ? work.zeros.data() : image.ptr<std::uint8_t>(y);
  };
  simd::BlockRow row;
  row.columns = work.columns.get();
  row.windows = work.windows.get();
  row.costs = work.costs.get();
  row.uniqueness = validation_.uniqueness
                       ? static_cast<int>(std::lround(validation_.uniqueness_percent * 655.36))
                       : -1;
  row.best = work.best.data();
  row.around = work.around.data();
  row.ambiguous = work.ambiguous.data();
  row.right_cost = work.right_cost.data();
  row.right_column = work.right_column.data();
  for (int y = begin - 2 * layout.radius; y < end; ++y) {
    const int leaving = y > begin ? y - layout.radius - 1 : -1;
    row.left_in = rowOf(images.left, y + layout.radius);
    row.right_in = rowOf(images.right, y + layout.radius);
    row.left_out = rowOf(images.left, leaving);
    row.right_out = rowOf(images.right, leaving);
    if (validation_.texture) {
      texture.add(y + layout.radius, 1);
      texture.add(leaving, -1);
    }
    if (y < begin) {
      simd::slideColumns(layout, row);
      continue;
    }
    simd::matchRow(layout, row);
    if (validation_.texture) texture.integrate();
    readLeft(layout, work, texture, out.left.ptr<float>(y), counts);
    readRight(layout, work, out.right.ptr<short>(y));
  }
  return counts;
}

Candidates BlockMatcher::match(const cv::Mat& left, const cv::Mat& right, DisparitySearch search,
                               int threads) const {
  if (left.empty() || left.type() != CV_8UC1 || right.type() != CV_8UC1 ||
      left.size() != right.size()) {
    throw std::invalid_argument("block matcher: needs two CV_8UC1 images of equal size");
  }
  if (search.min_px < 0 || search.min_px > search.max_px || search.max_px >= left.cols) {
    throw std::invalid_argument("block matcher: the search must lie within the image's width");
  }
  const simd::BlockLayout layout = layoutOf(left.cols, search);
  const Enhanced images{
      enhanceEdges(left, options_, threads),
      mirrored(enhanceEdges(right, options_, threads), simd::rightRowSize(layout))};
  Candidates out;
  out.left.create(left.size(), CV_32FC1);
  out.right.create(left.size(), CV_16SC1);
  const std::size_t grain = rowsPerChunk(options_.window_px);
  std::vector<Counts> counts(chunkCount(toSize(left.rows), grain));
  parallelFor(toSize(left.rows), grain, threads, [&](std::size_t begin, std::size_t end) {
    counts[begin / grain] =
        matchRows(layout, images, static_cast<int>(begin), static_cast<int>(end), out);
  });
  for (const Counts& c : counts) {
    out.untextured += c.untextured;
    out.ambiguous += c.ambiguous;
  }
  return out;
}

std::size_t BlockMatcher::workingMemory(cv::Size image, DisparitySearch search, int threads) const {
  const simd::BlockLayout layout = layoutOf(image.width, search);
  const std::size_t chunks = chunkCount(toSize(image.height), rowsPerChunk(options_.window_px));
  const std::size_t tasks = std::min(chunks, toSize(std::max(1, threads)));
  const std::size_t rows = toSize(image.height);
  return rows * (2 * toSize(image.width) + simd::rightRowSize(layout)) +
         tasks * Workspace::bytes(layout);
}

}  // namespace

std::unique_ptr<Matcher> makeBlockMatcher(const MatcherOptions& options) {
  return std::make_unique<BlockMatcher>(options);
}

}  // namespace scanner::stereo
