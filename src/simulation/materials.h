#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "scanner/simulation/scene.h"

/// Procedural materials. All are solid textures (functions of position, not of uv), band-limited to
/// the footprint, with contrast from decimetres down to 0.3 mm, and cost about half a microsecond a
/// call. Colours are linear RGB.
namespace scanner::simulation {

/// Weathered stone and what resembles it: blotches, grain of crystals, specks, stains, growth.
struct StonePalette {
  Eigen::Vector3f base = {0.36F, 0.33F, 0.29F};
  Eigen::Vector3f dark = {0.10F, 0.09F, 0.08F};    ///< dark crystals, dirt
  Eigen::Vector3f light = {0.62F, 0.59F, 0.54F};   ///< light crystals, lime
  Eigen::Vector3f stain = {0.24F, 0.16F, 0.09F};   ///< broad stains
  Eigen::Vector3f growth = {0.34F, 0.36F, 0.12F};  ///< lichen in patches
  float grain_m = 0.0016F;                         ///< size of the crystals
  float crystals = 1.0F;                           ///< how much they differ from the base, 0..1
  float stains = 0.5F;                             ///< how much of each, 0..1
  float lichen = 0.3F;
  float roughness = 0.75F;
  float bump = 0.2F;  ///< depth of the relief that is only shaded, 0..1
};
Shader stone(const StonePalette& palette, std::uint32_t seed);
/// Likewise, as a plain function: for shaders that mix materials.
Appearance shadeStone(const SurfacePoint& point, const StonePalette& palette, std::uint32_t seed);

/// Paint that has flaked off what is below it, with runs of rust or dirt.
struct PaintPalette {
  Eigen::Vector3f paint = {0.55F, 0.20F, 0.10F};
  Eigen::Vector3f faded = {0.62F, 0.42F, 0.30F};   ///< where the sun bleached it
  Eigen::Vector3f ground = {0.20F, 0.12F, 0.07F};  ///< below the paint
  Eigen::Vector3f edge = {0.66F, 0.62F, 0.56F};    ///< primer at the rims of the flakes
  float wear = 0.4F;                               ///< share without paint, 0..1
  float roughness = 0.5F;
};
Appearance shadePaint(const SurfacePoint& point, const PaintPalette& palette, std::uint32_t seed);

/// Broken concrete grey: sand, aggregate, stains. `joints`: slabs of 1.2 m with joints and cracks,
/// for ground at z = 0.
Shader concrete(bool joints, std::uint32_t seed);

/// Surroundings, seen from metres away.
Shader lawn(std::uint32_t seed);
Shader foliage(const Eigen::Vector3f& leaf, std::uint32_t seed);
Shader bark(std::uint32_t seed);
/// Courses of bricks along x or y, whichever the wall's face shows.
Shader bricks(std::uint32_t seed);

}  // namespace scanner::simulation
