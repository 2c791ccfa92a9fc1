#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "scanner/core/parallel.h"
#include "scanner/simulation/noise.h"
#include "scanner/simulation/scene.h"
#include "simulation/artwork_shape.h"
#include "simulation/materials.h"
#include "simulation/polygonize.h"
#include "simulation/solids.h"
#include "simulation/surroundings.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

constexpr int kThreads = 2;  ///< the mesh does not depend on it
constexpr std::size_t kKinds = 5;

StonePalette plinthPalette() {
  StonePalette p;
  p.base = {0.21F, 0.21F, 0.20F};
  p.dark = {0.045F, 0.045F, 0.05F};
  p.light = {0.46F, 0.45F, 0.43F};
  p.stain = {0.15F, 0.11F, 0.07F};
  p.growth = {0.20F, 0.25F, 0.07F};
  p.grain_m = 0.0020F;
  p.lichen = 0.55F;
  p.bump = 0.25F;
  return p;
}

StonePalette eggPalette() {
  StonePalette p;
  p.base = {0.46F, 0.34F, 0.26F};
  p.dark = {0.15F, 0.11F, 0.09F};
  p.light = {0.66F, 0.58F, 0.50F};
  p.stain = {0.20F, 0.12F, 0.07F};
  p.growth = {0.50F, 0.47F, 0.20F};
  p.grain_m = 0.0013F;
  p.lichen = 0.25F;
  p.bump = 0.14F;
  return p;
}

StonePalette slabPalette() {
  StonePalette p;
  p.base = {0.29F, 0.29F, 0.32F};
  p.dark = {0.09F, 0.09F, 0.11F};
  p.light = {0.47F, 0.47F, 0.48F};
  p.stain = {0.32F, 0.20F, 0.10F};
  p.growth = {0.52F, 0.54F, 0.44F};
  p.grain_m = 0.0013F;
  p.stains = 0.65F;
  p.bump = 0.12F;
  return p;
}

PaintPalette crownPalette() {
  PaintPalette p;
  p.paint = {0.13F, 0.29F, 0.27F};
  p.faded = {0.24F, 0.46F, 0.41F};
  p.ground = {0.25F, 0.135F, 0.08F};
  p.edge = {0.60F, 0.55F, 0.44F};
  p.wear = 0.42F;
  return p;
}

/// Earthenware: five glazes over a light body, worn and speckled.
StonePalette glaze(int kind) {
  static const std::array<std::array<Vector3f, 2>, 5> kColors = {{
      {Vector3f(0.66F, 0.58F, 0.42F), Vector3f(0.28F, 0.17F, 0.08F)},
      {Vector3f(0.52F, 0.34F, 0.16F), Vector3f(0.22F, 0.12F, 0.06F)},
      {Vector3f(0.20F, 0.34F, 0.35F), Vector3f(0.07F, 0.13F, 0.15F)},
      {Vector3f(0.42F, 0.20F, 0.13F), Vector3f(0.15F, 0.07F, 0.05F)},
      {Vector3f(0.62F, 0.60F, 0.54F), Vector3f(0.18F, 0.20F, 0.24F)},
  }};
  const auto& [color, dark] = kColors[static_cast<std::size_t>(kind)];
  StonePalette p;
  p.base = color;
  p.dark = dark;
  p.light = 0.75F * color + Vector3f::Constant(0.16F);
  p.stain = 0.45F * color;
  p.grain_m = 0.0011F;
  p.crystals = 0.35F;
  p.stains = 0.6F;
  p.lichen = 0.0F;
  p.bump = 0.07F;
  p.roughness = 0.3F;
  return p;
}

Appearance shadeTile(const ArtworkShape& shape, const SurfacePoint& point, std::uint32_t seed) {
  const TilePlace tile = shape.tileAt(point.position);
  const float pick = hashUnit(tile.column, tile.row, 5, seed);
  static const std::array<StonePalette, 5> kGlazes = {glaze(0), glaze(1), glaze(2), glaze(3),
                                                      glaze(4)};
  Appearance a = shadeStone(point, kGlazes[static_cast<std::size_t>(pick * 5.0F)], seed + 1);
  // No two tiles left the kiln alike.
  a.albedo *= 0.75F + 0.5F * hashUnit(tile.column, tile.row, 6, seed);
  constexpr float kCrackCell = 0.0075F;
  const float visible = octaveWeight(0.25F * kCrackCell, point.footprint_m);
  if (visible > 0.0F) {
    const Cell crack = cellularNoise(point.position, kCrackCell, seed + 2);
    a.albedo *=
        1.0F - 0.6F * visible * (1.0F - smoothStep(0.03F, 0.10F, crack.second - crack.nearest));
  }
  // Dirt gathers along the joints, mortar fills them.
  constexpr float kMortarHalf = 0.0026F;
  a.albedo *= 0.55F + 0.45F * smoothStep(kMortarHalf, 0.0075F, tile.joint_m);
  const float blur = std::max(point.footprint_m, 0.0006F);
  const float mortar =
      1.0F - smoothStep(kMortarHalf - 0.5F * blur, kMortarHalf + 0.5F * blur, tile.joint_m);
  if (mortar > 0.0F) {
    const float sand =
        fractalNoise(point.position, 0.004F, 0.001F, 0.9F, point.footprint_m, seed + 3);
    const Vector3f color = Vector3f(0.31F, 0.29F, 0.25F) * std::max(1.0F + 1.6F * sand, 0.2F);
    a.albedo += mortar * (color - a.albedo);
    a.roughness += mortar * (0.9F - a.roughness);
  }
  return a;
}

/// Dust and the rest of a paint stay where rain does not wash them away: in the impressions.
Appearance shadeSlab(const ArtworkShape& shape, const SurfacePoint& point,
                     const StonePalette& palette, std::uint32_t seed) {
  Appearance a = shadeStone(point, palette, seed);
  const float depth = smoothStep(0.12F, 0.6F, shape.impressionDepth(point.position));
  if (depth <= 0.0F) return a;
  const float rest = gradientNoise(point.position / 0.009F, seed + 17);
  const float amount = depth * (0.35F + 0.45F * smoothStep(-0.2F, 0.2F, rest));
  const float brightness = a.albedo.sum() / (3.0F * palette.base.mean());
  a.albedo += amount * (Vector3f(0.52F, 0.36F, 0.16F) * brightness - a.albedo);
  return a;
}

Shader shaderOf(ArtworkKind kind, const std::shared_ptr<const ArtworkShape>& shape,
                std::uint32_t seed) {
  switch (kind) {
    case ArtworkKind::kPlinth:
      return stone(plinthPalette(), seed + 100);
    case ArtworkKind::kBumpy:
      return stone(eggPalette(), seed + 200);
    case ArtworkKind::kTiled:
      return [shape, seed](const SurfacePoint& p) { return shadeTile(*shape, p, seed + 300); };
    case ArtworkKind::kImpressed:
      return [shape, palette = slabPalette(), seed](const SurfacePoint& p) {
        return shadeSlab(*shape, p, palette, seed + 400);
      };
    case ArtworkKind::kCarpentry:
      break;
  }
  return [palette = crownPalette(), seed](const SurfacePoint& p) {
    return shadePaint(p, palette, seed + 500);
  };
}

/// One part per kind of surface, so that no shader has to find out where it is. Together they are
/// the closed mesh: where two parts meet both have the same vertices.
std::vector<Part> splitByKind(const Part& whole, const std::shared_ptr<const ArtworkShape>& shape,
                              std::uint32_t seed) {
  std::vector<ArtworkKind> kinds(whole.vertices.size());
  parallelFor(kinds.size(), 4096, kThreads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) kinds[i] = shape->kindAt(whole.vertices[i]);
  });
  static const std::array<const char*, kKinds> kNames = {"plinth", "bumpy", "tiled", "impressed",
                                                         "solids"};
  constexpr auto kUnused = std::numeric_limits<std::uint32_t>::max();
  std::vector<Part> parts(kKinds);
  std::vector<std::vector<std::uint32_t>> renumbered(
      kKinds, std::vector<std::uint32_t>(whole.vertices.size(), kUnused));
  for (const auto& face : whole.faces) {
    // The kind of most corners; of the first when all differ.
    const ArtworkKind kind = kinds[face[1]] == kinds[face[2]] ? kinds[face[1]] : kinds[face[0]];
    const auto k = static_cast<std::size_t>(kind);
    std::array<std::uint32_t, 3> corners{};
    for (std::size_t i = 0; i < 3; ++i) {
      std::uint32_t& number = renumbered[k][face[i]];
      if (number == kUnused) {
        number = static_cast<std::uint32_t>(parts[k].vertices.size());
        parts[k].vertices.push_back(whole.vertices[face[i]]);
        parts[k].normals.push_back(whole.normals[face[i]]);
      }
      corners[i] = number;
    }
    parts[k].faces.push_back(corners);
  }
  for (std::size_t k = 0; k < kKinds; ++k) {
    parts[k].name = kNames[k];
    parts[k].shader = shaderOf(static_cast<ArtworkKind>(k), shape, seed);
  }
  return parts;
}

}  // namespace

Scene makeArtwork(const SceneOptions& options, int seed) {
  const auto noise_seed = static_cast<std::uint32_t>(seed) * 1000U;
  const auto shape = std::make_shared<const ArtworkShape>(noise_seed);
  const Part whole =
      polygonize({[&](const Vector3f& p) { return shape->distance(p); }, shape->bounds()},
                 static_cast<float>(options.detail_m), kThreads);
  Scene scene;
  scene.name = "artwork";
  scene.object = splitByKind(whole, shape, noise_seed);
  for (const Vector3f& v : whole.vertices) scene.bounds.extend(v);
  scene.surroundings = makeSurroundings(scene.bounds, options.background, seed);
  return scene;
}

}  // namespace scanner::simulation
