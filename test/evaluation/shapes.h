#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <random>
#include <utility>

#include "scanner/core/mesh.h"

namespace scanner::evaluation::shapes {

using FaceIndices = std::array<std::uint32_t, 3>;

inline Mesh makeMesh(const std::vector<Eigen::Vector3d>& points,
                     const std::vector<FaceIndices>& faces) {
  Mesh mesh;
  for (const auto& p : points) mesh.vertices.points.emplace_back(p.cast<float>());
  mesh.faces = faces;
  return mesh;
}

/// Unit directions of a subdivided octahedron: 2 + 4^(n+1) of them; the planes of the coordinates
/// cut it along edges.
inline Mesh directions(int subdivisions) {
  std::vector<Eigen::Vector3d> points{{1, 0, 0},  {-1, 0, 0}, {0, 1, 0},
                                      {0, -1, 0}, {0, 0, 1},  {0, 0, -1}};
  std::vector<FaceIndices> faces{{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                 {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int round = 0; round < subdivisions; ++round) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto [at, made] =
          middles.emplace(std::minmax(a, b), static_cast<std::uint32_t>(points.size()));
      if (made) points.push_back((points[a] + points[b]).normalized());
      return at->second;
    };
    std::vector<FaceIndices> finer;
    for (const auto& [a, b, c] : faces) {
      const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    faces = finer;
  }
  return makeMesh(points, faces);
}

/// A closed surface seen from the origin at `radius(direction)`.
inline Mesh starShaped(int subdivisions,
                       const std::function<double(const Eigen::Vector3d&)>& radius) {
  Mesh mesh = directions(subdivisions);
  for (auto& p : mesh.vertices.points) {
    const Eigen::Vector3d d = p.cast<double>().normalized();
    p = (radius(d) * d).cast<float>();
  }
  return mesh;
}

inline Mesh sphere(double radius_m, int subdivisions = 5) {
  return starShaped(subdivisions, [=](const Eigen::Vector3d&) { return radius_m; });
}

/// Without any symmetry; about 0.3 m.
inline double bumpyRadius(const Eigen::Vector3d& d) {
  return 0.3 + 0.03 * std::sin(5.0 * d.x() + 1.0) * std::cos(4.0 * d.y()) +
         0.04 * std::sin(3.0 * d.z() + 2.0 * d.x()) + 0.02 * std::cos(7.0 * d.y() - 3.0 * d.z());
}

/// Axis-aligned, centred, edge of 2 m, two faces a side.
inline Mesh cube() {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 8; ++i) {
    points.emplace_back((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1);
  }
  return makeMesh(points, {{0, 2, 3},
                           {0, 3, 1},
                           {4, 5, 7},
                           {4, 7, 6},
                           {0, 1, 5},
                           {0, 5, 4},
                           {2, 6, 7},
                           {2, 7, 3},
                           {0, 4, 6},
                           {0, 6, 2},
                           {1, 3, 7},
                           {1, 7, 5}});
}

/// Uniform in [low, high): the standard's distributions differ between libraries.
inline double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * (static_cast<double>(random() >> 11U) * 0x1p-53);
}

inline Eigen::Vector3d uniformPoint(std::mt19937_64& random, double low, double high) {
  const double x = uniform(random, low, high), y = uniform(random, low, high);
  return {x, y, uniform(random, low, high)};
}

}  // namespace scanner::evaluation::shapes
