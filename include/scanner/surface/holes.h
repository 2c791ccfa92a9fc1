#pragma once

#include <cstddef>

#include "scanner/core/mesh.h"
#include "scanner/surface/options.h"

namespace scanner::surface {

struct HoleStatistics {
  std::size_t loops = 0;  ///< boundary loops found
  std::size_t filled = 0;
  std::size_t too_large = 0;   ///< left open: more edges or wider than allowed
  std::size_t outer_rims = 0;  ///< left open: the outline of an open sheet, not a hole in it
  std::size_t failed = 0;      ///< left open: no triangulation that keeps the mesh manifold
  std::size_t faces_added = 0;
  std::size_t vertices_added = 0;
};

/// Fills boundary loops of up to `max_edges` edges and `max_diameter_m` (Liepa, Filling holes in
/// meshes, SGP 2003): least-area triangulation by dynamic programming, refined to the edge length
/// of the rim, inner vertices relaxed; position, normal, colour and sigma of inner vertices follow
/// the rim harmonically. The outline of an open sheet, beyond which a patch would have to fold
/// back, is not a hole and stays. Needs a mesh without non-manifold edges (see clean()); a loop
/// through one is skipped. Vertices and faces that were there keep their index. Deterministic;
/// reentrant.
Mesh fillHoles(Mesh mesh, const HoleOptions& options, HoleStatistics* statistics = nullptr);

}  // namespace scanner::surface
