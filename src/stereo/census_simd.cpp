#include "stereo/census_simd.h"

#include <cstddef>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "stereo/census_simd.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace scanner::stereo::simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void censusRow(const CensusRow& row) {
  const hn::ScalableTag<std::uint8_t> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const int sign = row.mirrored ? -1 : 1;
  for (int x = 0; x < row.width; x += lanes) {
    const auto centre = hn::LoadU(d, row.rows[row.radius_y] + x);
    auto bits = hn::Zero(d);
    int filled = 0, plane = 0;
    for (int y = 0; y <= 2 * row.radius_y; ++y) {
      for (int dx = -row.radius_x; dx <= row.radius_x; ++dx) {
        if (dx == 0 && y == row.radius_y) continue;
        const auto neighbour = hn::LoadU(d, row.rows[y] + (x + sign * dx));
        const auto bit = hn::Set(d, static_cast<std::uint8_t>(1 << filled));
        bits = hn::Or(bits, hn::IfThenElseZero(hn::Lt(neighbour, centre), bit));
        if (++filled < 8) continue;
        hn::StoreU(bits, d, row.planes[plane++] + x);
        bits = hn::Zero(d);
        filled = 0;
      }
    }
    if (filled > 0) hn::StoreU(bits, d, row.planes[plane] + x);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace scanner::stereo::simd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace scanner::stereo::simd {

HWY_EXPORT(censusRow);

void censusRow(const CensusRow& row) { HWY_DYNAMIC_DISPATCH(censusRow)(row); }

}  // namespace scanner::stereo::simd
#endif
