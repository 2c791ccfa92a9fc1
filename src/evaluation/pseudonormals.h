#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "evaluation/triangle.h"

namespace scanner::evaluation {

using Triangle = std::array<std::uint32_t, 3>;

/// Normals whose sign tells inside from outside at every feature of a mesh (Baerentzen and Aanaes,
/// Signed distance computation using the angle weighted pseudonormal, 2005).
class Pseudonormals {
 public:
  Pseudonormals() = default;
  /// Every triangle must have an area; vertices at one place must share one index.
  Pseudonormals(const std::vector<Eigen::Vector3d>& vertices,
                const std::vector<Triangle>& triangles);

  /// Unit normal of a triangle.
  const Eigen::Vector3d& ofFace(std::uint32_t face) const { return faces_[face]; }
  /// Not of unit length.
  const Eigen::Vector3d& of(std::uint32_t face, const Triangle& corners, Feature feature) const;
  /// The feature is part of the rim of an open surface.
  bool onBoundary(std::uint32_t face, const Triangle& corners, Feature feature) const;

 private:
  void gatherEdges(const std::vector<Triangle>& triangles);

  std::vector<Eigen::Vector3d> faces_;
  std::vector<Eigen::Vector3d> vertices_;
  std::vector<Eigen::Vector3d> edges_;
  std::vector<Triangle> face_edges_;  ///< index into edges_ of the three edges of a face
  std::vector<bool> edge_boundary_;
  std::vector<bool> vertex_boundary_;
};

}  // namespace scanner::evaluation
