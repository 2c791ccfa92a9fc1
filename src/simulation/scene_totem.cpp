#include <algorithm>
#include <cmath>
#include <thread>

#include "scanner/core/parallel.h"
#include "scanner/simulation/noise.h"
#include "scanner/simulation/random.h"
#include "scanner/simulation/scene.h"
#include "simulation/carving.h"
#include "simulation/surroundings.h"
#include "simulation/totem_shader.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr double kPi = 3.141592653589793;
constexpr float kSunk = 0.01F;        ///< the pole's foot is in the ground
constexpr float kRimRadius = 0.010F;  ///< of the rounded edge on top
constexpr int kCapRings = 8;
constexpr std::size_t kRowGrain = 8;

/// One ring of the closed surface: a height and how much of the carved radius there is.
struct Ring {
  float z = 0.0F;
  float shrink = 1.0F;  ///< factor on the radius
  float inset = 0.0F;   ///< m
};

/// From the middle of the bottom up the side to the middle of the top; without the two poles.
std::vector<Ring> makeRings(float step_m) {
  std::vector<Ring> rings;
  for (int k = 1; k < kCapRings; ++k) {
    rings.push_back({-kSunk, static_cast<float>(k) / kCapRings, 0.0F});
  }
  const float top = kPoleHeight - kRimRadius;
  const int rows = std::max(8, static_cast<int>(std::lround((top + kSunk) / step_m)));
  for (int k = 0; k <= rows; ++k) {
    rings.push_back(
        {-kSunk + (top + kSunk) * static_cast<float>(k) / static_cast<float>(rows), 1.0F, 0.0F});
  }
  const int arc = std::max(2, static_cast<int>(std::lround(1.6F * kRimRadius / step_m)));
  for (int k = 1; k <= arc; ++k) {
    const float angle =
        0.5F * static_cast<float>(kPi) * static_cast<float>(k) / static_cast<float>(arc);
    rings.push_back(
        {top + kRimRadius * std::sin(angle), 1.0F, kRimRadius * (1.0F - std::cos(angle))});
  }
  for (int k = kCapRings - 1; k > 0; --k) {
    rings.push_back({kPoleHeight, static_cast<float>(k) / kCapRings, kRimRadius});
  }
  return rings;
}

/// Radius of the surface: trunk, carving and the unevenness of handiwork, which stays below 0.5 mm
/// so that the relief of one tier fits that of the next: the case in which registration slides.
float poleRadius(float x, float y, float z, std::uint32_t seed) {
  const Vector3f p(kTrunkRadius * x, kTrunkRadius * y, z);
  const float uneven = 0.0004F * fractalNoise(p, 0.16F, 0.02F, 0.5F, 0.0F, seed);
  return kTrunkRadius + carvedHeight(locateTile(x, y, z)) + uneven;
}

/// How much the surface stands out of its neighbourhood, m: paint wears off there, dirt gathers
/// where it is negative. Taken from the carving alone.
float prominence(float x, float y, float z) {
  constexpr float kReach = 0.012F;
  const float turn = kReach / kTrunkRadius;
  float around = carvedHeight(locateTile(x, y, z + kReach)) +
                 carvedHeight(locateTile(x, y, z - kReach)) +
                 carvedHeight(locateTile(x - turn * y, y + turn * x, z)) +
                 carvedHeight(locateTile(x + turn * y, y - turn * x, z));
  return carvedHeight(locateTile(x, y, z)) - 0.25F * around;
}

void addFaces(Part* part, std::uint32_t columns, std::uint32_t rings) {
  const std::uint32_t bottom = columns * rings;
  const std::uint32_t top = bottom + 1;
  part->faces.reserve(2 * static_cast<std::size_t>(columns) * rings);
  for (std::uint32_t c = 0; c < columns; ++c) {
    const std::uint32_t next = (c + 1) % columns;
    part->faces.push_back({bottom, next, c});
    for (std::uint32_t r = 0; r + 1 < rings; ++r) {
      const std::uint32_t low = r * columns;
      const std::uint32_t high = low + columns;
      part->faces.push_back({low + c, low + next, high + next});
      part->faces.push_back({low + c, high + next, high + c});
    }
    const std::uint32_t last = (rings - 1) * columns;
    part->faces.push_back({last + c, last + next, top});
  }
}

/// Area-weighted mean of the faces around a vertex.
void computeNormals(Part* part) {
  part->normals.assign(part->vertices.size(), Vector3f::Zero());
  for (const auto& [a, b, c] : part->faces) {
    const Vector3f& origin = part->vertices[a];
    const Vector3f n = (part->vertices[b] - origin).cross(part->vertices[c] - origin);
    for (const std::uint32_t i : {a, b, c}) part->normals[i] += n;
  }
  for (Vector3f& n : part->normals) n.normalize();
}

Part makePole(float step_m, std::uint32_t seed) {
  const std::vector<Ring> rings = makeRings(step_m);
  const auto columns = static_cast<std::size_t>(
      std::max(24L, std::lround(2.0 * kPi * static_cast<double>(kTrunkRadius / step_m))));
  Part part;
  part.name = "pole";
  part.vertices.resize(columns * rings.size() + 2);
  part.uvs.assign(part.vertices.size(), Vector2f::Zero());
  const int threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  parallelFor(rings.size(), kRowGrain, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r) {
      const Ring& ring = rings[r];
      for (std::size_t c = 0; c < columns; ++c) {
        const double angle = 2.0 * kPi * static_cast<double>(c) / static_cast<double>(columns);
        const auto x = static_cast<float>(std::cos(angle));
        const auto y = static_cast<float>(std::sin(angle));
        const float radius = (poleRadius(x, y, ring.z, seed) - ring.inset) * ring.shrink;
        part.vertices[r * columns + c] = {radius * x, radius * y, ring.z};
        part.uvs[r * columns + c].x() = prominence(x, y, ring.z);
      }
    }
  });
  part.vertices[columns * rings.size()] = {0.0F, 0.0F, -kSunk};
  part.vertices[columns * rings.size() + 1] = {0.0F, 0.0F, kPoleHeight};
  addFaces(&part, static_cast<std::uint32_t>(columns), static_cast<std::uint32_t>(rings.size()));
  computeNormals(&part);
  return part;
}

}  // namespace

Scene makeTotem(const SceneOptions& options, int seed) {
  const auto mixed = mixSeed(static_cast<std::uint64_t>(seed), 0x746f74656dULL);
  Scene scene;
  scene.name = "totem";
  Part pole = makePole(static_cast<float>(options.detail_m), static_cast<std::uint32_t>(mixed));
  pole.shader = paintedWood(static_cast<std::uint32_t>(mixed >> 32U));
  for (const Vector3f& v : pole.vertices) scene.bounds.extend(v);
  scene.object.push_back(std::move(pole));
  scene.surroundings = makeSurroundings(scene.bounds, options.background, seed);
  return scene;
}

}  // namespace scanner::simulation
