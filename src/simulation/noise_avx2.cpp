#include "simulation/noise_kernels.h"

#include <algorithm>
#include <cmath>

#include "simulation/noise_lattice.h"

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>
#define SCANNER_AVX2 __attribute__((target("avx2")))

namespace scanner::simulation::avx2 {
namespace {

SCANNER_AVX2 inline __m256i constant(std::uint32_t value) {
  return _mm256_set1_epi32(static_cast<int>(value));
}

/// The last mixing steps of hashLattice().
SCANNER_AVX2 inline __m256i avalanche(__m256i h) {
  h = _mm256_mullo_epi32(_mm256_xor_si256(h, _mm256_srli_epi32(h, 15)), constant(kHashFirst));
  h = _mm256_mullo_epi32(_mm256_xor_si256(h, _mm256_srli_epi32(h, 12)), constant(kHashSecond));
  return _mm256_xor_si256(h, _mm256_srli_epi32(h, 15));
}

/// Entries of a table of 16 by the lowest four bits.
SCANNER_AVX2 inline __m256 lookUp(const std::array<float, 16>& table, __m256i index) {
  const __m256 low = _mm256_permutevar8x32_ps(_mm256_loadu_ps(table.data()), index);
  const __m256 high = _mm256_permutevar8x32_ps(_mm256_loadu_ps(table.data() + 8), index);
  // Bit 3 moved to the sign chooses the half.
  return _mm256_blendv_ps(low, high, _mm256_castsi256_ps(_mm256_slli_epi32(index, 28)));
}

/// Trilinear interpolation between the eight corners.
SCANNER_AVX2 inline float interpolate(__m256 c, float u, float v, float w) {
  const __m256 even = _mm256_shuffle_ps(c, c, _MM_SHUFFLE(2, 0, 2, 0));
  const __m256 odd = _mm256_shuffle_ps(c, c, _MM_SHUFFLE(3, 1, 3, 1));
  const __m256 rows =
      _mm256_add_ps(even, _mm256_mul_ps(_mm256_set1_ps(u), _mm256_sub_ps(odd, even)));
  const __m128 both = _mm_unpacklo_ps(_mm256_castps256_ps128(rows), _mm256_extractf128_ps(rows, 1));
  const __m128 upper = _mm_movehl_ps(both, both);
  const __m128 layers = _mm_add_ps(both, _mm_mul_ps(_mm_set1_ps(v), _mm_sub_ps(upper, both)));
  const float below = _mm_cvtss_f32(layers);
  const float above = _mm_cvtss_f32(_mm_shuffle_ps(layers, layers, 1));
  return below + w * (above - below);
}

/// locate() and fade() for the three coordinates at a time.
struct Place {
  LatticePoint lattice;
  float u, v, w;
};

SCANNER_AVX2 inline Place placeOf(const Eigen::Vector3f& p) {
  const __m128 position = _mm_set_ps(0.0F, p.z(), p.y(), p.x());
  const __m128 floor = _mm_floor_ps(position);
  const __m128 t = _mm_sub_ps(position, floor);
  const __m128 inner =
      _mm_add_ps(_mm_mul_ps(t, _mm_sub_ps(_mm_mul_ps(t, _mm_set1_ps(6.0F)), _mm_set1_ps(15.0F))),
                 _mm_set1_ps(10.0F));
  const __m128 faded = _mm_mul_ps(_mm_mul_ps(_mm_mul_ps(t, t), t), inner);
  alignas(16) std::array<std::int32_t, 4> cell;
  alignas(16) std::array<float, 4> within, weight;
  _mm_store_si128(reinterpret_cast<__m128i*>(cell.data()), _mm_cvttps_epi32(floor));
  _mm_store_ps(within.data(), t);
  _mm_store_ps(weight.data(), faded);
  return {{cell[0], cell[1], cell[2], within[0], within[1], within[2]},
          weight[0],
          weight[1],
          weight[2]};
}

/// Corner i of the cell is at (i & 1, i >> 1 & 1, i >> 2 & 1).
struct Corners {
  __m256 gx, gy, gz, values;
};

SCANNER_AVX2 inline Corners evaluateCorners(const LatticePoint& l, std::uint32_t seed) {
  const std::uint32_t x = static_cast<std::uint32_t>(l.x) * kHashX;
  const std::uint32_t y = static_cast<std::uint32_t>(l.y) * kHashY;
  const std::uint32_t z = static_cast<std::uint32_t>(l.z) * kHashZ ^ seed * kHashSeed;
  const std::uint32_t z_next = (static_cast<std::uint32_t>(l.z) + 1U) * kHashZ ^ seed * kHashSeed;
  __m256i h = _mm256_blend_epi32(constant(x), constant(x + kHashX), 0xaa);
  h = _mm256_xor_si256(h, _mm256_blend_epi32(constant(y), constant(y + kHashY), 0xcc));
  h = avalanche(_mm256_xor_si256(h, _mm256_blend_epi32(constant(z), constant(z_next), 0xf0)));
  Corners c;
  c.gx = lookUp(kGradientX, h);
  c.gy = lookUp(kGradientY, h);
  c.gz = lookUp(kGradientZ, h);
  const __m256 dx = _mm256_blend_ps(_mm256_set1_ps(l.fx), _mm256_set1_ps(l.fx - 1.0F), 0xaa);
  const __m256 dy = _mm256_blend_ps(_mm256_set1_ps(l.fy), _mm256_set1_ps(l.fy - 1.0F), 0xcc);
  const __m256 dz = _mm256_blend_ps(_mm256_set1_ps(l.fz), _mm256_set1_ps(l.fz - 1.0F), 0xf0);
  c.values = _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(c.gx, dx), _mm256_mul_ps(c.gy, dy)),
                           _mm256_mul_ps(c.gz, dz));
  return c;
}

/// The 27 cells around a place, and five far ones that make the number a multiple of eight.
struct Neighbors {
  alignas(32) std::array<float, 32> dx{}, dy{}, dz{};
  alignas(32) std::array<std::uint32_t, 32> hx{}, hy{}, hz{};  ///< what they add to the hash

  constexpr Neighbors() {
    for (std::size_t i = 0; i < 32; ++i) {
      const int k = static_cast<int>(i);
      const int x = i < 27 ? k % 3 - 1 : 8, y = k / 3 % 3 - 1, z = i < 27 ? k / 9 - 1 : 8;
      dx[i] = static_cast<float>(x);
      dy[i] = static_cast<float>(y);
      dz[i] = static_cast<float>(z);
      hx[i] = static_cast<std::uint32_t>(x) * kHashX;
      hy[i] = static_cast<std::uint32_t>(y) * kHashY;
      hz[i] = static_cast<std::uint32_t>(z) * kHashZ;
    }
  }
};
constexpr Neighbors kNeighbors;

SCANNER_AVX2 inline __m256i load(const std::array<std::uint32_t, 32>& table, std::size_t first) {
  return _mm256_load_si256(reinterpret_cast<const __m256i*>(table.data() + first));
}

/// From the feature point to the place, along one axis; ten bits of the hash, from bit 0 on.
SCANNER_AVX2 inline __m256 featureOffset(__m256i hash, const float* cell, float place) {
  const __m256 within = _mm256_mul_ps(_mm256_cvtepi32_ps(_mm256_and_si256(hash, constant(1023U))),
                                      _mm256_set1_ps(1.0F / 1024.0F));
  return _mm256_sub_ps(_mm256_add_ps(_mm256_load_ps(cell), within), _mm256_set1_ps(place));
}

/// The two smallest squared distances of each lane, and the hash that belongs to the smallest.
struct Closest {
  __m256 nearest, second;
  __m256i id;
};

SCANNER_AVX2 inline Closest merge(const Closest& a, const Closest& b) {
  const __m256 b_first = _mm256_cmp_ps(b.nearest, a.nearest, _CMP_LT_OQ);
  return {_mm256_min_ps(a.nearest, b.nearest),
          _mm256_min_ps(_mm256_min_ps(a.second, b.second), _mm256_max_ps(a.nearest, b.nearest)),
          _mm256_blendv_epi8(a.id, b.id, _mm256_castps_si256(b_first))};
}

/// With the lanes moved: merging with it brings lanes together. `order` as for a shuffle.
template <int order>
SCANNER_AVX2 inline Closest shuffled(const Closest& c) {
  return {_mm256_permute_ps(c.nearest, order), _mm256_permute_ps(c.second, order),
          _mm256_shuffle_epi32(c.id, order)};
}

SCANNER_AVX2 inline Closest halvesSwapped(const Closest& c) {
  return {_mm256_permute2f128_ps(c.nearest, c.nearest, 1),
          _mm256_permute2f128_ps(c.second, c.second, 1), _mm256_permute2x128_si256(c.id, c.id, 1)};
}

}  // namespace

bool available() { return __builtin_cpu_supports("avx2") != 0; }

SCANNER_AVX2 float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed) {
  const Place place = placeOf(p);
  return interpolate(evaluateCorners(place.lattice, seed).values, place.u, place.v, place.w);
}

SCANNER_AVX2 float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed,
                                 Eigen::Vector3f* gradient) {
  const auto [l, u, v, w] = placeOf(p);
  const Corners c = evaluateCorners(l, seed);
  std::array<float, 8> values;
  _mm256_storeu_ps(values.data(), c.values);
  *gradient = Eigen::Vector3f(interpolate(c.gx, u, v, w), interpolate(c.gy, u, v, w),
                              interpolate(c.gz, u, v, w));
  *gradient += weightSlopes(l, values, u, v, w);
  return interpolate(c.values, u, v, w);
}

SCANNER_AVX2 Cell cellularNoise(const Eigen::Vector3f& position_m, float cell_m,
                                std::uint32_t seed) {
  const LatticePoint l = locate(position_m / cell_m);
  const __m256i x0 = constant(static_cast<std::uint32_t>(l.x) * kHashX);
  const __m256i y0 = constant(static_cast<std::uint32_t>(l.y) * kHashY);
  const __m256i z0 = constant(static_cast<std::uint32_t>(l.z) * kHashZ);
  const __m256i seed_hash = constant(seed * kHashSeed);
  constexpr float kFar = 8.0F;
  Closest closest{_mm256_set1_ps(kFar), _mm256_set1_ps(kFar), _mm256_setzero_si256()};
  for (std::size_t i = 0; i < 32; i += 8) {
    const __m256i lattice =
        _mm256_xor_si256(_mm256_xor_si256(_mm256_add_epi32(x0, load(kNeighbors.hx, i)),
                                          _mm256_add_epi32(y0, load(kNeighbors.hy, i))),
                         _mm256_add_epi32(z0, load(kNeighbors.hz, i)));
    const __m256i h = avalanche(_mm256_xor_si256(lattice, seed_hash));
    const __m256 x = featureOffset(h, kNeighbors.dx.data() + i, l.fx);
    const __m256 y = featureOffset(_mm256_srli_epi32(h, 10), kNeighbors.dy.data() + i, l.fy);
    const __m256 z = featureOffset(_mm256_srli_epi32(h, 20), kNeighbors.dz.data() + i, l.fz);
    const __m256 squared =
        _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(x, x), _mm256_mul_ps(y, y)), _mm256_mul_ps(z, z));
    closest = merge(closest, {squared, _mm256_set1_ps(kFar), h});
  }
  closest = merge(closest, halvesSwapped(closest));
  closest = merge(closest, shuffled<_MM_SHUFFLE(1, 0, 3, 2)>(closest));
  closest = merge(closest, shuffled<_MM_SHUFFLE(2, 3, 0, 1)>(closest));
  const auto hash = static_cast<std::uint32_t>(_mm256_cvtsi256_si32(closest.id));
  return {std::sqrt(_mm256_cvtss_f32(closest.nearest)), std::sqrt(_mm256_cvtss_f32(closest.second)),
          cellId(hash)};
}

}  // namespace scanner::simulation::avx2

#else  // another processor: never called

namespace scanner::simulation::avx2 {

bool available() { return false; }
float gradientNoise(const Eigen::Vector3f&, std::uint32_t) { return 0.0F; }
float gradientNoise(const Eigen::Vector3f&, std::uint32_t, Eigen::Vector3f*) { return 0.0F; }
Cell cellularNoise(const Eigen::Vector3f&, float, std::uint32_t) { return {}; }

}  // namespace scanner::simulation::avx2

#endif
