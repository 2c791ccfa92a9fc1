#include "scanner/simulation/scene.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "scanner/core/parallel.h"
#include "scanner/core/status.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

std::uint8_t encodeSrgb(float linear) {
  const float v = std::clamp(linear, 0.0F, 1.0F);
  const float s = v <= 0.0031308F ? 12.92F * v : 1.055F * std::pow(v, 1.0F / 2.4F) - 0.055F;
  return static_cast<std::uint8_t>(std::lround(255.0F * s));
}

/// Mean length of the edges: what a vertex stands for when its colour is asked.
float meanEdge(const Part& part) {
  double sum = 0.0;
  for (const auto& face : part.faces) {
    sum += static_cast<double>((part.vertices[face[0]] - part.vertices[face[1]]).norm());
  }
  return part.faces.empty() ? 0.0F
                            : static_cast<float>(sum / static_cast<double>(part.faces.size()));
}

/// Everything of `part` appended to the mesh, each vertex with the colour of its shader.
void append(const Part& part, Mesh* mesh) {
  const auto first = static_cast<std::uint32_t>(mesh->vertices.size());
  PointCloud& cloud = mesh->vertices;
  cloud.points.insert(cloud.points.end(), part.vertices.begin(), part.vertices.end());
  cloud.normals.insert(cloud.normals.end(), part.normals.begin(), part.normals.end());
  cloud.colors.resize(cloud.points.size());
  const float footprint = meanEdge(part);
  constexpr int kThreads = 2;
  parallelFor(part.vertices.size(), 4096, kThreads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      SurfacePoint point;
      point.position = part.vertices[i];
      point.normal = part.normals[i];
      point.uv = part.uvs.empty() ? Eigen::Vector2f::Zero() : part.uvs[i];
      if (!part.colors.empty()) point.color = part.colors[i];
      point.footprint_m = footprint;
      const Vector3f albedo = part.shader(point).albedo;
      cloud.colors[first + i] = {encodeSrgb(albedo.x()), encodeSrgb(albedo.y()),
                                 encodeSrgb(albedo.z())};
    }
  });
  for (const auto& [a, b, c] : part.faces) mesh->faces.push_back({first + a, first + b, first + c});
}

bool before(const Vector3f& a, const Vector3f& b) {
  return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

/// Vertices at exactly the same place become one (parts share their borders, textured meshes are
/// cut along seams); the first of them stays.
Mesh welded(const Mesh& mesh) {
  const std::vector<Vector3f>& points = mesh.vertices.points;
  std::vector<std::uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return before(points[a], points[b]) || (a < b && points[a] == points[b]);
  });
  std::vector<std::uint32_t> representative(points.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && points[order[i]] == points[order[i - 1]];
    representative[order[i]] = same ? representative[order[i - 1]] : order[i];
  }
  Mesh result;
  std::vector<std::uint32_t> renumbered(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    if (representative[i] != i) continue;
    renumbered[i] = static_cast<std::uint32_t>(result.vertices.size());
    result.vertices.appendFrom(mesh.vertices, i);
  }
  for (const auto& [a, b, c] : mesh.faces) {
    const std::array<std::uint32_t, 3> face = {renumbered[representative[a]],
                                               renumbered[representative[b]],
                                               renumbered[representative[c]]};
    if (face[0] != face[1] && face[1] != face[2] && face[2] != face[0])
      result.faces.push_back(face);
  }
  return result;
}

}  // namespace

Scene makeScene(const std::string& name_or_path, const SceneOptions& options, int seed) {
  if (name_or_path == "artwork") return makeArtwork(options, seed);
  if (name_or_path == "totem") return makeTotem(options, seed);
  if (name_or_path == "target") return makeTarget(options, seed);
  if (!std::filesystem::exists(name_or_path)) {
    throw ConfigurationError("scene '" + name_or_path +
                             "' is neither artwork, totem or target nor a file");
  }
  return loadMeshScene(name_or_path, options, seed);
}

Mesh referenceMesh(const Scene& scene) {
  Mesh mesh;
  for (const Part& part : scene.object) append(part, &mesh);
  return welded(mesh);
}

}  // namespace scanner::simulation
