#pragma once

#include <cstddef>

#include "scanner/core/mesh.h"
#include "scanner/surface/options.h"

namespace scanner::surface {

/// How much each step of clean() removed.
struct CleaningStatistics {
  std::size_t invalid_faces = 0;  ///< index out of range or a vertex that is not finite
  std::size_t duplicate_vertices = 0;
  std::size_t degenerate_faces = 0;  ///< a repeated corner, or zero area
  std::size_t duplicate_faces = 0;   ///< same corners, whichever way round
  std::size_t non_manifold_faces = 0;
  std::size_t colored_vertices = 0;
  std::size_t colored_faces = 0;  ///< faces that lost a corner to the colour
  std::size_t pieces = 0;         ///< isolated pieces removed
  std::size_t piece_faces = 0;
  std::size_t split_vertices = 0;  ///< copies made where separate fans met
  std::size_t unreferenced_vertices = 0;
};

/// Cleans a mesh (thesis 4.7). In this order: invalid faces; vertices at exactly the same place
/// merged, when their normals do not oppose; degenerate faces; duplicate faces; vertices of the
/// given colour with their faces; non-manifold faces (of an edge with more than two faces the two
/// largest stay; of two faces running the same way along an edge the larger one); isolated pieces;
/// vertices joining separate fans split; unreferenced vertices. Order of what stays is kept. Never
/// fails: an empty mesh stays empty. Deterministic; reentrant.
Mesh clean(Mesh mesh, const CleaningOptions& options, CleaningStatistics* statistics = nullptr);

}  // namespace scanner::surface
