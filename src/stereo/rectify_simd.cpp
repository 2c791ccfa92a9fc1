#include "stereo/rectify_simd.h"

#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stereo/rectify_simd.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace scanner::stereo::simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D16 = hn::ScalableTag<std::int16_t>;
using V16 = hn::Vec<D16>;
using DU16 = hn::ScalableTag<std::uint16_t>;
using D32 = hn::ScalableTag<std::int32_t>;
using V32 = hn::Vec<D32>;
using D8H = hn::Rebind<std::uint8_t, D16>;  ///< as many bytes as there are words

HWY_INLINE V16 load16(const std::uint8_t* from) {
  return hn::PromoteTo(D16(), hn::LoadU(D8H(), from));
}

HWY_INLINE void storeGray(V16 gray, std::uint16_t* to) {
  hn::StoreU(hn::BitCast(DU16(), gray), DU16(), to);
}

HWY_INLINE V16 binomial(V16 a, V16 b, V16 c) { return hn::Add(hn::Add(a, c), hn::Add(b, b)); }

void binomialRow(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* below,
                 std::size_t count, std::uint16_t* gray) {
  const auto column = [&](std::size_t u, std::ptrdiff_t shift) HWY_ATTR {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(u) + shift;
    return binomial(load16(above + at), load16(here + at), load16(below + at));
  };
  for (std::size_t u = 0; u < count; u += hn::Lanes(D16())) {
    storeGray(binomial(column(u, -1), column(u, 0), column(u, 1)), gray + u);
  }
}

void scaleMonoRow(const std::uint8_t* mono, std::size_t count, std::uint16_t* gray) {
  const std::size_t lanes = hn::Lanes(D16());
  std::size_t u = 0;
  for (; u + lanes <= count; u += lanes) storeGray(hn::ShiftLeft<4>(load16(mono + u)), gray + u);
  for (; u < count; ++u) gray[u] = static_cast<std::uint16_t>(mono[u] << 4);
}

// Small change against the rest of the work: left to the compiler.
void splitBgrRow(const std::uint8_t* bgr, std::size_t count, std::uint16_t* gray,
                 std::uint8_t* bgrx) {
  for (std::size_t u = 0; u < count; ++u) {
    const std::uint32_t b = bgr[3 * u], g = bgr[3 * u + 1], r = bgr[3 * u + 2];
    gray[u] = static_cast<std::uint16_t>((3736 * b + 19235 * g + 9797 * r + 1024) >> 11);
    if (bgrx == nullptr) continue;
    bgrx[4 * u] = bgr[3 * u];
    bgrx[4 * u + 1] = bgr[3 * u + 1];
    bgrx[4 * u + 2] = bgr[3 * u + 2];
    bgrx[4 * u + 3] = 0;
  }
}

void roundGrayRow(const std::uint16_t* gray, std::size_t count, std::uint8_t* to) {
  const D16 d;
  for (std::size_t u = 0; u < count; u += hn::Lanes(d)) {
    const V16 value = hn::BitCast(d, hn::LoadU(DU16(), gray + u));
    const V16 rounded = hn::ShiftRight<4>(hn::Add(value, hn::Set(d, 8)));
    hn::StoreU(hn::DemoteTo(D8H(), rounded), D8H(), to + u);
  }
}

/// Four times green between a and b of a site with value c and its like-coloured neighbours, and
/// how much changes in that direction.
struct Direction {
  V16 green4, change;
};

HWY_INLINE Direction alongDirection(V16 a, V16 b, V16 c, V16 before, V16 after) {
  const V16 second = hn::Sub(hn::Add(c, c), hn::Add(before, after));
  const V16 sum = hn::Add(a, b);
  return {hn::Add(hn::Add(sum, sum), second), hn::Add(hn::Abs(hn::Sub(a, b)), hn::Abs(second))};
}

void greenRow(const std::uint8_t* const rows[5], std::size_t count, bool green_first,
              std::int16_t* green) {
  const D16 d;
  const std::int16_t green_parity = green_first ? 0 : 1;
  for (std::size_t u = 0; u < count; u += hn::Lanes(d)) {
    const std::uint8_t* here = rows[2] + u;
    const V16 c = load16(here);
    const Direction h =
        alongDirection(load16(here - 1), load16(here + 1), c, load16(here - 2), load16(here + 2));
    const Direction v = alongDirection(load16(rows[1] + u), load16(rows[3] + u), c,
                                       load16(rows[0] + u), load16(rows[4] + u));
    const V16 both = hn::ShiftRight<1>(hn::Add(h.green4, v.green4));
    V16 g = hn::IfThenElse(hn::Lt(h.change, v.change), h.green4, both);
    g = hn::IfThenElse(hn::Lt(v.change, h.change), v.green4, g);
    g = hn::ShiftRight<2>(hn::Add(g, hn::Set(d, 2)));
    g = hn::Min(hn::Max(g, hn::Zero(d)), hn::Set(d, 255));
    const V16 parity = hn::And(hn::Iota(d, static_cast<std::int16_t>(u & 1)), hn::Set(d, 1));
    g = hn::IfThenElse(hn::Eq(parity, hn::Set(d, green_parity)), c, g);
    hn::StoreU(g, d, green + u);
  }
}

void chromaRow(const std::uint8_t* raw, const std::int16_t* green, std::size_t count,
               std::int16_t* chroma) {
  const D16 d;
  const auto difference = [&](std::ptrdiff_t at) HWY_ATTR {
    return hn::Sub(load16(raw + at), hn::LoadU(d, green + at));  // 0 at green sites
  };
  for (std::size_t u = 0; u < count; u += hn::Lanes(d)) {
    const auto at = static_cast<std::ptrdiff_t>(u);
    hn::StoreU(binomial(difference(at - 1), difference(at), difference(at + 1)), d, chroma + u);
  }
}

void mixRow(const std::int16_t* green, const std::int16_t* above, const std::int16_t* own,
            const std::int16_t* below, std::size_t count, bool red_row, std::uint8_t* bgrx) {
  const D16 d;
  const D8H d8;
  for (std::size_t u = 0; u < count; u += hn::Lanes(d)) {
    const V16 g = hn::LoadU(d, green + u);
    const V16 sum = hn::Add(hn::LoadU(d, above + u), hn::LoadU(d, below + u));
    const V16 mine = hn::Add(g, hn::ShiftRight<1>(hn::Add(hn::LoadU(d, own + u), hn::Set(d, 1))));
    const V16 other = hn::Add(g, hn::ShiftRight<2>(hn::Add(sum, hn::Set(d, 2))));
    const auto first = hn::DemoteTo(d8, red_row ? other : mine);
    const auto last = hn::DemoteTo(d8, red_row ? mine : other);
    hn::StoreInterleaved4(first, hn::DemoteTo(d8, g), last, hn::Zero(d8), d8, bgrx + 4 * u);
  }
}

#if HWY_TARGET == HWY_SCALAR

// One lane has no pairs of words to multiply and add: the same sums, written out.
HWY_INLINE std::int32_t pairSum(std::int32_t weights, std::int32_t a, std::int32_t b) {
  const std::int32_t first = static_cast<std::int16_t>(weights & 0xFFFF);
  return first * a + (weights >> 16) * b;
}

void cubicGrayRow(const ResampleRow& row, const CubicWeights& weights, const std::uint16_t* gray,
                  std::size_t count, std::uint8_t* to) {
  for (std::size_t u = 0; u < count; ++u) {
    const std::uint32_t fx = row.phase[u] & 0xFFFFU, fy = row.phase[u] >> 16;
    std::int32_t h[4];
    for (std::size_t j = 0; j < 4; ++j) {
      const std::uint16_t* p = gray + row.index[u] + j * row.stride;
      h[j] = (pairSum(weights.first[fx], p[0], p[1]) + pairSum(weights.second[fx], p[2], p[3]) +
              (1 << 11)) >>
             12;
    }
    const std::int32_t value = (pairSum(weights.first[fy], h[0], h[1]) +
                                pairSum(weights.second[fy], h[2], h[3]) + (1 << 19)) >>
                               20;
    to[u] = static_cast<std::uint8_t>(value < 0 ? 0 : value > 255 ? 255 : value);
  }
}

HWY_INLINE std::int32_t mixed(std::int32_t a, std::int32_t b, std::int32_t weight) {
  return a + (((b - a) * weight + (1 << 14)) >> 15);
}

void bilinearColorRow(const ResampleRow& row, const std::uint8_t* bgrx, const std::uint8_t* valid,
                      std::size_t count, std::uint8_t* to_bgrx) {
  for (std::size_t u = 0; u < count; ++u) {
    const auto fx = static_cast<std::int32_t>((row.phase[u] & 0xFFFFU) << (15 - kPhaseBits));
    const auto fy = static_cast<std::int32_t>((row.phase[u] >> 16) << (15 - kPhaseBits));
    const std::uint8_t* p = bgrx + 4 * (static_cast<std::size_t>(row.index[u]) + row.stride + 1);
    const std::uint8_t* q = p + 4 * row.stride;
    for (std::size_t c = 0; c < 4; ++c) {
      const std::int32_t top = mixed(p[c] << 7, p[c + 4] << 7, fx);
      const std::int32_t bottom = mixed(q[c] << 7, q[c + 4] << 7, fx);
      const std::int32_t value = (mixed(top, bottom, fy) + 64) >> 7;
      to_bgrx[4 * u + c] = valid[u] == 0 ? std::uint8_t{0} : static_cast<std::uint8_t>(value);
    }
  }
}

#else

/// Each 32-bit lane: the sum of the products of its two words.
HWY_INLINE V32 addPairProducts(V32 sum, V32 a, V32 b) {
  const D32 d;
  V32 unused = hn::Zero(d);  // this width of vector keeps all sums in one
  return hn::ReorderWidenMulAccumulate(d, hn::BitCast(D16(), a), hn::BitCast(D16(), b), sum,
                                       unused);
}

HWY_INLINE V32 gatherPair(const std::uint16_t* base, V32 offset) {
  return hn::GatherOffset(D32(), reinterpret_cast<const std::int32_t*>(base), offset);
}

void cubicGrayRow(const ResampleRow& row, const CubicWeights& weights, const std::uint16_t* gray,
                  std::size_t count, std::uint8_t* to) {
  const D32 d;
  const hn::Rebind<std::uint8_t, D32> d8;
  const hn::Rebind<std::uint32_t, D32> du;
  const V32 low_word = hn::Set(d, 0xFFFF);
  for (std::size_t u = 0; u < count; u += hn::Lanes(d)) {
    const V32 offset = hn::ShiftLeft<1>(hn::LoadU(d, row.index + u));
    const V32 phase = hn::BitCast(d, hn::LoadU(du, row.phase + u));
    const V32 fx = hn::And(phase, low_word), fy = hn::ShiftRight<16>(phase);
    const V32 x01 = hn::GatherIndex(d, weights.first, fx);
    const V32 x23 = hn::GatherIndex(d, weights.second, fx);
    const auto line = [&](std::size_t j) HWY_ATTR {
      const std::uint16_t* base = gray + j * row.stride;
      V32 sum = addPairProducts(hn::Set(d, 1 << 11), gatherPair(base, offset), x01);
      sum = addPairProducts(sum, gatherPair(base + 2, offset), x23);
      return hn::ShiftRight<12>(sum);  // 64ths of a grey level: a word holds them
    };
    const V32 h01 = hn::Or(hn::And(line(0), low_word), hn::ShiftLeft<16>(line(1)));
    const V32 h23 = hn::Or(hn::And(line(2), low_word), hn::ShiftLeft<16>(line(3)));
    V32 sum = addPairProducts(hn::Set(d, 1 << 19), h01, hn::GatherIndex(d, weights.first, fy));
    sum = addPairProducts(sum, h23, hn::GatherIndex(d, weights.second, fy));
    hn::StoreU(hn::DemoteTo(d8, hn::ShiftRight<20>(sum)), d8, to + u);
  }
}

HWY_INLINE V16 mixed(V16 a, V16 b, V16 weight) {
  return hn::Add(a, hn::MulFixedPoint15(hn::Sub(b, a), weight));
}

void bilinearColorRow(const ResampleRow& row, const std::uint8_t* bgrx, const std::uint8_t* valid,
                      std::size_t count, std::uint8_t* to_bgrx) {
  const D32 d;
  const D16 d16;
  const hn::Rebind<std::uint8_t, D32> d8;
  const hn::Rebind<std::uint32_t, D32> du;
  const V32 low_word = hn::Set(d, 0xFFFF), bytes = hn::Set(d, 0x00FF00FF);
  const auto* pixels = reinterpret_cast<const std::int32_t*>(bgrx) + row.stride + 1;
  const auto twice = [&](V32 weight) HWY_ATTR {
    const V32 scaled = hn::ShiftLeft<15 - kPhaseBits>(weight);
    return hn::BitCast(d16, hn::Or(scaled, hn::ShiftLeft<16>(scaled)));
  };
  for (std::size_t u = 0; u < count; u += hn::Lanes(d)) {
    const V32 index = hn::LoadU(d, row.index + u);
    const V32 phase = hn::BitCast(d, hn::LoadU(du, row.phase + u));
    const V16 fx = twice(hn::And(phase, low_word)), fy = twice(hn::ShiftRight<16>(phase));
    const V32 p0 = hn::GatherIndex(d, pixels, index);
    const V32 p1 = hn::GatherIndex(d, pixels + 1, index);
    const V32 q0 = hn::GatherIndex(d, pixels + row.stride, index);
    const V32 q1 = hn::GatherIndex(d, pixels + row.stride + 1, index);
    // Two channels at a time, each in a word of the pixel's lane.
    const auto channels = [&](V32 v) HWY_ATTR {
      return hn::BitCast(d16, hn::ShiftLeft<7>(hn::And(v, bytes)));
    };
    const auto interpolated = [&](V32 a, V32 b, V32 c, V32 e) HWY_ATTR {
      const V16 value =
          mixed(mixed(channels(a), channels(b), fx), mixed(channels(c), channels(e), fx), fy);
      return hn::BitCast(d, hn::ShiftRight<7>(hn::Add(value, hn::Set(d16, 64))));
    };
    const V32 even = interpolated(p0, p1, q0, q1);
    const V32 odd = interpolated(hn::ShiftRight<8>(p0), hn::ShiftRight<8>(p1),
                                 hn::ShiftRight<8>(q0), hn::ShiftRight<8>(q1));
    const V32 known = hn::PromoteTo(d, hn::LoadU(d8, valid + u));
    const V32 pixel = hn::Or(even, hn::ShiftLeft<8>(odd));
    hn::StoreU(hn::IfThenElseZero(hn::Gt(known, hn::Zero(d)), pixel), d,
               reinterpret_cast<std::int32_t*>(to_bgrx) + u);
  }
}

#endif

void packBgrRow(const std::uint8_t* bgrx, std::size_t count, std::uint8_t* bgr) {
  const hn::ScalableTag<std::uint8_t> d;
  const std::size_t lanes = hn::Lanes(d);
  std::size_t u = 0;
  for (; u + lanes <= count; u += lanes) {
    hn::Vec<decltype(d)> b, g, r, x;
    hn::LoadInterleaved4(d, bgrx + 4 * u, b, g, r, x);
    hn::StoreInterleaved3(b, g, r, d, bgr + 3 * u);
  }
  for (; u < count; ++u) std::memcpy(bgr + 3 * u, bgrx + 4 * u, 3);
}

void replicateGrayRow(const std::uint8_t* gray, std::size_t count, std::uint8_t* bgr) {
  const hn::ScalableTag<std::uint8_t> d;
  const std::size_t lanes = hn::Lanes(d);
  std::size_t u = 0;
  for (; u + lanes <= count; u += lanes) {
    const auto v = hn::LoadU(d, gray + u);
    hn::StoreInterleaved3(v, v, v, d, bgr + 3 * u);
  }
  for (; u < count; ++u) std::memset(bgr + 3 * u, gray[u], 3);
}

}  // namespace HWY_NAMESPACE
}  // namespace scanner::stereo::simd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace scanner::stereo::simd {

HWY_EXPORT(binomialRow);
HWY_EXPORT(scaleMonoRow);
HWY_EXPORT(splitBgrRow);
HWY_EXPORT(roundGrayRow);
HWY_EXPORT(greenRow);
HWY_EXPORT(chromaRow);
HWY_EXPORT(mixRow);
HWY_EXPORT(cubicGrayRow);
HWY_EXPORT(bilinearColorRow);
HWY_EXPORT(packBgrRow);
HWY_EXPORT(replicateGrayRow);

void binomialRow(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* below,
                 std::size_t count, std::uint16_t* gray) {
  HWY_DYNAMIC_DISPATCH(binomialRow)(above, here, below, count, gray);
}
void scaleMonoRow(const std::uint8_t* mono, std::size_t count, std::uint16_t* gray) {
  HWY_DYNAMIC_DISPATCH(scaleMonoRow)(mono, count, gray);
}
void splitBgrRow(const std::uint8_t* bgr, std::size_t count, std::uint16_t* gray,
                 std::uint8_t* bgrx) {
  HWY_DYNAMIC_DISPATCH(splitBgrRow)(bgr, count, gray, bgrx);
}
void roundGrayRow(const std::uint16_t* gray, std::size_t count, std::uint8_t* to) {
  HWY_DYNAMIC_DISPATCH(roundGrayRow)(gray, count, to);
}
void greenRow(const std::uint8_t* const rows[5], std::size_t count, bool green_first,
              std::int16_t* green) {
  HWY_DYNAMIC_DISPATCH(greenRow)(rows, count, green_first, green);
}
void chromaRow(const std::uint8_t* raw, const std::int16_t* green, std::size_t count,
               std::int16_t* chroma) {
  HWY_DYNAMIC_DISPATCH(chromaRow)(raw, green, count, chroma);
}
void mixRow(const std::int16_t* green, const std::int16_t* above, const std::int16_t* own,
            const std::int16_t* below, std::size_t count, bool red_row, std::uint8_t* bgrx) {
  HWY_DYNAMIC_DISPATCH(mixRow)(green, above, own, below, count, red_row, bgrx);
}
void cubicGrayRow(const ResampleRow& row, const CubicWeights& weights, const std::uint16_t* gray,
                  std::size_t count, std::uint8_t* to) {
  HWY_DYNAMIC_DISPATCH(cubicGrayRow)(row, weights, gray, count, to);
}
void bilinearColorRow(const ResampleRow& row, const std::uint8_t* bgrx, const std::uint8_t* valid,
                      std::size_t count, std::uint8_t* to_bgrx) {
  HWY_DYNAMIC_DISPATCH(bilinearColorRow)(row, bgrx, valid, count, to_bgrx);
}
void packBgrRow(const std::uint8_t* bgrx, std::size_t count, std::uint8_t* bgr) {
  HWY_DYNAMIC_DISPATCH(packBgrRow)(bgrx, count, bgr);
}
void replicateGrayRow(const std::uint8_t* gray, std::size_t count, std::uint8_t* bgr) {
  HWY_DYNAMIC_DISPATCH(replicateGrayRow)(gray, count, bgr);
}

}  // namespace scanner::stereo::simd
#endif
