#include "scanner/simulation/noise.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "simulation/noise_kernels.h"
#include "simulation/noise_lattice.h"

namespace scanner::simulation {
namespace {

const bool kVectorized = avx2::available();

/// A full avalanche of the three lattice coordinates.
std::uint32_t hashLattice(std::int32_t x, std::int32_t y, std::int32_t z, std::uint32_t seed) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * kHashX;
  h ^= static_cast<std::uint32_t>(y) * kHashY;
  h ^= static_cast<std::uint32_t>(z) * kHashZ;
  h ^= seed * kHashSeed;
  h = (h ^ (h >> 15U)) * kHashFirst;
  h = (h ^ (h >> 12U)) * kHashSecond;
  return h ^ (h >> 15U);
}

float mix(float a, float b, float t) { return a + t * (b - a); }

/// Corner i of a cell is at (i & 1, i >> 1 & 1, i >> 2 & 1).
struct Corners {
  std::array<float, 8> gx, gy, gz, values;
};

Corners evaluateCorners(const LatticePoint& l, std::uint32_t seed) {
  Corners c;
  for (std::size_t k = 0; k < 8; ++k) {
    const int dx = k & 1U, dy = (k >> 1U) & 1U, dz = static_cast<int>(k >> 2U);
    const std::size_t g = hashLattice(l.x + dx, l.y + dy, l.z + dz, seed) & 15U;
    c.gx[k] = kGradientX[g];
    c.gy[k] = kGradientY[g];
    c.gz[k] = kGradientZ[g];
    c.values[k] = c.gx[k] * (l.fx - static_cast<float>(dx)) +
                  c.gy[k] * (l.fy - static_cast<float>(dy)) +
                  c.gz[k] * (l.fz - static_cast<float>(dz));
  }
  return c;
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

namespace plain {

float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed) {
  const LatticePoint l = locate(p);
  return interpolate(evaluateCorners(l, seed).values, fade(l.fx), fade(l.fy), fade(l.fz));
}

float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed, Eigen::Vector3f* gradient) {
  const LatticePoint l = locate(p);
  const Corners c = evaluateCorners(l, seed);
  const float u = fade(l.fx), v = fade(l.fy), w = fade(l.fz);
  // The product rule: the corners' own slopes, and those of the weights.
  *gradient = Eigen::Vector3f(interpolate(c.gx, u, v, w), interpolate(c.gy, u, v, w),
                              interpolate(c.gz, u, v, w));
  *gradient += weightSlopes(l, c.values, u, v, w);
  return interpolate(c.values, u, v, w);
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
  return {std::sqrt(nearest), std::sqrt(second), cellId(id)};
}

}  // namespace plain

float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed) {
  return kVectorized ? avx2::gradientNoise(p, seed) : plain::gradientNoise(p, seed);
}

float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed, Eigen::Vector3f* gradient) {
  return kVectorized ? avx2::gradientNoise(p, seed, gradient)
                     : plain::gradientNoise(p, seed, gradient);
}

Cell cellularNoise(const Eigen::Vector3f& position_m, float cell_m, std::uint32_t seed) {
  return kVectorized ? avx2::cellularNoise(position_m, cell_m, seed)
                     : plain::cellularNoise(position_m, cell_m, seed);
}

float hashUnit(std::int32_t x, std::int32_t y, std::int32_t z, std::uint32_t seed) {
  return static_cast<float>(hashLattice(x, y, z, seed) >> 8U) * 0x1p-24F;
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

}  // namespace scanner::simulation
