#include "simulation/materials.h"

#include <algorithm>
#include <cmath>

#include "scanner/simulation/noise.h"
#include "simulation/shading.h"
#include "simulation/solids.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

/// Crystals of three kinds, each with its own brightness; blurs to the base for large pixels.
Vector3f crystals(const Vector3f& p, const StonePalette& palette, float footprint_m,
                  std::uint32_t seed) {
  const float cell_m = 1.6F * palette.grain_m;
  const float weight = palette.crystals * octaveWeight(cell_m, footprint_m);
  if (weight <= 0.0F) return palette.base;
  const Cell cell = cellularNoise(p, cell_m, seed);
  // Within a kind the rest of the number makes single crystals lighter and darker.
  constexpr float kDark = 0.15F, kLight = 0.82F;
  Vector3f color = palette.base * (0.8F + 0.5F * (cell.id - kDark));
  if (cell.id < kDark) color = palette.dark * (0.8F + 3.0F * cell.id);
  if (cell.id > kLight) color = palette.light * (0.6F + 0.4F * cell.id);
  return blend(palette.base, color, weight);
}

}  // namespace

Appearance shadeStone(const SurfacePoint& point, const StonePalette& palette, std::uint32_t seed) {
  const Vector3f& p = point.position;
  const float f = point.footprint_m;
  Vector3f relief = Vector3f::Zero();
  const float broad = octave(p, 0.110F, f, seed);
  // Rain carries dirt down: long in z.
  const float streaks = octave(p.cwiseProduct(Vector3f(1.0F, 1.0F, 0.18F)), 0.021F, f, seed + 1);
  const float middle = octave(p, 0.017F, f, seed + 2);
  const float coarse = reliefOctave(p, 0.0062F, f, seed + 3, &relief);
  const float fine = reliefOctave(p, 0.0021F, f, seed + 4, &relief);
  const float finest = octave(p, 0.0007F, f, seed + 5);

  Vector3f albedo = crystals(p, palette, f, seed + 6);
  const float shade =
      1.0F + 0.35F * broad + 0.45F * middle + 0.55F * coarse + 0.65F * fine + 0.6F * finest;
  albedo *= std::max(shade, 0.25F);
  const float stained = palette.stains * smoothStep(0.0F, 0.45F, streaks + 0.7F * broad);
  albedo = blend(albedo, palette.stain * shade, 0.75F * stained);
  const float grown = smoothStep(
      0.30F, 0.38F, 0.8F * middle - 0.7F * broad + 0.35F * coarse - 0.5F * (0.5F - palette.lichen));
  const Vector3f lichen = palette.growth * std::max(0.9F + 1.1F * fine + 0.5F * finest, 0.2F);
  albedo = blend(albedo, lichen, 0.85F * grown);

  Appearance a;
  a.albedo = clampedAlbedo(albedo);
  a.normal = tilted(point.normal, palette.bump * relief);
  a.specular = 0.03F;
  a.roughness = palette.roughness;
  return a;
}

Appearance shadePaint(const SurfacePoint& point, const PaintPalette& palette, std::uint32_t seed) {
  const Vector3f& p = point.position;
  const float f = point.footprint_m;
  Vector3f relief = Vector3f::Zero();
  const float broad = octave(p, 0.080F, f, seed);
  const float runs = octave(p.cwiseProduct(Vector3f(1.0F, 1.0F, 0.15F)), 0.013F, f, seed + 1);
  const float middle = octave(p, 0.012F, f, seed + 2);
  const float coarse = reliefOctave(p, 0.0047F, f, seed + 3, &relief);
  const float fine = reliefOctave(p, 0.0017F, f, seed + 4, &relief);
  const float finest = octave(p, 0.0007F, f, seed + 5);

  const float hold =
      0.9F * broad + 0.8F * middle + 0.5F * coarse + 0.22F * fine - 1.3F * (palette.wear - 0.5F);
  const float painted = smoothStep(-0.03F, 0.03F, hold);
  const float rim = painted * (1.0F - smoothStep(0.03F, 0.09F, hold));
  const float grain = 1.0F + 0.9F * fine + 0.8F * finest;

  Vector3f bare = palette.ground * std::max(grain + 0.9F * coarse, 0.25F);
  bare = blend(bare, 2.6F * bare, smoothStep(0.1F, 0.35F, middle - coarse));
  Vector3f coat = blend(palette.paint, palette.faded, smoothStep(-0.35F, 0.35F, broad + coarse));
  coat *= std::max(1.0F + 0.6F * (grain - 1.0F) + 0.35F * middle, 0.25F);
  // Rust bleeds through in specks and runs down.
  const float dirt = std::max(smoothStep(0.16F, 0.42F, runs), smoothStep(0.22F, 0.34F, fine));
  coat = blend(coat, 1.3F * palette.ground, 0.6F * dirt);
  coat = blend(coat, palette.edge, 0.8F * rim);

  Appearance a;
  a.albedo = clampedAlbedo(blend(bare, coat, painted));
  a.normal = tilted(point.normal, (0.35F - 0.27F * painted) * relief);
  a.specular = 0.02F + 0.02F * painted;
  a.roughness = 0.85F + painted * (palette.roughness - 0.85F);
  return a;
}

Shader stone(const StonePalette& palette, std::uint32_t seed) {
  return [palette, seed](const SurfacePoint& point) { return shadeStone(point, palette, seed); };
}

}  // namespace scanner::simulation
