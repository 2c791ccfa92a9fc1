#include "stereo/semi_global_simd.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stereo/semi_global_simd.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace scanner::stereo::simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D8 = hn::ScalableTag<std::uint8_t>;
using D16 = hn::ScalableTag<std::uint16_t>;
using V8 = hn::Vec<D8>;
using V16 = hn::Vec<D16>;

HWY_INLINE std::size_t asSize(int value) { return static_cast<std::size_t>(value); }

template <int kPlanes>
HWY_INLINE void costPixel(const CellLayout& layout, const CostRow& row, std::size_t x) {
  const D8 d;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t mirrored = asSize(layout.width) - 1 - x + asSize(layout.min_disparity);
  const std::size_t padded = asSize(layout.padded);
  std::uint8_t* cost = row.cost + x * padded;
  for (std::size_t i = 0; i < padded; i += lanes) {
    const std::size_t at = mirrored + i;
    V8 sum = hn::Zero(d);
    for (int p = 0; p < kPlanes; ++p) {
      const V8 left = hn::Set(d, row.left_census[p][x]);
      const V8 right = hn::LoadU(d, row.right_census[p] + at);
      sum = hn::Add(sum, hn::PopulationCount(hn::Xor(left, right)));
    }
    for (int f = 0; f < 2; ++f) {
      const V8 left = hn::Set(d, row.left_value[f][x]);
      const V8 right = hn::LoadU(d, row.right_value[f] + at);
      const V8 difference = hn::Or(hn::SaturatedSub(left, right), hn::SaturatedSub(right, left));
      sum = hn::Add(sum, hn::Min(difference, hn::Set(d, static_cast<std::uint8_t>(row.limit[f]))));
    }
    const V8 outside = hn::LoadU(d, row.right_outside + at);
    sum = hn::Or(hn::AndNot(outside, sum), hn::And(outside, hn::Set(d, kOutsideCost)));
    hn::StoreU(hn::Or(sum, hn::LoadU(d, row.padding + i)), d, cost + i);
  }
}

template <int kPlanes>
void costRowOf(const CellLayout& layout, const CostRow& row) {
  for (std::size_t x = 0; x < asSize(layout.width); ++x) costPixel<kPlanes>(layout, row, x);
}

void costRow(const CellLayout& layout, const CostRow& row) {
  switch (row.census_planes) {
    case 1:
      return costRowOf<1>(layout, row);
    case 2:
      return costRowOf<2>(layout, row);
    case 3:
      return costRowOf<3>(layout, row);
    case 4:
      return costRowOf<4>(layout, row);
    case 5:
      return costRowOf<5>(layout, row);
    case 6:
      return costRowOf<6>(layout, row);
    case 7:
      return costRowOf<7>(layout, row);
    default:
      return costRowOf<8>(layout, row);
  }
}

#if HWY_TARGET == HWY_SCALAR
template <class D>
HWY_INLINE hn::TFromD<D> least(D /*d*/, hn::Vec<D> v) {
  return hn::GetLane(v);
}
#else
/// Least lane.
template <class D>
HWY_INLINE hn::TFromD<D> least(D d, hn::Vec<D> v) {
  if constexpr (hn::MaxLanes(D()) * sizeof(hn::TFromD<D>) > 16) {
    const hn::Half<D> half;
    return least(half, hn::Min(hn::LowerHalf(half, v), hn::UpperHalf(half, v)));
  } else {
    v = hn::Min(v, hn::ShiftRightBytes<8>(d, v));
    v = hn::Min(v, hn::ShiftRightBytes<4>(d, v));
    v = hn::Min(v, hn::ShiftRightBytes<2>(d, v));
    if constexpr (sizeof(hn::TFromD<D>) == 1) v = hn::Min(v, hn::ShiftRightBytes<1>(d, v));
    return hn::GetLane(v);
  }
}
#endif

/// One path at one pixel: Hirschmueller's recurrence (2008, eq. 13), in place.
struct Path {
  std::uint8_t* cells;
  std::uint8_t* slot_least;
  V8 small_step, large_step, before;  ///< large_step includes the least cell before
  V8 pending;
  V8 least_now;

  HWY_INLINE void start(std::uint8_t* slot, std::uint8_t* least_of_slot, int small, int large) {
    const D8 d;
    cells = slot;
    slot_least = least_of_slot;
    small_step = hn::Set(d, static_cast<std::uint8_t>(small));
    before = hn::Set(d, *slot_least);
    large_step = hn::Set(d, static_cast<std::uint8_t>(std::min(255, *slot_least + large)));
    least_now = hn::Set(d, kNoCost);
    pending = least_now;
  }
  /// Cells [i, i + lanes). They are stored one call later, as the next one reads the last of them.
  HWY_INLINE V8 advance(std::size_t i, V8 cost) {
    const D8 d;
    const V8 here = hn::LoadU(d, cells + i);
    const V8 beside = hn::Min(hn::LoadU(d, cells + i - 1), hn::LoadU(d, cells + i + 1));
    if (i > 0) hn::StoreU(pending, d, cells + i - hn::Lanes(d));
    const V8 best = hn::Min(hn::Min(here, large_step), hn::SaturatedAdd(beside, small_step));
    pending = hn::SaturatedAdd(cost, hn::SaturatedSub(best, before));
    least_now = hn::Min(least_now, pending);
    return pending;
  }
  HWY_INLINE void finish(std::size_t padded) {
    const D8 d;
    hn::StoreU(pending, d, cells + padded - hn::Lanes(d));
    *slot_least = HWY_NAMESPACE::least(d, least_now);
  }
};

/// Adds 8-bit cells to two vectors of 16-bit sums: the lower and the upper half of them. With one
/// lane there are no halves, and both are the same sum.
HWY_INLINE void accumulate(V8 cells, V16& low, V16& high) {
  const D16 d16;
#if HWY_TARGET == HWY_SCALAR
  low = hn::Add(low, hn::PromoteTo(d16, cells));
  high = low;
#else
  const hn::Half<D8> half;
  low = hn::Add(low, hn::PromoteTo(d16, hn::LowerHalf(half, cells)));
  high = hn::Add(high, hn::PromoteTo(d16, hn::UpperHalf(half, cells)));
#endif
}

HWY_INLINE std::size_t firstEqual(const std::uint16_t* sums, std::size_t count,
                                  std::uint16_t value) {
  const D16 d;
  const std::size_t lanes = hn::Lanes(d);
  const V16 wanted = hn::Set(d, value);
  for (std::size_t i = 0; i < count; i += lanes) {
    const std::intptr_t at = hn::FindFirstTrue(d, hn::Eq(hn::LoadU(d, sums + i), wanted));
    if (at >= 0) return i + static_cast<std::size_t>(at);
  }
  return 0;
}

HWY_INLINE std::size_t countBelow(const std::uint16_t* sums, std::size_t count,
                                  std::uint16_t bound) {
  const D16 d;
  const std::size_t lanes = hn::Lanes(d);
  const V16 limit = hn::Set(d, bound);
  std::size_t below = 0;
  for (std::size_t i = 0; i < count; i += lanes) {
    below += hn::CountTrue(d, hn::Lt(hn::LoadU(d, sums + i), limit));
  }
  return below;
}

/// Left pixels that selectRight() takes in one go. Going one pixel left moves the cells by one
/// element of the right row, and a load that is not aligned with the store just before it waits.
constexpr std::size_t kGroup = 4;

/// One cell of selectRight().
HWY_INLINE void offerRight(std::uint16_t sum, std::size_t index, std::uint16_t& best_sum,
                           std::uint16_t& best_index) {
  if (sum >= best_sum) return;
  best_sum = sum;
  best_index = static_cast<std::uint16_t>(index);
}

/// Keeps, for every right pixel that a cell of left pixels x, x - 1 ... (n of them) points to, the
/// better one.
HWY_INLINE void selectRight(const CellLayout& layout, const Selection& s, std::size_t x,
                            std::size_t n, const std::uint16_t* all_sums) {
  const D16 d;
  const std::size_t lanes = hn::Lanes(d), padded = asSize(layout.padded);
  const std::size_t first = asSize(layout.width) - 1 - x + asSize(layout.min_disparity);
  std::uint16_t* best_sum = s.right_sum + first;
  std::uint16_t* best_index = s.right_index + first;
  const std::uint16_t* sums = all_sums + x * padded;
  const std::size_t reach = n - 1;  // cells before it lack a candidate of some left pixel
  for (std::size_t k = 0; k < n; ++k) {
    const std::uint16_t* own = sums - k * padded;
    for (std::size_t i = 0; i + k < reach; ++i) {
      offerRight(own[i], i, best_sum[i + k], best_index[i + k]);
    }
  }
  for (std::size_t begin = reach; begin < padded; begin += lanes) {
    const std::size_t i = std::min(begin, padded - lanes);
    V16 best = hn::LoadU(d, best_sum + i);
    V16 index = hn::LoadU(d, best_index + i);
    for (std::size_t k = 0; k < n; ++k) {
      const V16 sum = hn::LoadU(d, sums - k * padded + i - k);
      const auto better = hn::Lt(sum, best);
      best = hn::Min(sum, best);
      index = hn::IfThenElse(better, hn::Iota(d, static_cast<std::uint16_t>(i - k)), index);
    }
    hn::StoreU(best, d, best_sum + i);
    hn::StoreU(index, d, best_index + i);
  }
  for (std::size_t k = 1; k < n; ++k) {
    const std::uint16_t* own = sums - k * padded;
    for (std::size_t i = padded - k; i < padded; ++i) {
      offerRight(own[i], i, best_sum[i + k], best_index[i + k]);
    }
  }
}

HWY_INLINE void selectLeft(const CellLayout& layout, const Selection& s, std::size_t x,
                           const std::uint16_t* sums, std::uint16_t least) {
  const std::uint16_t none = static_cast<std::uint16_t>(s.paths * kNoCost);
  std::uint16_t* around = s.around + 3 * x;
  around[0] = around[1] = around[2] = none;
  s.index[x] = kNone;
  if (least >= none) return;
  const std::size_t best = firstEqual(sums, asSize(layout.padded), least);
  const std::size_t min = asSize(layout.min_disparity);
  if (min + best > x) return;  // the match lies outside
  const std::size_t end = std::min(asSize(layout.count), x + 1 - min);
  around[1] = least;
  if (best > 0) around[0] = sums[best - 1];
  if (best + 1 < end) around[2] = sums[best + 1];
  s.index[x] = static_cast<std::int16_t>(best);
  if (s.uniqueness_percent < 0) return;
  // A rival lies further than one disparity away, and is not worse by the margin.
  const int bound = least * (100 + s.uniqueness_percent) / 100 + 1;
  const std::uint16_t limit = static_cast<std::uint16_t>(std::min<int>(bound, none));
  std::size_t near = around[0] < limit ? 2 : 1;
  if (best + 1 < asSize(layout.padded) && sums[best + 1] < limit) ++near;
  if (countBelow(sums, asSize(layout.padded), limit) > near) s.index[x] = kAmbiguous;
}

template <bool kFromAbove, bool kSelect>
HWY_INLINE void sweepPixel(const CellLayout& layout, const SweepRow& row, const Selection* s,
                           Path* paths, std::size_t x) {
  const D8 d;
  const D16 d16;
  constexpr int kPaths = kFromAbove ? 4 : 1;
  const std::size_t lanes = hn::Lanes(d), half = lanes / 2;
  const std::size_t padded = asSize(layout.padded);
  const std::uint8_t* cost = row.cost + x * padded;
  std::uint16_t* out = row.sums_out + x * padded;
  const std::uint16_t* in = row.sums_in == nullptr ? nullptr : row.sums_in + x * padded;
  V16 least_sum = hn::Set(d16, 0xFFFF);
  for (std::size_t i = 0; i < padded; i += lanes) {
    const V8 c = hn::LoadU(d, cost + i);
    V16 low = in == nullptr ? hn::Zero(d16) : hn::LoadU(d16, in + i);
    V16 high = in == nullptr ? hn::Zero(d16) : hn::LoadU(d16, in + i + half);
    for (int p = 0; p < kPaths; ++p) accumulate(paths[p].advance(i, c), low, high);
    hn::StoreU(low, d16, out + i);
    hn::StoreU(high, d16, out + i + half);
    if (kSelect) least_sum = hn::Min(least_sum, hn::Min(low, high));
  }
  for (int p = 0; p < kPaths; ++p) paths[p].finish(padded);
  if (kSelect) {
    selectLeft(layout, *s, x, out, least(d16, least_sum));
  }
}

HWY_INLINE int difference(std::uint8_t a, std::uint8_t b) { return a > b ? a - b : b - a; }

HWY_INLINE void clearSlot(const CellLayout& layout, const PathFamily& family, std::size_t slot) {
  std::uint8_t* cells = family.cells + slot * slotStride(layout);
  for (int i = 0; i < layout.padded; ++i) cells[i] = kNoCost;
  family.least[slot] = kNoCost;
}

template <bool kFromAbove, bool kSelect>
void sweepRowOf(const CellLayout& layout, const SweepRow& row, const Selection* s) {
  const std::size_t width = asSize(layout.width), stride = slotStride(layout);
  const std::size_t shift = row.step % width;
  clearSlot(layout, row.horizontal, 0);
  if (kFromAbove) {  // diagonals that enter the image from its side
    clearSlot(layout, row.vertical[0], (width - shift) % width);
    clearSlot(layout, row.vertical[2], (width - 1 + shift) % width);
  }
  for (std::size_t n = 0; n < width; ++n) {
    const std::size_t x = row.direction > 0 ? n : width - 1 - n;
    const std::uint8_t gray = row.gray[x];
    const std::uint8_t behind = n == 0 ? gray : row.gray[row.direction > 0 ? x - 1 : x + 1];
    Path paths[kFromAbove ? 4 : 1];
    paths[0].start(row.horizontal.cells, row.horizontal.least, row.small_step,
                   row.large_step[difference(gray, behind)]);
    if (kFromAbove) {
      // A diagonal keeps its slot, so the slot of a column moves by one with every row.
      const std::size_t slots[3] = {x >= shift ? x - shift : x + width - shift, x,
                                    x + shift < width ? x + shift : x + shift - width};
      for (std::size_t p = 0; p < 3; ++p) {
        const std::size_t from = std::min(width - 1, x + p - (x + p > 0 ? 1U : 0U));
        paths[p + 1].start(row.vertical[p].cells + slots[p] * stride,
                           row.vertical[p].least + slots[p], row.small_step,
                           row.large_step[difference(gray, row.previous_gray[from])]);
      }
    }
    sweepPixel<kFromAbove, kSelect>(layout, row, s, paths, x);
    if (!kSelect || (n % kGroup != kGroup - 1 && n + 1 < width)) continue;
    selectRight(layout, *s, x + n % kGroup, n % kGroup + 1, row.sums_out);
  }
}

void sweepRow(const CellLayout& layout, const SweepRow& row, const Selection* selection) {
  if (row.from_above) {
    if (selection != nullptr) return sweepRowOf<true, true>(layout, row, selection);
    return sweepRowOf<true, false>(layout, row, nullptr);
  }
  if (selection != nullptr) return sweepRowOf<false, true>(layout, row, selection);
  return sweepRowOf<false, false>(layout, row, nullptr);
}

}  // namespace HWY_NAMESPACE
}  // namespace scanner::stereo::simd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace scanner::stereo::simd {

HWY_EXPORT(costRow);
HWY_EXPORT(sweepRow);

void costRow(const CellLayout& layout, const CostRow& row) {
  HWY_DYNAMIC_DISPATCH(costRow)(layout, row);
}

void sweepRow(const CellLayout& layout, const SweepRow& row, const Selection* selection) {
  HWY_DYNAMIC_DISPATCH(sweepRow)(layout, row, selection);
}

}  // namespace scanner::stereo::simd
#endif
