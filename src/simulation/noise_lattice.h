#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

/// What the plain and the vectorized noise share. Both must give the same bits.
namespace scanner::simulation {

/// Constants of the hash of lattice points.
constexpr std::uint32_t kHashX = 0x8da6b343U, kHashY = 0xd8163841U, kHashZ = 0xcb1ab31fU;
constexpr std::uint32_t kHashSeed = 0x9e3779b9U;
constexpr std::uint32_t kHashFirst = 0x2c1b3c6dU, kHashSecond = 0x297a2d39U;

struct LatticePoint {
  std::int32_t x, y, z;
  float fx, fy, fz;  ///< within the cell, [0, 1)
};

/// std::floor is a library call without SSE4.1.
inline std::int32_t floorToInt(float x) {
  const auto truncated = static_cast<std::int32_t>(x);
  return truncated - (x < static_cast<float>(truncated) ? 1 : 0);
}

inline LatticePoint locate(const Eigen::Vector3f& p) {
  LatticePoint l{floorToInt(p.x()), floorToInt(p.y()), floorToInt(p.z()), 0.0F, 0.0F, 0.0F};
  l.fx = p.x() - static_cast<float>(l.x);
  l.fy = p.y() - static_cast<float>(l.y);
  l.fz = p.z() - static_cast<float>(l.z);
  return l;
}

/// Perlin's twelve gradients towards the edges of a cube, four of them twice; by coordinates.
constexpr std::array<float, 16> kGradientX = {1, -1, 1, -1, 1, -1, 1, -1, 0, 0, 0, 0, 1, -1, 0, 0};
constexpr std::array<float, 16> kGradientY = {1, 1, -1, -1, 0, 0, 0, 0, 1, -1, 1, -1, 1, 1, -1, -1};
constexpr std::array<float, 16> kGradientZ = {0, 0, 0, 0, 1, 1, -1, -1, 1, 1, -1, -1, 0, 0, 1, -1};

inline float fade(float t) { return t * t * t * (t * (t * 6.0F - 15.0F) + 10.0F); }

/// What the slopes of the weights add to the gradient of the noise; `c` are the values from the
/// corners of the cell, (u, v, w) the faded place.
inline Eigen::Vector3f weightSlopes(const LatticePoint& l, const std::array<float, 8>& c, float u,
                                    float v, float w) {
  // Trilinear: value = c0 + k1 u + k2 v + k3 w + k4 uv + k5 vw + k6 wu + k7 uvw.
  const float k1 = c[1] - c[0], k2 = c[2] - c[0], k3 = c[4] - c[0];
  const float k4 = c[0] - c[1] - c[2] + c[3];
  const float k5 = c[0] - c[2] - c[4] + c[6];
  const float k6 = c[0] - c[1] - c[4] + c[5];
  const float k7 = -c[0] + c[1] + c[2] - c[3] + c[4] - c[5] - c[6] + c[7];
  const auto slope = [](float t) { return 30.0F * t * t * (t * (t - 2.0F) + 1.0F); };
  return {slope(l.fx) * (k1 + k4 * v + k6 * w + k7 * v * w),
          slope(l.fy) * (k2 + k4 * u + k5 * w + k7 * u * w),
          slope(l.fz) * (k3 + k5 * v + k6 * u + k7 * u * v)};
}

/// Identity of a cell from the hash that placed its point; another mix, so that the two are
/// independent.
inline float cellId(std::uint32_t hash) {
  return static_cast<float>((hash * 0x9e3779b9U) >> 8U) * 0x1p-24F;
}

}  // namespace scanner::simulation
