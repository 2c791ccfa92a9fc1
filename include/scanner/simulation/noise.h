#pragma once

#include <Eigen/Core>
#include <cstdint>

/// Procedural solid noise (Perlin, Improving Noise, SIGGRAPH 2002; own hash). Pure, thread-safe,
/// the same bits everywhere.
namespace scanner::simulation {

/// Hash to [0, 1).
float hashUnit(std::int32_t x, std::int32_t y, std::int32_t z, std::uint32_t seed);

/// Gradient noise of wavelength 1, about -1..1, zero mean, C2.
float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed);
/// Likewise, with its exact gradient with respect to p.
float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed, Eigen::Vector3f* gradient);

/// How much of detail of this wavelength a pixel of this footprint can show: 1 from two footprints
/// on, 0 below one.
float octaveWeight(float wavelength_m, float footprint_m);

/// Sum of octaves from `longest_m` down to `shortest_m`, each half as long; `persistence` is the
/// ratio of amplitudes of an octave and the one before. Octaves shorter than twice `footprint_m`
/// fade out. Scaled so that all octaves together stay within about -1..1.
float fractalNoise(const Eigen::Vector3f& position_m, float longest_m, float shortest_m,
                   float persistence, float footprint_m, std::uint32_t seed);

/// Cellular noise (Worley, A Cellular Texture Basis Function, SIGGRAPH 1996): distance to the
/// nearest and second nearest feature point of cells of `cell_m`, in units of cell_m, and a hash of
/// the nearest cell.
struct Cell {
  float nearest = 0.0F;
  float second = 0.0F;
  float id = 0.0F;  ///< [0, 1)
};
Cell cellularNoise(const Eigen::Vector3f& position_m, float cell_m, std::uint32_t seed);

}  // namespace scanner::simulation
