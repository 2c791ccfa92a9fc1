#include "simulation/surroundings.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>

#include "scanner/simulation/noise.h"
#include "scanner/simulation/random.h"
#include "simulation/materials.h"
#include "simulation/polygonize.h"
#include "simulation/solids.h"

namespace scanner::simulation {
namespace {

using Eigen::AlignedBox3f;
using Eigen::Vector3f;

constexpr int kThreads = 2;  ///< the meshes do not depend on it
constexpr float kPi = 3.14159265F;

void appendQuad(Part* part, const std::array<Vector3f, 4>& corners) {
  const auto first = static_cast<std::uint32_t>(part->vertices.size());
  const Vector3f normal = (corners[1] - corners[0]).cross(corners[3] - corners[0]).normalized();
  for (const Vector3f& corner : corners) {
    part->vertices.push_back(corner);
    part->normals.push_back(normal);
  }
  part->faces.push_back({first, first + 1, first + 2});
  part->faces.push_back({first, first + 2, first + 3});
}

/// A level rectangle at height z, seen from above.
void appendFloor(Part* part, float x0, float x1, float y0, float y1, float z) {
  appendQuad(part,
             {Vector3f(x0, y0, z), Vector3f(x1, y0, z), Vector3f(x1, y1, z), Vector3f(x0, y1, z)});
}

void appendBox(Part* part, const Vector3f& low, const Vector3f& high) {
  const auto corner = [&](int i) {
    return Vector3f((i & 1) != 0 ? high.x() : low.x(), (i & 2) != 0 ? high.y() : low.y(),
                    (i & 4) != 0 ? high.z() : low.z());
  };
  constexpr std::array<std::array<int, 4>, 6> kSides = {
      {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}};
  for (const auto& [a, b, c, d] : kSides) {
    appendQuad(part, {corner(a), corner(b), corner(c), corner(d)});
  }
}

/// Angular gravel: octahedra, subdivided and dented, half sunk into the ground.
void appendPebble(Part* part, const Vector3f& center, const Vector3f& radii, std::uint32_t seed) {
  constexpr int kRings = 5, kSides = 9;
  const auto first = static_cast<std::uint32_t>(part->vertices.size());
  for (int ring = 0; ring <= kRings; ++ring) {
    const float polar = kPi * static_cast<float>(ring) / kRings;
    for (int side = 0; side < kSides; ++side) {
      const float turn = 2.0F * kPi * static_cast<float>(side) / kSides;
      const Vector3f n(std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn),
                       std::cos(polar));
      const float dent = 1.0F + 0.35F * gradientNoise(1.1F * n + center * 977.0F, seed);
      part->vertices.push_back(center + dent * n.cwiseProduct(radii));
      part->normals.push_back(n.cwiseQuotient(radii).normalized());
    }
  }
  for (std::uint32_t ring = 0; ring < kRings; ++ring) {
    for (std::uint32_t side = 0; side < kSides; ++side) {
      const std::uint32_t a = first + ring * kSides + side;
      const std::uint32_t b = first + ring * kSides + (side + 1) % kSides;
      if (ring > 0) part->faces.push_back({a, a + kSides, b});
      if (ring + 1 < kRings) part->faces.push_back({b, a + kSides, b + kSides});
    }
  }
}

Part makePebbles(const AlignedBox3f& object, int seed) {
  Random random(mixSeed(static_cast<std::uint64_t>(seed), 31));
  Part part;
  part.name = "pebbles";
  constexpr int kCount = 150;
  const float clear = 0.5F * object.sizes().head<2>().norm() + 0.02F;
  for (int i = 0; i < kCount; ++i) {
    const double turn = random.uniform(0.0, 2.0 * kPi);
    // Denser near the object, where they can be seen.
    const double far = random.uniform();
    const double distance = static_cast<double>(clear) + 1.8 * far * far;
    const double size = 0.002 + 0.006 * std::pow(random.uniform(), 3.0);
    const Vector3f radii(static_cast<float>(size * random.uniform(0.8, 1.5)),
                         static_cast<float>(size * random.uniform(0.7, 1.2)),
                         static_cast<float>(size * random.uniform(0.5, 0.9)));
    const Vector3f center(static_cast<float>(distance * std::cos(turn)),
                          static_cast<float>(distance * std::sin(turn)), 0.45F * radii.z());
    appendPebble(&part, center, radii, static_cast<std::uint32_t>(seed));
  }
  StonePalette gravel;
  gravel.grain_m = 0.0009F;
  gravel.base = {0.34F, 0.31F, 0.28F};
  gravel.lichen = 0.0F;
  part.shader = stone(gravel, static_cast<std::uint32_t>(seed) + 7U);
  return part;
}

/// A lobed mass of leaves as a displaced solid.
Part makeFoliage(std::string name, const std::function<float(const Vector3f&)>& solid,
                 const AlignedBox3f& box, float cell_m, const Vector3f& leaf, std::uint32_t seed) {
  const auto displaced = [&](const Vector3f& p) {
    const float d = solid(p);
    if (std::abs(d) > 1.0F) return d;
    const float lumps =
        0.16F * gradientNoise(p / 0.55F, seed) + 0.07F * gradientNoise(p / 0.21F, seed + 1);
    return d - lumps;
  };
  const Vector3f margin = Vector3f::Constant(0.3F);
  Part part = polygonize({displaced, {box.min() - margin, box.max() + margin}}, cell_m, kThreads);
  part.name = std::move(name);
  part.shader = foliage(leaf, seed + 2);
  return part;
}

Part makeHedge(std::string name, const Vector3f& low, const Vector3f& high, float cell_m,
               const Vector3f& leaf, std::uint32_t seed) {
  const Vector3f center = 0.5F * (low + high), half = 0.5F * (high - low);
  return makeFoliage(
      std::move(name), [=](const Vector3f& p) { return boxDistance(p - center, half, 0.12F); },
      {low, high}, cell_m, leaf, seed);
}

struct Tree {
  Vector3f foot;
  float height;
  float spread;
};

void appendTree(const Tree& tree, std::uint32_t seed, std::vector<Part>* parts) {
  const Vector3f top = tree.foot + Vector3f(0.1F, -0.08F, 0.62F * tree.height);
  const float girth = 0.035F * tree.height;
  const auto trunk = [&](const Vector3f& p) {
    return capsuleDistance(p, tree.foot - Vector3f(0.0F, 0.0F, 0.3F), top, girth) -
           0.2F * girth * gradientNoise(p / 0.3F, seed);
  };
  AlignedBox3f box(tree.foot - Vector3f(0.0F, 0.0F, 0.3F));
  box.extend(top);
  const Vector3f margin = Vector3f::Constant(1.3F * girth);
  Part stem =
      polygonize({trunk, {box.min() - margin, box.max() + margin}}, 0.35F * girth, kThreads);
  stem.name = "trunk";
  stem.shader = bark(seed + 5);
  parts->push_back(std::move(stem));

  const Vector3f heart = tree.foot + Vector3f(0.0F, 0.0F, 0.66F * tree.height);
  const auto crown = [&](const Vector3f& p) {
    float d = 1e3F;
    for (int i = 0; i < 7; ++i) {
      const float turn =
          2.0F * kPi * (static_cast<float>(i) / 7.0F + 0.1F * hashUnit(i, 1, 2, seed));
      const float reach = tree.spread * (i == 0 ? 0.0F : 0.55F);
      const float rise = tree.height * (0.30F * hashUnit(i, 3, 4, seed) - 0.12F);
      const Vector3f ball = heart + Vector3f(reach * std::cos(turn), reach * std::sin(turn), rise);
      d = smoothUnion(d, (p - ball).norm() - tree.spread * (0.42F + 0.2F * hashUnit(i, 5, 6, seed)),
                      0.3F);
    }
    return d;
  };
  const Vector3f half(1.35F * tree.spread, 1.35F * tree.spread, 0.95F * tree.height);
  parts->push_back(makeFoliage("crown", crown, {heart - half, heart + half}, 0.16F,
                               {0.12F, 0.16F, 0.06F}, seed + 10));
}

void appendBackground(std::uint32_t seed, std::vector<Part>* parts) {
  Part wall;
  wall.name = "wall";
  appendBox(&wall, {-4.2F, 4.3F, -0.1F}, {5.5F, 4.54F, 0.84F});
  appendBox(&wall, {5.26F, 0.6F, -0.1F}, {5.5F, 4.3F, 0.84F});
  wall.shader = bricks(seed + 1);
  parts->push_back(std::move(wall));
  Part coping;
  coping.name = "coping";
  appendBox(&coping, {-4.24F, 4.26F, 0.84F}, {5.54F, 4.58F, 0.91F});
  appendBox(&coping, {5.22F, 0.56F, 0.84F}, {5.54F, 4.26F, 0.91F});
  coping.shader = concrete(false, seed + 2);
  parts->push_back(std::move(coping));

  parts->push_back(makeHedge("hedge", {-5.6F, -6.0F, -0.3F}, {-4.7F, 3.6F, 1.35F}, 0.10F,
                             {0.115F, 0.155F, 0.065F}, seed + 10));
  // A taller one far off closes the view all round.
  const Vector3f dark(0.08F, 0.11F, 0.05F);
  constexpr float kFar = 16.0F, kThick = 1.2F, kTall = 3.2F;
  const auto ring = [](const Vector3f& p) {
    const Vector3f q = p.cwiseAbs();
    const float out = std::abs(std::max(q.x(), q.y()) - kFar) - 0.5F * kThick;
    return std::max(out, p.z() - kTall);
  };
  Part far = makeFoliage(
      "far hedge", [=](const Vector3f& p) { return std::max(ring(p), -0.3F - p.z()); },
      {Vector3f(-kFar - kThick, -kFar - kThick, -0.4F),
       Vector3f(kFar + kThick, kFar + kThick, kTall)},
      0.30F, dark, seed + 20);
  parts->push_back(std::move(far));
  const std::array<Tree, 6> trees = {{{{-2.2F, 8.6F, 0.0F}, 5.2F, 1.9F},
                                      {{4.6F, 10.4F, 0.0F}, 6.0F, 2.3F},
                                      {{10.2F, 3.1F, 0.0F}, 5.0F, 2.0F},
                                      {{8.1F, -5.4F, 0.0F}, 4.3F, 1.7F},
                                      {{-2.6F, -9.8F, 0.0F}, 5.6F, 2.1F},
                                      {{-10.5F, -1.5F, 0.0F}, 6.2F, 2.4F}}};
  std::uint32_t number = 0;
  for (const Tree& tree : trees) appendTree(tree, seed + 100U * ++number, parts);
}

}  // namespace

std::vector<Part> makeSurroundings(const AlignedBox3f& object, bool background, int seed) {
  const auto noise_seed = static_cast<std::uint32_t>(seed) * 1000U + 500000U;
  std::vector<Part> parts;
  Part yard;
  yard.name = "concrete";
  constexpr float kWest = -3.1F, kEast = 3.4F, kSouth = -2.9F, kNorth = 3.5F, kEnd = 40.0F;
  if (background) {
    appendFloor(&yard, kWest, kEast, kSouth, kNorth, 0.0F);
  } else {
    appendFloor(&yard, -kEnd, kEnd, -kEnd, kEnd, 0.0F);
  }
  yard.shader = concrete(true, noise_seed);
  parts.push_back(std::move(yard));
  parts.push_back(makePebbles(object, seed));
  if (!background) return parts;

  Part grass;
  grass.name = "lawn";
  appendFloor(&grass, -kEnd, kEnd, kNorth, kEnd, 0.0F);
  appendFloor(&grass, -kEnd, kEnd, -kEnd, kSouth, 0.0F);
  appendFloor(&grass, -kEnd, kWest, kSouth, kNorth, 0.0F);
  appendFloor(&grass, kEast, kEnd, kSouth, kNorth, 0.0F);
  grass.shader = lawn(noise_seed + 50U);
  parts.push_back(std::move(grass));
  appendBackground(noise_seed + 1000U, &parts);
  return parts;
}

}  // namespace scanner::simulation
