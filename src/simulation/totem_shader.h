#pragma once

#include <cstdint>

#include "scanner/simulation/scene.h"

namespace scanner::simulation {

/// The totem's paint over weathered wood with vertical grain, following the lines of the carving
/// (carving.h). A solid texture of the map frame; uv.x is how much the surface stands out of its
/// neighbourhood (m). The choice of paints differs from tier to tier and detail down to 0.3 mm
/// repeats nowhere.
Shader paintedWood(std::uint32_t seed);

}  // namespace scanner::simulation
