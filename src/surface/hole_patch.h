#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "scanner/core/mesh.h"
#include "surface/mesh_edges.h"

namespace scanner::surface {

/// Rim of a hole, ordered so that the patch's faces run along rim[i] -> rim[i+1].
struct HoleRim {
  std::vector<std::uint32_t> vertices;
  std::vector<Eigen::Vector3d>
      outer_normals;  ///< unit normal of the face beyond rim[i] -> rim[i+1]
};

/// Says whether two vertices already share an edge of the mesh.
using EdgeExists = std::function<bool(std::uint32_t, std::uint32_t)>;

/// Triangulation of the rim with the smallest worst dihedral angle, then least area, by dynamic
/// programming in O(n^3) (Liepa 2003, section 3; Barequet and Sharir 1995). Empty when every
/// triangulation would use an edge that exists already.
std::vector<Face> triangulateRim(const Mesh& mesh, const HoleRim& rim, const EdgeExists& exists);

/// Refines the patch to the density of its rim (Liepa 2003, section 4): faces are split at their
/// centroid while larger than the rim's edges suggest, edges flipped towards Delaunay, and inner
/// vertices relaxed harmonically with all their attributes. Appends the new vertices to `mesh`;
/// `patch` is replaced.
void refinePatch(Mesh& mesh, const HoleRim& rim, const EdgeExists& exists,
                 std::vector<Face>& patch);

}  // namespace scanner::surface
