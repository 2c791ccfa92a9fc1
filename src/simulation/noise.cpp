#include "scanner/simulation/noise.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace scanner::simulation {
namespace {

/// A full avalanche of the three lattice coordinates.
std::uint32_t hashLattice(std::int32_t x, std::int32_t y, std::int32_t z, std::uint32_t seed) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 0x8da6b343U;
  h ^= static_cast<std::uint32_t>(y) * 0xd8163841U;
  h ^= static_cast<std::uint32_t>(z) * 0xcb1ab31fU;
  h ^= seed * 0x9e3779b9U;
  h = (h ^ (h >> 15U)) * 0x2c1b3c6dU;
  h = (h ^ (h >> 12U)) * 0x297a2d39U;
  return h ^ (h >> 15U);
}

/// std::floor is a library call without SSE4.1.
std::int32_t floorToInt(float x) {
  const auto truncated = static_cast<std::int32_t>(x);
  return truncated - (x < static_cast<float>(truncated) ? 1 : 0);
}

struct LatticePoint {
  std::int32_t x, y, z;
  float fx, fy, fz;  ///< within the cell, [0, 1)
};

LatticePoint locate(const Eigen::Vector3f& p) {
  LatticePoint l{floorToInt(p.x()), floorToInt(p.y()), floorToInt(p.z()), 0.0F, 0.0F, 0.0F};
  l.fx = p.x() - static_cast<float>(l.x);
  l.fy = p.y() - static_cast<float>(l.y);
  l.fz = p.z() - static_cast<float>(l.z);
  return l;
}

/// Perlin's twelve gradients towards the edges of a cube, four of them twice.
struct Gradient {
  float x, y, z;
};
constexpr std::array<Gradient, 16> kGradients = {{{1, 1, 0},
                                                  {-1, 1, 0},
                                                  {1, -1, 0},
                                                  {-1, -1, 0},
                                                  {1, 0, 1},
                                                  {-1, 0, 1},
                                                  {1, 0, -1},
                                                  {-1, 0, -1},
                                                  {0, 1, 1},
                                                  {0, -1, 1},
                                                  {0, 1, -1},
                                                  {0, -1, -1},
                                                  {1, 1, 0},
                                                  {-1, 1, 0},
                                                  {0, -1, 1},
                                                  {0, -1, -1}}};

const Gradient& cornerGradient(const LatticePoint& l, int dx, int dy, int dz, std::uint32_t seed) {
  return kGradients[hashLattice(l.x + dx, l.y + dy, l.z + dz, seed) & 15U];
}

float fade(float t) { return t * t * t * (t * (t * 6.0F - 15.0F) + 10.0F); }
float fadeSlope(float t) { return 30.0F * t * t * (t * (t - 2.0F) + 1.0F); }
float mix(float a, float b, float t) { return a + t * (b - a); }

/// Corner i of a cell is at (i & 1, i >> 1 & 1, i >> 2 & 1).
struct Corners {
  std::array<Gradient, 8> gradients;
  std::array<float, 8> values;
};

Corners evaluateCorners(const LatticePoint& l, std::uint32_t seed) {
  Corners c;
  for (int i = 0; i < 8; ++i) {
    const int dx = i & 1, dy = (i >> 1) & 1, dz = i >> 2;
    const Gradient& g = cornerGradient(l, dx, dy, dz, seed);
    const auto k = static_cast<std::size_t>(i);
    c.gradients[k] = g;
    c.values[k] = g.x * (l.fx - static_cast<float>(dx)) + g.y * (l.fy - static_cast<float>(dy)) +
                  g.z * (l.fz - static_cast<float>(dz));
  }
  return c;
}

/// Trilinear coefficients: value = k0 + k1 u + k2 v + k3 w + k4 uv + k5 vw + k6 wu + k7 uvw.
std::array<float, 8> trilinearCoefficients(const std::array<float, 8>& c) {
  return {c[0],
          c[1] - c[0],
          c[2] - c[0],
          c[4] - c[0],
          c[0] - c[1] - c[2] + c[3],
          c[0] - c[2] - c[4] + c[6],
          c[0] - c[1] - c[4] + c[5],
          -c[0] + c[1] + c[2] - c[3] + c[4] - c[5] - c[6] + c[7]};
}

float interpolate(const std::array<float, 8>& c, float u, float v, float w) {
  return mix(mix(mix(c[0], c[1], u), mix(c[2], c[3], u), v),
             mix(mix(c[4], c[5], u), mix(c[6], c[7], u), v), w);
}

/// Neighbours of a cell, near ones first, so that the far ones can mostly be skipped.
constexpr std::array<std::array<int, 3>, 27> kNeighbors = {
    {{0, 0, 0},   {-1, 0, 0},  {1, 0, 0},   {0, -1, 0}, {0, 1, 0},   {0, 0, -1},   {0, 0, 1},
     {-1, -1, 0}, {1, -1, 0},  {-1, 1, 0},  {1, 1, 0},  {-1, 0, -1}, {1, 0, -1},   {-1, 0, 1},
     {1, 0, 1},   {0, -1, -1}, {0, 1, -1},  {0, -1, 1}, {0, 1, 1},   {-1, -1, -1}, {1, -1, -1},
     {-1, 1, -1}, {1, 1, -1},  {-1, -1, 1}, {1, -1, 1}, {-1, 1, 1},  {1, 1, 1}}};

/// Squared distance along one axis to the cell at `offset`.
float gapSquared(float f, int offset) {
  const float gap = offset < 0 ? f : 1.0F - f;
  return offset == 0 ? 0.0F : gap * gap;
}

}  // namespace

float hashUnit(std::int32_t x, std::int32_t y, std::int32_t z, std::uint32_t seed) {
  return static_cast<float>(hashLattice(x, y, z, seed) >> 8U) * 0x1p-24F;
}

float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed) {
  const LatticePoint l = locate(p);
  return interpolate(evaluateCorners(l, seed).values, fade(l.fx), fade(l.fy), fade(l.fz));
}

float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed, Eigen::Vector3f* gradient) {
  const LatticePoint l = locate(p);
  const Corners c = evaluateCorners(l, seed);
  const float u = fade(l.fx), v = fade(l.fy), w = fade(l.fz);
  const std::array<float, 8> k = trilinearCoefficients(c.values);
  std::array<float, 8> gx, gy, gz;
  for (std::size_t i = 0; i < 8; ++i) {
    gx[i] = c.gradients[i].x;
    gy[i] = c.gradients[i].y;
    gz[i] = c.gradients[i].z;
  }
  // The product rule: the corners' own slopes, and those of the weights.
  *gradient =
      Eigen::Vector3f(interpolate(gx, u, v, w), interpolate(gy, u, v, w), interpolate(gz, u, v, w));
  gradient->x() += fadeSlope(l.fx) * (k[1] + k[4] * v + k[6] * w + k[7] * v * w);
  gradient->y() += fadeSlope(l.fy) * (k[2] + k[4] * u + k[5] * w + k[7] * u * w);
  gradient->z() += fadeSlope(l.fz) * (k[3] + k[5] * v + k[6] * u + k[7] * u * v);
  return interpolate(c.values, u, v, w);
}

float octaveWeight(float wavelength_m, float footprint_m) {
  return std::clamp(wavelength_m / std::max(footprint_m, 1e-9F) - 1.0F, 0.0F, 1.0F);
}

float fractalNoise(const Eigen::Vector3f& position_m, float longest_m, float shortest_m,
                   float persistence, float footprint_m, std::uint32_t seed) {
  float sum = 0.0F, amplitude = 1.0F, total = 0.0F;
  float wavelength = longest_m;
  // A little slack, so that rounding of the halves does not decide on the last octave.
  for (; wavelength > 0.99F * shortest_m; wavelength *= 0.5F, amplitude *= persistence, ++seed) {
    const float weight = octaveWeight(wavelength, footprint_m);
    // The shift keeps the octaves' lattice points apart: noise is zero on all of them.
    if (weight > 0.0F) {
      const Eigen::Vector3f p =
          position_m / wavelength + Eigen::Vector3f::Constant(0.37F * wavelength / longest_m);
      sum += amplitude * weight * gradientNoise(p, seed);
    }
    total += amplitude;
  }
  return total > 0.0F ? sum / total : 0.0F;
}

Cell cellularNoise(const Eigen::Vector3f& position_m, float cell_m, std::uint32_t seed) {
  const LatticePoint l = locate(position_m / cell_m);
  float nearest = 8.0F, second = 8.0F;
  std::uint32_t id = 0;
  for (const auto& [dx, dy, dz] : kNeighbors) {
    if (gapSquared(l.fx, dx) + gapSquared(l.fy, dy) + gapSquared(l.fz, dz) >= second) continue;
    // One hash places the feature point: ten bits per axis are plenty.
    const std::uint32_t h = hashLattice(l.x + dx, l.y + dy, l.z + dz, seed);
    const auto place = [&](unsigned shift) {
      return static_cast<float>((h >> shift) & 1023U) * (1.0F / 1024.0F);
    };
    const float x = static_cast<float>(dx) + place(0) - l.fx;
    const float y = static_cast<float>(dy) + place(10) - l.fy;
    const float z = static_cast<float>(dz) + place(20) - l.fz;
    const float squared = x * x + y * y + z * z;
    if (squared < nearest) {
      second = nearest;
      nearest = squared;
      id = h;
    } else {
      second = std::min(second, squared);
    }
  }
  // The hash placed the point; another mix makes the identity independent of the place.
  const float unit = static_cast<float>((id * 0x9e3779b9U) >> 8U) * 0x1p-24F;
  return {std::sqrt(nearest), std::sqrt(second), unit};
}

}  // namespace scanner::simulation
