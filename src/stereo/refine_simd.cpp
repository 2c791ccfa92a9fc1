#include "stereo/refine_simd.h"

#include <cstddef>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stereo/refine_simd.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace scanner::stereo::simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Df = hn::ScalableTag<float>;
using Di = hn::RebindToSigned<Df>;
using Vf = hn::Vec<Df>;

/// Neighbours whose mean is this far from the centre belong to another surface...
constexpr float kSameSurfacePx = 2.0f;
/// ... and so do two that differ by this much.
constexpr float kLargestDifferencePx = 6.0f;
/// A larger slope of the disparity along the row is a step or noise.
constexpr float kSteepest = 0.7f;

HWY_INLINE Vf set(float value) { return hn::Set(Df(), value); }

/// Adds the pair to the sum where it belongs to the centre's surface (false for NaN).
HWY_INLINE void addPair(Vf centre, Vf before, Vf after, Vf& sum, Vf& pairs) {
  const Vf bend = hn::Sub(hn::Add(before, after), hn::Add(centre, centre));
  const auto same = hn::And(hn::Le(hn::Abs(bend), set(kSameSurfacePx)),
                            hn::Le(hn::Abs(hn::Sub(before, after)), set(kLargestDifferencePx)));
  sum = hn::Add(sum, hn::IfThenElseZero(same, bend));
  pairs = hn::Add(pairs, hn::IfThenElseZero(same, set(2.0f)));
}

HWY_INLINE Vf pairMean(Vf centre, Vf sum, Vf pairs) {
  return hn::Add(centre, hn::Div(sum, hn::Add(pairs, set(2.0f))));
}

void smoothAlong(const float* in, int width, int radius, float* out) {
  const Df d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int x = 0; x < width; x += lanes) {
    const Vf centre = hn::LoadU(d, in + x);
    Vf sum = hn::Zero(d), pairs = hn::Zero(d);
    for (int k = 1; k <= radius; ++k) {
      addPair(centre, hn::LoadU(d, in + x - k), hn::LoadU(d, in + x + k), sum, pairs);
    }
    hn::StoreU(pairMean(centre, sum, pairs), d, out + x);
  }
}

void smoothAcross(const float* const* rows, int width, int radius, float* out) {
  const Df d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int x = 0; x < width; x += lanes) {
    const Vf centre = hn::LoadU(d, rows[radius] + x);
    Vf sum = hn::Zero(d), pairs = hn::Zero(d);
    for (int k = 1; k <= radius; ++k) {
      addPair(centre, hn::LoadU(d, rows[radius - k] + x), hn::LoadU(d, rows[radius + k] + x), sum,
              pairs);
    }
    hn::StoreU(pairMean(centre, sum, pairs), d, out + x);
  }
}

/// Cubic convolution (Keys, a = -1/2) at b + t.
HWY_INLINE Vf sample(Vf a, Vf b, Vf c, Vf e, Vf t) {
  const Vf half = set(0.5f);
  const Vf c1 = hn::Mul(half, hn::Sub(c, a));
  const Vf c2 =
      hn::Sub(hn::Add(a, hn::Add(c, c)), hn::Add(hn::Mul(set(2.5f), b), hn::Mul(half, e)));
  const Vf c3 = hn::Add(hn::Mul(half, hn::Sub(e, a)), hn::Mul(set(1.5f), hn::Sub(b, c)));
  return hn::Add(b, hn::Mul(t, hn::Add(c1, hn::Mul(t, hn::Add(c2, hn::Mul(t, c3))))));
}

/// How much longer a piece of surface is in the left image than in the right one, 1 - d_x.
HWY_INLINE Vf stretch(const float* disparity) {
  const Df d;
  const Vf rise = hn::Sub(hn::LoadU(d, disparity + 1), hn::LoadU(d, disparity - 1));
  const auto known = hn::Le(hn::Abs(rise), set(2.0f * kSteepest));  // false for NaN
  return hn::Sub(set(1.0f), hn::IfThenElseZero(known, hn::Mul(set(0.5f), rise)));
}

void warpRow(const float* disparity, const float* left, const float* right, int width,
             float* const* terms) {
  const Df d;
  const Di di;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const Vf first = set(1.0f), last = set(static_cast<float>(width - 2));
  for (int x = 0; x < width; x += lanes) {
    const Vf column = hn::ConvertTo(d, hn::Iota(di, x));
    const Vf at = hn::Sub(column, hn::LoadU(d, disparity + x));
    const auto inside = hn::And(hn::And(hn::Ge(at, first), hn::Lt(at, last)),
                                hn::And(hn::Ge(column, set(2.0f)), hn::Lt(column, last)));
    const Vf safe = hn::IfThenElse(inside, at, first);
    const auto index = hn::ConvertTo(di, safe);  // towards zero; safe is positive
    const Vf t = hn::Sub(safe, hn::ConvertTo(d, index));
    const Vf value =
        sample(hn::GatherIndex(d, right - 1, index), hn::GatherIndex(d, right, index),
               hn::GatherIndex(d, right + 1, index), hn::GatherIndex(d, right + 2, index), t);
    const auto valid = hn::And(inside, hn::Eq(value, value));
    const Vf near = hn::Sub(hn::LoadU(d, left + x + 1), hn::LoadU(d, left + x - 1));
    const Vf wide = hn::Sub(hn::LoadU(d, left + x + 2), hn::LoadU(d, left + x - 2));
    const Vf left_slope =
        hn::Sub(hn::Mul(set(2.0f / 3.0f), near), hn::Mul(set(1.0f / 12.0f), wide));
    const Vf g = hn::IfThenElseZero(valid, hn::Neg(hn::Div(left_slope, stretch(disparity + x))));
    const Vf r = hn::IfThenElseZero(valid, value);
    const Vf e = hn::IfThenElseZero(valid, hn::Sub(hn::LoadU(d, left + x), value));
    hn::StoreU(hn::IfThenElseZero(valid, set(1.0f)), d, terms[kCount] + x);
    hn::StoreU(g, d, terms[kG] + x);
    hn::StoreU(r, d, terms[kR] + x);
    hn::StoreU(e, d, terms[kE] + x);
    hn::StoreU(hn::Mul(g, g), d, terms[kGG] + x);
    hn::StoreU(hn::Mul(g, r), d, terms[kGR] + x);
    hn::StoreU(hn::Mul(r, r), d, terms[kRR] + x);
    hn::StoreU(hn::Mul(g, e), d, terms[kGE] + x);
    hn::StoreU(hn::Mul(r, e), d, terms[kRE] + x);
    hn::StoreU(hn::Mul(e, e), d, terms[kEE] + x);
  }
}

void sumAcross(const float* const* rows, int term_count, int window, int width,
               float* const* sums) {
  const Df d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int term = 0; term < term_count; ++term) {
    const float* const* of_term = rows + static_cast<std::ptrdiff_t>(term) * window;
    for (int x = 0; x < width; x += lanes) {
      Vf sum = hn::LoadU(d, of_term[0] + x);
      for (int i = 1; i < window; ++i) sum = hn::Add(sum, hn::LoadU(d, of_term[i] + x));
      hn::StoreU(sum, d, sums[term] + x);
    }
  }
}

HWY_INLINE Vf sumAlong(const float* row, int window) {
  const Df d;
  Vf sum = hn::LoadU(d, row - window / 2);
  for (int i = 1; i < window; ++i) sum = hn::Add(sum, hn::LoadU(d, row - window / 2 + i));
  return sum;
}

void solveRow(const SolveRow& row) {
  const Df d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const Vf none = set(__builtin_nanf(""));
  for (int x = 0; x < row.width; x += lanes) {
    Vf s[kRefineTerms];
    for (int k = 0; k < kRefineTerms; ++k) s[k] = sumAlong(row.sums[k] + x, row.window);
    const Vf n = s[kCount];
    const Vf share = hn::Div(set(1.0f), hn::Max(n, set(1.0f)));
    const Vf g = hn::Mul(s[kG], share), r = hn::Mul(s[kR], share), e = hn::Mul(s[kE], share);
    Vf gg = hn::Sub(s[kGG], hn::Mul(s[kG], g));
    Vf ge = hn::Sub(s[kGE], hn::Mul(s[kG], e));
    Vf ee = hn::Sub(s[kEE], hn::Mul(s[kE], e));
    const Vf rr = hn::Sub(s[kRR], hn::Mul(s[kR], r));
    const Vf gr = hn::Sub(s[kGR], hn::Mul(s[kG], r));
    const Vf re = hn::Sub(s[kRE], hn::Mul(s[kR], e));
    // A gain is only visible in a window with contrast.
    const Vf inverse = hn::IfThenElseZero(hn::Gt(rr, n), hn::Div(set(1.0f), rr));
    const Vf by_g = hn::Mul(gr, inverse);
    gg = hn::Sub(gg, hn::Mul(by_g, gr));
    ge = hn::Sub(ge, hn::Mul(by_g, re));
    ee = hn::Sub(ee, hn::Mul(hn::Mul(re, inverse), re));
    const Vf start = hn::LoadU(d, row.disparity + x);
    const auto solved =
        hn::And(hn::And(hn::Ge(n, set(row.min_count)), hn::Gt(gg, hn::Mul(set(1e-4f), n))),
                hn::Eq(start, start));
    const Vf delta = hn::IfThenElseZero(solved, hn::Div(ge, hn::IfThenElse(solved, gg, n)));
    const Vf step = hn::Max(hn::Min(delta, set(row.max_step)), set(-row.max_step));
    hn::StoreU(hn::IfThenElse(solved, hn::Add(start, step), none), d, row.next + x);
    if (row.variance == nullptr) continue;
    const Vf freedom = hn::Max(hn::Sub(n, set(3.0f)), set(1.0f));
    const Vf residual = hn::Div(hn::Max(hn::Sub(ee, hn::Mul(delta, ge)), hn::Zero(d)), freedom);
    const Vf contrast = hn::Mul(hn::Max(rr, hn::Zero(d)), share);
    const Vf limit = hn::Add(set(row.max_residual), hn::Mul(set(row.max_residual_share), contrast));
    const auto good = hn::And(solved, hn::Le(residual, limit));
    const Vf variance =
        hn::Div(hn::Max(residual, set(row.noise_variance)), hn::IfThenElse(good, gg, set(1.0f)));
    hn::StoreU(hn::IfThenElse(good, variance, none), d, row.variance + x);
    hn::StoreU(hn::IfThenElse(solved, step, none), d, row.step + x);
  }
}

void roughnessRow(const float* step, const float* before, const float* after, int width,
                  float* const* terms) {
  const Df d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int x = 0; x < width; x += lanes) {
    const Vf moved = hn::LoadU(d, step + x);
    const Vf change = hn::Sub(hn::LoadU(d, after + x), hn::LoadU(d, before + x));
    const auto counts = hn::And(hn::Eq(moved, moved), hn::Eq(change, change));
    hn::StoreU(hn::IfThenElseZero(counts, set(1.0f)), d, terms[0] + x);
    hn::StoreU(hn::IfThenElseZero(counts, hn::Mul(moved, moved)), d, terms[1] + x);
    hn::StoreU(hn::IfThenElseZero(counts, hn::Mul(change, change)), d, terms[2] + x);
  }
}

void finishRow(const FinishRow& row) {
  const Df d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const Vf none = set(__builtin_nanf(""));
  for (int x = 0; x < row.width; x += lanes) {
    const Vf count = hn::Max(sumAlong(row.sums[0] + x, row.window), set(1.0f));
    const Vf steps = hn::Div(sumAlong(row.sums[1] + x, row.window), count);
    const Vf changes = hn::Div(sumAlong(row.sums[2] + x, row.window), count);
    const Vf noise = hn::Mul(set(row.noise_gain), hn::LoadU(d, row.variance + x));
    const Vf shape =
        hn::Add(hn::Mul(set(row.step_gain), steps), hn::Mul(set(row.roughness_gain), changes));
    const Vf fitted = hn::Add(hn::Add(noise, shape), set(row.floor_variance));
    const Vf tail = hn::Mul(fitted, set(row.inverse_tail));
    const Vf variance = hn::Mul(fitted, hn::Add(set(1.0f), tail));
    const Vf refined = hn::LoadU(d, row.refined + x);
    const Vf moved = hn::Abs(hn::Sub(refined, hn::LoadU(d, row.start + x)));
    const auto good = hn::And(hn::Le(moved, set(row.max_correction)), hn::Eq(variance, variance));
    hn::StoreU(hn::IfThenElse(good, refined, none), d, row.disparity + x);
    hn::StoreU(hn::IfThenElse(good, hn::Sqrt(variance), none), d, row.sigma + x);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace scanner::stereo::simd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace scanner::stereo::simd {

HWY_EXPORT(smoothAlong);
HWY_EXPORT(smoothAcross);
HWY_EXPORT(warpRow);
HWY_EXPORT(sumAcross);
HWY_EXPORT(solveRow);
HWY_EXPORT(roughnessRow);
HWY_EXPORT(finishRow);

void smoothAlong(const float* in, int width, int radius, float* out) {
  HWY_DYNAMIC_DISPATCH(smoothAlong)(in, width, radius, out);
}
void smoothAcross(const float* const* rows, int width, int radius, float* out) {
  HWY_DYNAMIC_DISPATCH(smoothAcross)(rows, width, radius, out);
}
void warpRow(const float* disparity, const float* left, const float* right, int width,
             float* const* terms) {
  HWY_DYNAMIC_DISPATCH(warpRow)(disparity, left, right, width, terms);
}
void sumAcross(const float* const* rows, int term_count, int window, int width,
               float* const* sums) {
  HWY_DYNAMIC_DISPATCH(sumAcross)(rows, term_count, window, width, sums);
}
void roughnessRow(const float* step, const float* before, const float* after, int width,
                  float* const* terms) {
  HWY_DYNAMIC_DISPATCH(roughnessRow)(step, before, after, width, terms);
}
void finishRow(const FinishRow& row) { HWY_DYNAMIC_DISPATCH(finishRow)(row); }
void solveRow(const SolveRow& row) { HWY_DYNAMIC_DISPATCH(solveRow)(row); }

}  // namespace scanner::stereo::simd
#endif
