#pragma once

#include <Eigen/Geometry>
#include <functional>

#include "scanner/simulation/scene.h"

namespace scanner::simulation {

/// A solid given by a function that is negative inside, zero on the surface and positive outside.
/// `distance` must be thread-safe, continuous, and not steeper than kSteepest: parts of space
/// further away than that tells are not looked at. It need not be an exact distance.
struct Implicit {
  std::function<float(const Eigen::Vector3f&)> distance;
  Eigen::AlignedBox3f bounds;  ///< holds all of the surface
};
constexpr float kSteepest = 1.6F;

/// The surface as a closed, manifold triangle mesh whose vertices lie on it, with normals from the
/// gradient; no shader. One vertex per cell of a cubic grid and sheet of surface in it (dual of
/// marching cubes: Nielson, Dual Marching Cubes, IEEE Vis 2004; ambiguous faces of the grid are
/// decided so that no edge has four triangles: Wenger, Isosurfaces, 2013, ch. 3). The same for
/// every thread count. Throws ConfigurationError when the surface is empty or leaves the bounds,
/// std::logic_error when the function was seen to be too steep.
Part polygonize(const Implicit& solid, float cell_m, int threads);

}  // namespace scanner::simulation
