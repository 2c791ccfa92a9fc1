#include "evaluation/pseudonormals.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <tuple>

namespace scanner::evaluation {
namespace {

struct HalfEdge {
  std::uint32_t low, high;  ///< vertices
  std::uint32_t face;
  std::uint32_t side;  ///< which edge of the face
  bool operator<(const HalfEdge& o) const {
    return std::tie(low, high, face, side) < std::tie(o.low, o.high, o.face, o.side);
  }
};

std::size_t cornerOf(Feature feature) { return static_cast<std::size_t>(feature); }
std::size_t sideOf(Feature feature) {
  return static_cast<std::size_t>(feature) - static_cast<std::size_t>(Feature::kEdge0);
}

}  // namespace

Pseudonormals::Pseudonormals(const std::vector<Eigen::Vector3d>& vertices,
                             const std::vector<Triangle>& triangles)
    : vertices_(vertices.size(), Eigen::Vector3d::Zero()),
      face_edges_(triangles.size()),
      vertex_boundary_(vertices.size(), false) {
  faces_.reserve(triangles.size());
  for (const Triangle& t : triangles) {
    const std::array<Eigen::Vector3d, 3> p{vertices[t[0]], vertices[t[1]], vertices[t[2]]};
    const Eigen::Vector3d normal = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
    faces_.push_back(normal);
    for (std::size_t i = 0; i < 3; ++i) {
      const Eigen::Vector3d u = p[(i + 1) % 3] - p[i], v = p[(i + 2) % 3] - p[i];
      vertices_[t[i]] += std::atan2(u.cross(v).norm(), u.dot(v)) * normal;
    }
  }
  gatherEdges(triangles);
}

void Pseudonormals::gatherEdges(const std::vector<Triangle>& triangles) {
  std::vector<HalfEdge> half_edges;
  half_edges.reserve(3 * triangles.size());
  for (std::uint32_t f = 0; f < triangles.size(); ++f) {
    for (std::uint32_t side = 0; side < 3; ++side) {
      const auto [low, high] = std::minmax({triangles[f][side], triangles[f][(side + 1) % 3]});
      half_edges.push_back({low, high, f, side});
    }
  }
  std::sort(half_edges.begin(), half_edges.end());
  for (std::size_t begin = 0, end = 0; begin < half_edges.size(); begin = end) {
    const HalfEdge& first = half_edges[begin];
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (end = begin; end < half_edges.size() && half_edges[end].low == first.low &&
                      half_edges[end].high == first.high;
         ++end) {
      sum += faces_[half_edges[end].face];
      face_edges_[half_edges[end].face][half_edges[end].side] =
          static_cast<std::uint32_t>(edges_.size());
    }
    edges_.push_back(sum);
    edge_boundary_.push_back(end - begin == 1);
    if (end - begin == 1) vertex_boundary_[first.low] = vertex_boundary_[first.high] = true;
  }
}

const Eigen::Vector3d& Pseudonormals::of(std::uint32_t face, const Triangle& corners,
                                         Feature feature) const {
  if (feature == Feature::kFace) return faces_[face];
  if (feature <= Feature::kVertex2) return vertices_[corners[cornerOf(feature)]];
  return edges_[face_edges_[face][sideOf(feature)]];
}

bool Pseudonormals::onBoundary(std::uint32_t face, const Triangle& corners, Feature feature) const {
  if (feature == Feature::kFace) return false;
  if (feature <= Feature::kVertex2) return vertex_boundary_[corners[cornerOf(feature)]];
  return edge_boundary_[face_edges_[face][sideOf(feature)]];
}

}  // namespace scanner::evaluation
