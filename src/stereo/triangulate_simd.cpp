#include "stereo/triangulate_simd.h"

#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stereo/triangulate_simd.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace scanner::stereo::simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Double: the offset and f B have more digits than a float, and the quotient is rounded once.
template <class D>
HWY_INLINE void triangulatePixels(D d, const TriangulateRow& row, std::size_t u) {
  const hn::Rebind<float, D> df;
  const auto disparity =
      hn::Sub(hn::PromoteTo(d, hn::LoadU(df, row.disparity_px + u)), hn::Set(d, row.offset_px));
  const auto z = hn::Div(hn::Set(d, row.focal_baseline), disparity);
  // Every comparison with NaN is false.
  const auto known = hn::And(
      hn::Gt(disparity, hn::Zero(d)),
      hn::And(hn::Ge(z, hn::Set(d, row.min_depth_m)), hn::Le(z, hn::Set(d, row.max_depth_m))));
  const auto nan = hn::Set(d, std::numeric_limits<double>::quiet_NaN());
  const auto depth = hn::IfThenElse(known, z, nan);
  const auto x = hn::IfThenElse(known, hn::Mul(hn::LoadU(d, row.column + u), z), nan);
  const auto y = hn::IfThenElse(known, hn::Mul(hn::Set(d, row.row), z), nan);
  const auto spread = hn::PromoteTo(d, hn::LoadU(df, row.sigma_px + u));
  const auto sigma = hn::IfThenElse(known, hn::Mul(z, hn::Div(spread, disparity)), nan);
  hn::StoreInterleaved3(hn::DemoteTo(df, x), hn::DemoteTo(df, y), hn::DemoteTo(df, depth), df,
                        row.points + 3 * u);
  hn::StoreU(hn::DemoteTo(df, sigma), df, row.sigmas + u);
}

void triangulateRow(const TriangulateRow& row, std::size_t width) {
  const hn::ScalableTag<double> d;
  const std::size_t lanes = hn::Lanes(d);
  std::size_t u = 0;
  for (; u + lanes <= width; u += lanes) triangulatePixels(d, row, u);
  for (; u < width; ++u) triangulatePixels(hn::CappedTag<double, 1>(), row, u);
}

void swapRedAndBlue(const std::uint8_t* from, std::size_t pixels, std::uint8_t* to) {
  const hn::ScalableTag<std::uint8_t> d;
  const std::size_t lanes = hn::Lanes(d);
  std::size_t i = 0;
  for (; i + lanes <= pixels; i += lanes) {
    hn::Vec<decltype(d)> b, g, r;
    hn::LoadInterleaved3(d, from + 3 * i, b, g, r);
    hn::StoreInterleaved3(r, g, b, d, to + 3 * i);
  }
  for (; i < pixels; ++i) {
    to[3 * i] = from[3 * i + 2];
    to[3 * i + 1] = from[3 * i + 1];
    to[3 * i + 2] = from[3 * i];
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace scanner::stereo::simd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace scanner::stereo::simd {

HWY_EXPORT(triangulateRow);
HWY_EXPORT(swapRedAndBlue);

void triangulateRow(const TriangulateRow& row, std::size_t width) {
  HWY_DYNAMIC_DISPATCH(triangulateRow)(row, width);
}

void swapRedAndBlue(const std::uint8_t* from, std::size_t pixels, std::uint8_t* to) {
  HWY_DYNAMIC_DISPATCH(swapRedAndBlue)(from, pixels, to);
}

}  // namespace scanner::stereo::simd
#endif
