#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <set>
#include <vector>

#include "scanner/core/mesh.h"
#include "scanner/surface/statistics.h"

namespace scanner::surface::test {

constexpr double kPi = 3.14159265358979323846;

/// About n evenly spread points on a sphere (Fibonacci lattice) with outward normals.
inline PointCloud spherePoints(std::size_t n, double radius) {
  PointCloud cloud;
  const double golden = kPi * (3.0 - std::sqrt(5.0));
  for (std::size_t i = 0; i < n; ++i) {
    const double z = 1.0 - 2.0 * (static_cast<double>(i) + 0.5) / static_cast<double>(n);
    const double r = std::sqrt(1.0 - z * z);
    const double a = golden * static_cast<double>(i);
    const Eigen::Vector3d d(r * std::cos(a), r * std::sin(a), z);
    cloud.points.push_back((radius * d).cast<float>());
    cloud.normals.push_back(d.cast<float>());
    const auto channel = [](double v) { return static_cast<std::uint8_t>(127.5 * (1.0 + v)); };
    cloud.colors.push_back({channel(d.x()), channel(d.y()), channel(d.z())});
  }
  return cloud;
}

/// Points on a torus about z, spaced about `spacing`.
inline PointCloud torusPoints(double major, double minor, double spacing) {
  PointCloud cloud;
  const int rings = static_cast<int>(2.0 * kPi * minor / spacing);
  for (int i = 0; i < rings; ++i) {
    const double v = 2.0 * kPi * i / rings;
    const double r = major + minor * std::cos(v);
    const int steps = static_cast<int>(2.0 * kPi * r / spacing);
    for (int j = 0; j < steps; ++j) {
      const double u = 2.0 * kPi * (j + 0.5 * (i % 2)) / steps;
      const Eigen::Vector3d n(std::cos(v) * std::cos(u), std::cos(v) * std::sin(u), std::sin(v));
      cloud.points.push_back(
          (Eigen::Vector3d(major * std::cos(u), major * std::sin(u), 0.0) + minor * n)
              .cast<float>());
      cloud.normals.push_back(n.cast<float>());
    }
  }
  return cloud;
}

/// nx x ny points in the plane z with normal (0, 0, up), corner at the origin.
inline PointCloud planePoints(int nx, int ny, double spacing, double z, double up = 1.0) {
  PointCloud cloud;
  for (int y = 0; y < ny; ++y) {
    for (int x = 0; x < nx; ++x) {
      cloud.points.push_back(Eigen::Vector3d(x * spacing, y * spacing, z).cast<float>());
      cloud.normals.push_back(Eigen::Vector3d(0.0, 0.0, up).cast<float>());
    }
  }
  return cloud;
}

/// Unit cube at `offset`, twelve faces, outward; colours by corner.
inline Mesh cube(const Eigen::Vector3f& offset = Eigen::Vector3f::Zero()) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3f corner(static_cast<float>(i & 1), static_cast<float>((i >> 1) & 1),
                                 static_cast<float>((i >> 2) & 1));
    mesh.vertices.points.push_back(corner + offset);
    mesh.vertices.normals.push_back((corner - Eigen::Vector3f::Constant(0.5F)).normalized());
    mesh.vertices.colors.push_back({static_cast<std::uint8_t>(255 * (i & 1)),
                                    static_cast<std::uint8_t>(255 * ((i >> 1) & 1)),
                                    static_cast<std::uint8_t>(255 * ((i >> 2) & 1))});
  }
  mesh.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

inline Mesh joined(Mesh a, const Mesh& b) {
  const auto offset = static_cast<std::uint32_t>(a.vertices.size());
  a.vertices.append(b.vertices);
  for (const auto& f : b.faces) a.faces.push_back({f[0] + offset, f[1] + offset, f[2] + offset});
  return a;
}

/// Grid of (n+1)^2 vertices in z = 0, unit square, two faces a cell, facing +z.
inline Mesh gridMesh(int n) {
  Mesh mesh;
  mesh.vertices = planePoints(n + 1, n + 1, 1.0 / n, 0.0);
  const auto at = [n](int x, int y) { return static_cast<std::uint32_t>(y * (n + 1) + x); };
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      mesh.faces.push_back({at(x, y), at(x + 1, y), at(x + 1, y + 1)});
      mesh.faces.push_back({at(x, y), at(x + 1, y + 1), at(x, y + 1)});
    }
  }
  return mesh;
}

/// V - E + F over the referenced vertices.
inline long eulerCharacteristic(const Mesh& mesh) {
  std::set<std::uint32_t> vertices;
  std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const auto& f : mesh.faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      vertices.insert(f[k]);
      edges.insert({std::min(f[k], f[(k + 1) % 3]), std::max(f[k], f[(k + 1) % 3])});
    }
  }
  return static_cast<long>(vertices.size()) - static_cast<long>(edges.size()) +
         static_cast<long>(mesh.faces.size());
}

/// Signed volume of a closed mesh: positive when faces look outwards.
inline double volume(const Mesh& mesh) {
  double sum = 0.0;
  for (const auto& f : mesh.faces) {
    const auto at = [&](std::size_t k) { return mesh.vertices.points[f[k]].cast<double>(); };
    sum += at(0).dot(at(1).cross(at(2))) / 6.0;
  }
  return sum;
}

inline double area(const Mesh& mesh) {
  double sum = 0.0;
  for (const auto& f : mesh.faces) {
    const Eigen::Vector3d a = mesh.vertices.points[f[0]].cast<double>();
    sum += 0.5 * (mesh.vertices.points[f[1]].cast<double>() - a)
                     .cross(mesh.vertices.points[f[2]].cast<double>() - a)
                     .norm();
  }
  return sum;
}

/// RMS deviation of the points from a sphere about the origin.
inline double radialRms(const PointCloud& cloud, double radius) {
  double sum = 0.0;
  for (const auto& p : cloud.points) sum += std::pow(double{p.norm()} - radius, 2);
  return std::sqrt(sum / static_cast<double>(cloud.size()));
}

inline bool sameBytes(const Mesh& a, const Mesh& b) {
  return a.faces == b.faces && a.vertices.points == b.vertices.points &&
         a.vertices.normals == b.vertices.normals && a.vertices.colors == b.vertices.colors &&
         a.vertices.sigmas == b.vertices.sigmas;
}

}  // namespace scanner::surface::test
