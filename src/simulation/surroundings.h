#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "scanner/simulation/scene.h"

namespace scanner::simulation {

/// Where a scene stands: a yard of old concrete with cracks, joints, stains and pebbles, and with
/// `background` a lawn, a low brick wall, a hedge and trees 3 to 15 m from `object` (map frame).
/// Few triangles: the detail is in the shaders.
std::vector<Part> makeSurroundings(const Eigen::AlignedBox3f& object, bool background, int seed);

}  // namespace scanner::simulation
