#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "scanner/simulation/noise.h"

/// What the procedural materials have in common.
namespace scanner::simulation {

inline Eigen::Vector3f blend(const Eigen::Vector3f& a, const Eigen::Vector3f& b, float t) {
  return a + t * (b - a);
}

/// Noise of one octave with its share of the pixel's detail; costs nothing when too fine to see.
inline float octave(const Eigen::Vector3f& p, float wavelength_m, float footprint_m,
                    std::uint32_t seed) {
  const float weight = octaveWeight(wavelength_m, footprint_m);
  return weight > 0.0F ? weight * gradientNoise(p / wavelength_m, seed) : 0.0F;
}

/// Likewise, and adds its slope to `relief`, the gradient of a height in units of the wavelength.
inline float reliefOctave(const Eigen::Vector3f& p, float wavelength_m, float footprint_m,
                          std::uint32_t seed, Eigen::Vector3f* relief) {
  const float weight = octaveWeight(wavelength_m, footprint_m);
  if (weight <= 0.0F) return 0.0F;
  Eigen::Vector3f slope;
  const float value = gradientNoise(p / wavelength_m, seed, &slope);
  *relief += weight * slope;
  return weight * value;
}

/// The shading normal of a surface with this relief.
inline Eigen::Vector3f tilted(const Eigen::Vector3f& normal, const Eigen::Vector3f& relief) {
  return (normal - (relief - relief.dot(normal) * normal)).normalized();
}

/// No natural surface is quite black or quite white.
inline Eigen::Vector3f clampedAlbedo(const Eigen::Vector3f& albedo) {
  return albedo.cwiseMax(0.015F).cwiseMin(0.9F);
}

}  // namespace scanner::simulation
