#include <algorithm>
#include <cmath>

#include "scanner/simulation/noise.h"
#include "simulation/materials.h"
#include "simulation/shading.h"
#include "simulation/solids.h"

// What stands or lies around the object: ground, bricks, plants.

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

/// Level ground would lie in a plane of the noise's lattice, where its grid shows: this rotation
/// turns it out of it.
Vector3f turned(const Vector3f& p) {
  return Vector3f(2.0F * p.x() - p.y() + 2.0F * p.z(), 2.0F * p.x() + 2.0F * p.y() - p.z(),
                  2.0F * p.y() + 2.0F * p.z() - p.x()) /
         3.0F;
}
Vector3f turnedBack(const Vector3f& p) {
  return Vector3f(2.0F * p.x() + 2.0F * p.y() - p.z(), 2.0F * p.y() + 2.0F * p.z() - p.x(),
                  2.0F * p.x() - p.y() + 2.0F * p.z()) /
         3.0F;
}

/// Coverage by a line of this half width at this distance from its middle, blurred to the pixel.
float lineCoverage(float distance_m, float half_width_m, float footprint_m) {
  const float blur = 0.5F * footprint_m + 0.0004F;
  const float covered = 1.0F - smoothStep(half_width_m - blur, half_width_m + blur, distance_m);
  return covered * std::min(1.0F, half_width_m / blur);
}

/// Joints between slabs, and cracks where the ground has settled. 0..1.
float jointsAndCracks(const Vector3f& p, float footprint_m, std::uint32_t seed) {
  constexpr float kSlab = 1.3F;
  constexpr float kJointHalf = 0.006F;
  const auto toLine = [](float x) {
    const float u = x / kSlab + 0.36F;
    return kSlab * std::abs(u - std::round(u));
  };
  const float wander = octave(p, 0.055F, footprint_m, seed + 1);
  const float joint = std::min(toLine(p.x()), toLine(p.y())) + 0.004F * wander;
  // A crack is where a slow noise passes zero: value over slope is the distance to it.
  Vector3f slope;
  constexpr float kCrackWave = 0.85F;
  constexpr float kCrackHalf = 0.0011F;
  const Vector3f bent = p + 0.02F * wander * Vector3f(1.0F, -1.0F, 0.0F);
  const float value =
      gradientNoise(bent / kCrackWave + Vector3f(0.3F, 0.6F, 0.4F), seed + 2, &slope);
  const float crack = kCrackWave * std::abs(value) / std::max(slope.head<2>().norm(), 0.3F);
  return std::max(lineCoverage(joint, kJointHalf, footprint_m),
                  0.9F * lineCoverage(crack, kCrackHalf * (1.0F + wander), footprint_m));
}

Appearance shadeConcrete(const SurfacePoint& point, bool joints, std::uint32_t seed) {
  const Vector3f p = turned(point.position);
  const float f = point.footprint_m;
  const float broad = octave(p, 0.9F, f, seed) + 0.6F * octave(p, 0.23F, f, seed + 1);
  const float middle = octave(p, 0.045F, f, seed + 2);
  const float coarse = octave(p, 0.009F, f, seed + 3);
  Vector3f relief = Vector3f::Zero();
  const float sand = reliefOctave(p, 0.0022F, f, seed + 4, &relief);
  Vector3f albedo = blend({0.40F, 0.385F, 0.35F}, {0.27F, 0.255F, 0.23F},
                          smoothStep(-0.5F, 0.5F, broad + 0.5F * middle));
  // Worn aggregate: stones of several colours show in the mortar.
  constexpr float kStones = 0.0062F;
  const float stones = octaveWeight(kStones, f);
  if (stones > 0.0F) {
    const Cell cell = cellularNoise(p, kStones, seed + 5);
    const float bare = cell.id < 0.55F ? 1.0F - smoothStep(0.26F, 0.36F, cell.nearest) : 0.0F;
    const Vector3f color = cell.id < 0.18F   ? Vector3f(0.13F, 0.12F, 0.12F)
                           : cell.id < 0.36F ? Vector3f(0.52F, 0.49F, 0.44F)
                                             : Vector3f(0.34F, 0.25F, 0.18F);
    albedo = blend(albedo, color, stones * bare);
  }
  const float grain = 1.0F + 0.25F * middle + 0.55F * coarse + 0.9F * sand;
  albedo *= std::max(grain, 0.3F);
  // Old stains, with a rim where they dried.
  const float stain = smoothStep(0.22F, 0.30F, broad - 0.25F * middle);
  albedo *= 1.0F - 0.35F * stain;
  if (joints) {
    albedo = blend(albedo, Vector3f(0.055F, 0.05F, 0.04F) * std::max(grain, 0.5F),
                   jointsAndCracks(point.position, f, seed + 20));
  }
  Appearance a;
  a.albedo = clampedAlbedo(albedo);
  a.normal = tilted(point.normal, 0.3F * turnedBack(relief));
  a.specular = 0.02F;
  a.roughness = 0.85F;
  return a;
}

Appearance shadeLawn(const SurfacePoint& point, std::uint32_t seed) {
  const Vector3f p = turned(point.position);
  const float f = point.footprint_m;
  const float broad = octave(p, 1.7F, f, seed) + 0.5F * octave(p, 0.4F, f, seed + 1);
  // Blades stand up: from the side the tufts are short and wide, in depth they hide each other.
  const float tufts = octave(p, 0.07F, f, seed + 2);
  const float blades = octave(p, 0.018F, f, seed + 3) + 0.7F * octave(p, 0.007F, f, seed + 4);
  const float light = std::max(0.62F + 0.5F * tufts + 0.9F * blades, 0.08F);
  Vector3f albedo =
      light * blend({0.16F, 0.21F, 0.075F}, {0.29F, 0.28F, 0.12F}, smoothStep(-0.4F, 0.6F, broad));
  const Cell flower = cellularNoise(p, 0.24F, seed + 5);
  if (flower.id < 0.35F && flower.nearest * 0.24F < 0.011F) {
    albedo = flower.id < 0.2F ? Vector3f(0.75F, 0.74F, 0.68F) : Vector3f(0.70F, 0.52F, 0.04F);
  }
  Appearance a;
  a.albedo = albedo;
  a.normal = (point.normal + 0.35F * Vector3f(tufts + blades, tufts - blades, 0.0F)).normalized();
  a.roughness = 0.9F;
  return a;
}

/// One layer of leaves: how light the leaf is that is on top here, 0 in the gap between leaves.
struct LeafLayer {
  float light = 0.0F;
  float id = 0.0F;
};
LeafLayer leafLayer(const Vector3f& p, float leaf_m, std::uint32_t seed) {
  const Cell cell = cellularNoise(p, leaf_m, seed);
  // Towards its tip a leaf bends away from the light, each one to another side.
  const float bend = std::sin(40.0F * cell.id) * cell.nearest;
  const float leaf = 1.0F - smoothStep(0.38F, 0.62F, cell.nearest);
  return {leaf * std::max(0.55F + 0.6F * cell.id + 0.7F * bend, 0.1F), cell.id};
}

Appearance shadeFoliage(const SurfacePoint& point, const Vector3f& leaf, std::uint32_t seed) {
  const Vector3f& p = point.position;
  const float f = point.footprint_m;
  constexpr float kLeaf = 0.034F;
  const float mass = octave(p, 0.5F, f, seed) + 0.6F * octave(p, 0.15F, f, seed + 1) +
                     0.4F * octave(p, 0.06F, f, seed + 2);
  const float seen = octaveWeight(kLeaf, f);
  float light = 0.5F;
  float hue = 0.5F;
  float turn = 0.0F;
  if (seen > 0.0F) {
    const LeafLayer front = leafLayer(p, kLeaf, seed + 3);
    // Through the gaps one sees leaves further in, in the shade of the others.
    const LeafLayer behind = front.light < 0.3F ? leafLayer(p, 0.8F * kLeaf, seed + 4) : front;
    light += seen * (std::max(front.light, 0.4F * behind.light) - light);
    hue = front.id;
    turn = 6.2832F * front.id;
  }
  const float depth = 0.22F + 0.78F * smoothStep(-0.5F, 0.35F, mass);
  Appearance a;
  a.albedo = blend(leaf, 1.5F * leaf + Vector3f(0.05F, 0.03F, 0.01F), hue) *
             std::max(1.25F * depth * light, 0.05F);
  const Vector3f tilt(std::cos(turn), std::sin(turn), 0.4F);
  a.normal = (point.normal + 0.55F * seen * tilt + 0.5F * mass * Vector3f::UnitZ()).normalized();
  a.specular = 0.02F;
  a.roughness = 0.6F;
  return a;
}

Appearance shadeBark(const SurfacePoint& point, std::uint32_t seed) {
  const Vector3f& p = point.position;
  const float f = point.footprint_m;
  const Vector3f stretched = p.cwiseProduct(Vector3f(1.0F, 1.0F, 0.22F));
  const float ridges =
      octave(stretched, 0.045F, f, seed) + 0.6F * octave(stretched, 0.018F, f, seed + 1);
  const float fine = octave(p, 0.009F, f, seed + 2);
  const float moss = smoothStep(0.05F, 0.4F, octave(p, 0.35F, f, seed + 3));
  Appearance a;
  a.albedo = Vector3f(0.20F, 0.155F, 0.115F) * std::max(0.8F + 1.3F * ridges + 0.5F * fine, 0.12F);
  a.albedo = blend(a.albedo, {0.16F, 0.18F, 0.06F}, 0.4F * moss);
  a.normal = point.normal;
  a.roughness = 0.95F;
  return a;
}

Appearance shadeBricks(const SurfacePoint& point, std::uint32_t seed) {
  constexpr float kLength = 0.225F, kCourse = 0.075F, kJointHalf = 0.0055F;
  const Vector3f& p = point.position;
  const float f = point.footprint_m;
  // Headers where the wall runs the other way show as stretchers: far enough off not to matter.
  const float along = std::abs(point.normal.x()) > std::abs(point.normal.y()) ? p.y() : p.x();
  const float course = p.z() / kCourse;
  const auto row = static_cast<std::int32_t>(std::floor(course));
  const float brick = along / kLength + ((row & 1) != 0 ? 0.5F : 0.0F);
  const auto column = static_cast<std::int32_t>(std::floor(brick));
  const float in_x = kLength * (0.5F - std::abs(brick - static_cast<float>(column) - 0.5F));
  const float in_z = kCourse * (0.5F - std::abs(course - static_cast<float>(row) - 0.5F));
  const float mortar = lineCoverage(std::min(in_x, in_z), kJointHalf, f);

  const float tone = hashUnit(column, row, 3, seed);
  const float burnt = hashUnit(column, row, 4, seed);
  const float patch = octave(p, 0.11F, f, seed + 1);
  const float pores = octave(p, 0.014F, f, seed + 2) + 0.7F * octave(p, 0.005F, f, seed + 3);
  Vector3f color = blend({0.36F, 0.15F, 0.09F}, {0.46F, 0.25F, 0.15F}, tone);
  color = blend(color, {0.17F, 0.11F, 0.10F}, smoothStep(0.72F, 0.95F, burnt));
  color *= std::max(1.0F + 0.3F * patch + 0.5F * pores, 0.3F);
  const Vector3f lime = Vector3f(0.42F, 0.40F, 0.36F) * std::max(1.0F + 0.5F * pores, 0.4F);
  Appearance a;
  a.albedo = blend(color, lime, mortar);
  // Damp and green near the ground.
  const float damp = smoothStep(0.30F, 0.0F, p.z() + 0.15F * patch);
  a.albedo = blend(a.albedo, Vector3f(0.10F, 0.11F, 0.06F), 0.5F * damp);
  a.normal = point.normal;
  a.roughness = 0.9F;
  return a;
}

}  // namespace

Shader concrete(bool joints, std::uint32_t seed) {
  return [joints, seed](const SurfacePoint& p) { return shadeConcrete(p, joints, seed); };
}

Shader lawn(std::uint32_t seed) {
  return [seed](const SurfacePoint& p) { return shadeLawn(p, seed); };
}

Shader foliage(const Vector3f& leaf, std::uint32_t seed) {
  return [leaf, seed](const SurfacePoint& p) { return shadeFoliage(p, leaf, seed); };
}

Shader bark(std::uint32_t seed) {
  return [seed](const SurfacePoint& p) { return shadeBark(p, seed); };
}

Shader bricks(std::uint32_t seed) {
  return [seed](const SurfacePoint& p) { return shadeBricks(p, seed); };
}

}  // namespace scanner::simulation
