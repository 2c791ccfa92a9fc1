#pragma once

#include <cstddef>

#include "scanner/core/mesh.h"

namespace scanner::surface {

struct MeshStatistics {
  std::size_t vertices = 0;
  std::size_t faces = 0;
  std::size_t components = 0;      ///< pieces joined by edges; unreferenced vertices do not count
  std::size_t boundary_edges = 0;  ///< edges with one face
  std::size_t non_manifold_edges = 0;  ///< edges with more than two faces
  double mean_spacing_m = 0.0;         ///< mean edge length; 0 without edges
};

/// Faces whose indices are out of range are not counted. Deterministic; reentrant.
MeshStatistics meshStatistics(const Mesh& mesh);

}  // namespace scanner::surface
