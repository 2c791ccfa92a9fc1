#include "stereo/block_matcher_simd.h"

#include <algorithm>
#include <cstddef>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stereo/block_matcher_simd.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef SCANNER_STEREO_BLOCK_MATCHER_ONCE
#define SCANNER_STEREO_BLOCK_MATCHER_ONCE
namespace scanner::stereo::simd {

/// Room round the costs of a pixel, for vectors that reach past them.
constexpr int kCostPadding = 64;

inline std::size_t toSize(int value) { return static_cast<std::size_t>(value); }

inline int roundedUp(int cells) {
  return (cells + kBlockAlignment - 1) / kBlockAlignment * kBlockAlignment;
}

/// Window sums of this many columns are kept: those that the costs of one block read.
inline int ringSize(const BlockLayout& layout) {
  int size = kBlockColumns;
  while (size < kBlockColumns + 2 * layout.shift + 1) size *= 2;
  return size;
}

inline std::size_t costStride(const BlockLayout& layout) {
  return toSize(layout.padded + 2 * kCostPadding);
}

/// Cells of column x that some window uses: those whose right pixel is not too far outside.
inline int columnCells(const BlockLayout& layout, int x) {
  const int inside = x + layout.radius + layout.shift - layout.min_disparity + 1;
  return std::clamp(roundedUp(std::max(0, inside)), 0, layout.padded);
}

}  // namespace scanner::stereo::simd
#endif

HWY_BEFORE_NAMESPACE();
namespace scanner::stereo::simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D16 = hn::ScalableTag<std::uint16_t>;
using D8 = hn::Rebind<std::uint8_t, D16>;
using S8 = hn::Rebind<std::int8_t, D16>;
using S16 = hn::Rebind<std::int16_t, D16>;
using V8 = hn::Vec<D8>;
using V16 = hn::Vec<D16>;

#if HWY_TARGET == HWY_SCALAR
HWY_INLINE std::uint16_t leastLane(D16 /*d*/, V16 v) { return hn::GetLane(v); }
#else
template <class D>
HWY_INLINE std::uint16_t leastLane(D d, hn::Vec<D> v) {
  if constexpr (hn::MaxLanes(D()) > 8) {
    const hn::Half<D> half;
    return leastLane(half, hn::Min(hn::LowerHalf(half, v), hn::UpperHalf(half, v)));
  } else {
    v = hn::Min(v, hn::ShiftRightBytes<8>(d, v));
    v = hn::Min(v, hn::ShiftRightBytes<4>(d, v));
    return hn::GetLane(hn::Min(v, hn::ShiftRightBytes<2>(d, v)));
  }
}
#endif

template <bool kCut>
HWY_INLINE V8 difference(V8 a, V8 b, V8 limit) {
  const V8 value = hn::Or(hn::SaturatedSub(a, b), hn::SaturatedSub(b, a));
  return kCut ? hn::Min(value, limit) : value;
}

/// Column x: the entering row's differences less those of the leaving one. Differences are below
/// 128, so that this fits into a signed byte. With `windows`, on to the window sums whose last
/// column this is: those of the column `before`, plus this column, less the one that is `leaving`.
template <bool kCut, bool kWindows>
HWY_INLINE void slideColumn(const BlockLayout& layout, const BlockRow& row, int x,
                            const std::uint16_t* before, const std::uint16_t* leaving,
                            std::uint16_t* windows) {
  const D16 d;
  const D8 d8;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t cells = toSize(columnCells(layout, x));
  const std::size_t mirrored = toSize(layout.width - 1 - x + layout.min_disparity);
  const std::uint8_t* HWY_RESTRICT right_in = row.right_in + mirrored;
  const std::uint8_t* HWY_RESTRICT right_out = row.right_out + mirrored;
  const V8 left_in = hn::Set(d8, row.left_in[x]);
  const V8 left_out = hn::Set(d8, row.left_out[x]);
  const V8 limit = hn::Set(d8, static_cast<std::uint8_t>(layout.limit));
  std::uint16_t* HWY_RESTRICT column = row.columns + toSize(x) * toSize(layout.padded);
  for (std::size_t i = 0; i < cells; i += lanes) {
    const V8 in = difference<kCut>(left_in, hn::LoadU(d8, right_in + i), limit);
    const V8 out = difference<kCut>(left_out, hn::LoadU(d8, right_out + i), limit);
    const auto change = hn::PromoteTo(S16(), hn::BitCast(S8(), hn::Sub(in, out)));
    const V16 sum = hn::Add(hn::Load(d, column + i), hn::BitCast(d, change));
    hn::Store(sum, d, column + i);
    if (kWindows) {
      const V16 old = hn::Sub(hn::Load(d, before + i), hn::Load(d, leaving + i));
      hn::Store(hn::Add(old, sum), d, windows + i);
    }
  }
}

/// Window sums of column x from those of the column before it.
template <bool kCut>
HWY_INLINE void slideWindow(const BlockLayout& layout, const BlockRow& row, int x, int ring) {
  const D16 d;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t padded = toSize(layout.padded);
  const int entering = x + layout.radius;
  const int old = x - layout.radius - 1;
  const std::uint16_t* before = row.windows + toSize((x + ring - 1) & (ring - 1)) * padded;
  std::uint16_t* now = row.windows + toSize(x & (ring - 1)) * padded;
  // Outside the image there is nothing to add or to take away: one row of zeros stands for it.
  const std::uint16_t* zeros = row.windows + toSize(ring) * padded;
  const std::uint16_t* leaving = old >= 0 ? row.columns + toSize(old) * padded : zeros;
  if (entering < layout.width) {
    slideColumn<kCut, true>(layout, row, entering, before, leaving, now);
    return;
  }
  for (std::size_t i = 0; i < padded; i += lanes) {
    hn::Store(hn::Sub(hn::Load(d, before + i), hn::Load(d, leaving + i)), d, now + i);
  }
}

HWY_INLINE void testUniqueness(const BlockRow& row, const std::uint16_t* cost, int cells, int x) {
  const D16 d;
  const std::size_t lanes = hn::Lanes(d);
  const std::uint16_t* around = row.around + std::ptrdiff_t{3} * x;
  const std::uint32_t best = around[1];
  const std::uint64_t slack = (static_cast<std::uint64_t>(best) * toSize(row.uniqueness)) >> 16;
  const auto least = static_cast<std::uint16_t>(
      std::min<std::uint64_t>(best + slack, static_cast<std::uint64_t>(kNoBlockCost - 1)));
  const V16 bound = hn::Set(d, least);
  std::size_t close = toSize(cells);
  for (std::size_t i = 0; i < toSize(cells); i += lanes) {
    close -= hn::CountTrue(d, hn::Gt(hn::LoadU(d, cost + i), bound));
  }
  std::size_t own = 0;
  for (int i = 0; i < 3; ++i) own += around[i] <= least ? 1 : 0;
  row.ambiguous[x] = close > own ? 1 : 0;
}

/// Costs of pixel x, and the best of them.
template <bool kShift>
HWY_INLINE void matchPixel(const BlockLayout& layout, const BlockRow& row, int x, int ring,
                           std::uint16_t* cost) {
  const D16 d;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t padded = toSize(layout.padded);
  const int valid = std::min(layout.count, x - layout.min_disparity + 1);
  const int cells = roundedUp(valid);
  const auto windowAt = [&](int at) {
    const int centre = at < 0 || at >= layout.width ? x : at;
    return row.windows + toSize(centre & (ring - 1)) * padded;
  };
  const std::uint16_t* middle = windowAt(x);
  const std::uint16_t* before = windowAt(x - layout.shift);
  const std::uint16_t* after = windowAt(x + layout.shift);
  V16 best = hn::Set(d, kNoBlockCost);
  V16 where = hn::Zero(d);
  V16 cell = hn::Iota(d, 0);
  const V16 step = hn::Set(d, static_cast<std::uint16_t>(lanes));
  const V16 none = hn::Set(d, kNoBlockCost);
  const auto take = [&](std::size_t i, V16 value) HWY_ATTR {
    hn::StoreU(value, d, cost + i);
    where = hn::IfThenElse(hn::Lt(value, best), cell, where);
    best = hn::Min(value, best);
    cell = hn::Add(cell, step);
  };
  const auto load = [&](std::size_t i) HWY_ATTR {
    const V16 value = hn::Load(d, middle + i);
    if (!kShift) return value;
    return hn::Min(value, hn::Min(hn::Load(d, before + i), hn::Load(d, after + i)));
  };
  std::size_t i = 0;
  for (; i + lanes <= toSize(valid); i += lanes) take(i, load(i));
  const V16 end = hn::Set(d, static_cast<std::uint16_t>(valid));
  for (; i < toSize(cells); i += lanes) {
    take(i, hn::IfThenElse(hn::Lt(cell, end), load(i), none));
  }
  const std::uint16_t least = leastLane(d, best);
  const std::size_t found =
      leastLane(d, hn::IfThenElse(hn::Eq(best, hn::Set(d, least)), where, none));
  std::uint16_t* around = row.around + std::ptrdiff_t{3} * x;
  around[0] = found > 0 ? cost[found - 1] : kNoBlockCost;
  around[1] = least;
  around[2] = cost[found + 1];  // past the last cell: kNoBlockCost
  row.best[x] = static_cast<std::int16_t>(found);
  if (row.uniqueness >= 0) testUniqueness(row, cost, cells, x);
}

/// Best left column of the right pixels that the columns [first, first + n) reach. A vector of
/// right pixels stays in registers while all columns of the block go by.
HWY_INLINE void matchRight(const BlockLayout& layout, const BlockRow& row, int first, int n) {
  const D16 d;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t stride = costStride(layout);
  const int last = first + n - 1;
  const std::size_t start = toSize(layout.width - 1 - last);
  const int cells = roundedUp(std::min(layout.count, last - layout.min_disparity + 1));
  const V16 one = hn::Set(d, 1);
  for (std::size_t i = 0; i < toSize(cells + n - 1); i += lanes) {
    V16 best = hn::LoadU(d, row.right_cost + start + i);
    V16 where = hn::LoadU(d, row.right_column + start + i);
    V16 column = hn::Set(d, static_cast<std::uint16_t>(first));
    const std::uint16_t* cost = row.costs + kCostPadding + i - toSize(n - 1);
    for (int k = 0; k < n; ++k, cost += stride + 1) {
      const V16 value = hn::LoadU(d, cost);
      where = hn::IfThenElse(hn::Lt(value, best), column, where);
      best = hn::Min(value, best);
      column = hn::Add(column, one);
    }
    hn::StoreU(best, d, row.right_cost + start + i);
    hn::StoreU(where, d, row.right_column + start + i);
  }
}

template <bool kCut>
void slideColumnsOf(const BlockLayout& layout, const BlockRow& row) {
  const int begin = std::max(0, layout.min_disparity - layout.radius - layout.shift);
  for (int x = begin; x < layout.width; ++x) {
    slideColumn<kCut, false>(layout, row, x, nullptr, nullptr, nullptr);
  }
}

template <bool kCut, bool kShift>
void matchRowOf(const BlockLayout& layout, const BlockRow& row) {
  const int ring = ringSize(layout);
  // Cells that a column does not reach yet must be found empty by the first one that does.
  std::fill_n(row.windows, windowSums(layout), std::uint16_t{0});
  std::fill_n(row.costs, costCells(layout), kNoBlockCost);
  std::fill_n(row.right_cost, rightCells(layout), kNoBlockCost);
  std::fill_n(row.right_column, rightCells(layout), std::uint16_t{0});
  std::fill_n(row.best, layout.min_disparity, std::int16_t{-1});
  // The first window is built by sliding in from where nothing has been added up yet.
  int window = std::max(0, layout.min_disparity - layout.radius - layout.shift) - layout.radius;
  for (int first = layout.min_disparity; first < layout.width; first += kBlockColumns) {
    const int n = std::min(kBlockColumns, layout.width - first);
    for (; window < std::min(layout.width, first + n + layout.shift); ++window) {
      slideWindow<kCut>(layout, row, window, ring);
    }
    for (int k = 0; k < n; ++k) {
      matchPixel<kShift>(layout, row, first + k, ring,
                         row.costs + toSize(k) * costStride(layout) + kCostPadding);
    }
    matchRight(layout, row, first, n);
  }
}

void slideColumns(const BlockLayout& layout, const BlockRow& row) {
  if (layout.cut) return slideColumnsOf<true>(layout, row);
  slideColumnsOf<false>(layout, row);
}

void matchRow(const BlockLayout& layout, const BlockRow& row) {
  if (layout.cut) {
    return layout.shift > 0 ? matchRowOf<true, true>(layout, row)
                            : matchRowOf<true, false>(layout, row);
  }
  return layout.shift > 0 ? matchRowOf<false, true>(layout, row)
                          : matchRowOf<false, false>(layout, row);
}

}  // namespace HWY_NAMESPACE
}  // namespace scanner::stereo::simd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace scanner::stereo::simd {

std::size_t columnSums(const BlockLayout& layout) {
  return toSize(layout.width) * toSize(layout.padded);
}

std::size_t windowSums(const BlockLayout& layout) {
  return (toSize(ringSize(layout)) + 1) * toSize(layout.padded);
}

std::size_t costCells(const BlockLayout& layout) { return kBlockColumns * costStride(layout); }

std::size_t rightCells(const BlockLayout& layout) {
  return toSize(layout.width + layout.padded + 2 * kCostPadding);
}

std::size_t rightRowSize(const BlockLayout& layout) {
  return toSize(layout.width + layout.min_disparity + layout.padded + kCostPadding);
}

HWY_EXPORT(slideColumns);
HWY_EXPORT(matchRow);

void slideColumns(const BlockLayout& layout, const BlockRow& row) {
  HWY_DYNAMIC_DISPATCH(slideColumns)(layout, row);
}

void matchRow(const BlockLayout& layout, const BlockRow& row) {
  HWY_DYNAMIC_DISPATCH(matchRow)(layout, row);
}

}  // namespace scanner::stereo::simd
#endif
