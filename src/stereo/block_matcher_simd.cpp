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

/// The entering row's difference less that of the leaving one. Differences are below 128, so that
/// this fits into a signed byte.
template <bool kCut, class D>
class Change {
 public:
  using V = hn::Vec<D>;
  HWY_INLINE Change(std::uint8_t left_in, std::uint8_t left_out, std::uint8_t limit)
      : left_in_(hn::Set(D(), left_in)),
        left_out_(hn::Set(D(), left_out)),
        limit_(hn::Set(D(), limit)) {}
  HWY_INLINE auto operator()(V right_in, V right_out) const {
    const V change = hn::Sub(difference(left_in_, right_in), difference(left_out_, right_out));
    return hn::BitCast(hn::RebindToSigned<D>(), change);
  }

 private:
  HWY_INLINE V difference(V a, V b) const {
    const V value = hn::Or(hn::SaturatedSub(a, b), hn::SaturatedSub(b, a));
    return kCut ? hn::Min(value, limit_) : value;
  }
  V left_in_, left_out_, limit_;
};

/// What a column's step from row to row, and that of the windows along the row, work on.
struct Slide {
  std::uint16_t* HWY_RESTRICT column;
  const std::uint16_t* before;   ///< window sums of the column before ...
  const std::uint16_t* leaving;  ///< ... the column sums that leave them ...
  std::uint16_t* windows;        ///< ... and the window sums that this makes
};

template <bool kWindows>
HWY_INLINE void add(const Slide& to, std::size_t i, hn::Vec<S16> change) {
  const D16 d;
  const V16 sum = hn::Add(hn::Load(d, to.column + i), hn::BitCast(d, change));
  hn::Store(sum, d, to.column + i);
  if (!kWindows) return;
  const V16 old = hn::Sub(hn::Load(d, to.before + i), hn::Load(d, to.leaving + i));
  hn::Store(hn::Add(old, sum), d, to.windows + i);
}

/// Column x, one row on. With `kWindows`, on to the window sums whose last column this is: those of
/// the column before, plus this column, less the one that leaves.
template <bool kCut, bool kWindows>
HWY_INLINE void slideColumn(const BlockLayout& layout, const BlockRow& row, int x, Slide to) {
  const std::size_t lanes = hn::Lanes(D16());
  const std::size_t cells = toSize(columnCells(layout, x));
  const std::size_t mirrored = toSize(layout.width - 1 - x + layout.min_disparity);
  const std::uint8_t* HWY_RESTRICT right_in = row.right_in + mirrored;
  const std::uint8_t* HWY_RESTRICT right_out = row.right_out + mirrored;
  const std::uint8_t left_in = row.left_in[x], left_out = row.left_out[x];
  const auto limit = static_cast<std::uint8_t>(layout.limit);
  to.column = row.columns + toSize(x) * toSize(layout.padded);
  std::size_t i = 0;
#if HWY_TARGET != HWY_SCALAR
  {
    const hn::Repartition<std::uint8_t, D16> d;
    const Change<kCut, decltype(d)> change(left_in, left_out, limit);
    for (; i + 2 * lanes <= cells; i += 2 * lanes) {
      const auto both = change(hn::LoadU(d, right_in + i), hn::LoadU(d, right_out + i));
      add<kWindows>(to, i, hn::PromoteTo(S16(), hn::LowerHalf(S8(), both)));
      add<kWindows>(to, i + lanes, hn::PromoteTo(S16(), hn::UpperHalf(S8(), both)));
    }
  }
#endif
  const D8 d;
  const Change<kCut, D8> change(left_in, left_out, limit);
  for (; i < cells; i += lanes) {
    const auto one = change(hn::LoadU(d, right_in + i), hn::LoadU(d, right_out + i));
    add<kWindows>(to, i, hn::PromoteTo(S16(), one));
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
    slideColumn<kCut, true>(layout, row, entering, {nullptr, before, leaving, now});
    return;
  }
  for (std::size_t i = 0; i < padded; i += lanes) {
    hn::Store(hn::Sub(hn::Load(d, before + i), hn::Load(d, leaving + i)), d, now + i);
  }
}

/// Lanes of v <= bound. Before AVX-512, unsigned numbers can only be compared for equality.
HWY_INLINE std::size_t countAtMost(V16 v, V16 bound) {
  const D16 d;
#if HWY_TARGET <= HWY_AVX3
  return hn::Lanes(d) - hn::CountTrue(d, hn::Gt(v, bound));
#else
  return hn::CountTrue(d, hn::Eq(hn::Min(v, bound), v));
#endif
}

/// The cost up to which another cell is too good beside the best one.
HWY_INLINE std::uint16_t closeCost(std::uint16_t least, int uniqueness) {
  const std::uint64_t slack = (static_cast<std::uint64_t>(least) * toSize(uniqueness)) >> 16;
  return static_cast<std::uint16_t>(
      std::min<std::uint64_t>(least + slack, static_cast<std::uint64_t>(kNoBlockCost - 1)));
}

/// The first cell that costs `least`; how many cost at most `bound`. Backwards and through all
/// cells, as leaving when it is found would be guessed wrong by the processor.
HWY_INLINE std::size_t findCost(const std::uint16_t* cost, std::size_t cells, std::uint16_t least,
                                std::uint16_t bound, std::size_t& close) {
  const D16 d;
  const std::size_t lanes = hn::Lanes(d);
  const V16 wanted = hn::Set(d, least), most = hn::Set(d, bound);
  std::size_t found = 0;
  for (std::size_t i = cells; i > 0;) {
    i -= lanes;
    const V16 v = hn::LoadU(d, cost + i);
    close += countAtMost(v, most);
    const auto at = hn::FindFirstTrue(d, hn::Eq(v, wanted));
    found = at >= 0 ? i + static_cast<std::size_t>(at) : found;
  }
  return found;
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
  const auto load = [&](std::size_t i) HWY_ATTR {
    const V16 value = hn::Load(d, middle + i);
    if (!kShift) return value;
    return hn::Min(value, hn::Min(hn::Load(d, before + i), hn::Load(d, after + i)));
  };
  const auto take = [&](std::size_t i, V16 value) HWY_ATTR {
    hn::StoreU(value, d, cost + i);
    best = hn::Min(best, value);
  };
  std::size_t i = 0;
  for (; i + lanes <= toSize(valid); i += lanes) take(i, load(i));
  const V16 end = hn::Set(d, static_cast<std::uint16_t>(valid));
  for (; i < toSize(cells); i += lanes) {
    const V16 cell = hn::Add(hn::Iota(d, 0), hn::Set(d, static_cast<std::uint16_t>(i)));
    take(i, hn::IfThenElse(hn::Lt(cell, end), load(i), hn::Set(d, kNoBlockCost)));
  }
  const std::uint16_t least = leastLane(d, best);
  const std::uint16_t bound = closeCost(least, std::max(0, row.uniqueness));
  std::size_t close = 0;
  const std::size_t found = findCost(cost, toSize(cells), least, bound, close);
  std::uint16_t* around = row.around + std::ptrdiff_t{3} * x;
  around[0] = found > 0 ? cost[found - 1] : kNoBlockCost;
  around[1] = least;
  around[2] = cost[found + 1];  // past the last cell: kNoBlockCost
  row.best[x] = static_cast<std::int16_t>(found);
  // The best one and its neighbours are no rivals of their own.
  const std::size_t own =
      toSize(around[0] <= bound) + toSize(least <= bound) + toSize(around[2] <= bound);
  row.ambiguous[x] = close > own ? 1 : 0;
}

/// A cost and the column it belongs to, lane by lane.
struct Best {
  V16 cost, column;
};

/// The cheaper one; `first` where they are equal.
HWY_INLINE Best cheaper(const Best& first, const Best& second) {
  const V16 cost = hn::Min(first.cost, second.cost);
  return {cost, hn::IfThenElse(hn::Eq(cost, first.cost), first.column, second.column)};
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
  const V16 one = hn::Set(d, 1), two = hn::Set(d, 2), three = hn::Set(d, 3);
  const V16 four = hn::Set(d, 4);
  for (std::size_t i = 0; i < toSize(cells + n - 1); i += lanes) {
    Best best{hn::LoadU(d, row.right_cost + start + i), hn::LoadU(d, row.right_column + start + i)};
    V16 column = hn::Set(d, static_cast<std::uint16_t>(first));
    const std::uint16_t* cost = row.costs + kCostPadding + i - toSize(n - 1);
    const auto costs = [&](std::size_t k)
                           HWY_ATTR { return hn::LoadU(d, cost + k * (stride + 1)); };
    int k = 0;
    for (; k + 4 <= n; k += 4, cost += 4 * (stride + 1)) {  // within four by small constants
      const Best early = cheaper({costs(0), hn::Zero(d)}, {costs(1), one});
      const Best late = cheaper({costs(2), two}, {costs(3), three});
      const Best of_four = cheaper(early, late);
      best = cheaper(best, {of_four.cost, hn::Add(of_four.column, column)});
      column = hn::Add(column, four);
    }
    for (; k < n; ++k, cost += stride + 1) {
      best = cheaper(best, {costs(0), column});
      column = hn::Add(column, one);
    }
    hn::StoreU(best.cost, d, row.right_cost + start + i);
    hn::StoreU(best.column, d, row.right_column + start + i);
  }
}

template <bool kCut>
void slideColumnsOf(const BlockLayout& layout, const BlockRow& row) {
  const int begin = std::max(0, layout.min_disparity - layout.radius - layout.shift);
  for (int x = begin; x < layout.width; ++x) {
    slideColumn<kCut, false>(layout, row, x, {});
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
