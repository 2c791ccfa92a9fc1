#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "scanner/simulation/scene.h"

namespace scanner::simulation {

/// Share of ink (0..1) at a place of an endless sheet (m) covered with random symbols of three
/// sizes (20, 10 and 5 mm; the finest strokes 0.6 mm) in random orientation, in the manner of the
/// symbol font of thesis 3.2. Anti-aliased to the footprint. `tone` receives the ink's reflectance.
float symbolInk(const Eigen::Vector2f& sheet_m, float footprint_m, std::uint32_t seed, float* tone);

/// Paper printed with such symbols, dull, with grain; uv are metres on the sheet.
Shader printedSymbols(std::uint32_t seed);

}  // namespace scanner::simulation
