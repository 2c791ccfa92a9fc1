#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "scanner/simulation/noise.h"

/// The noise of noise.h for every processor, and with eight lattice points at a time: most of the
/// time of a picture goes into it. Both give the same bits.
namespace scanner::simulation {

namespace plain {
float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed);
float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed, Eigen::Vector3f* gradient);
Cell cellularNoise(const Eigen::Vector3f& position_m, float cell_m, std::uint32_t seed);
}  // namespace plain

/// Call only when available().
namespace avx2 {
bool available();
float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed);
float gradientNoise(const Eigen::Vector3f& p, std::uint32_t seed, Eigen::Vector3f* gradient);
Cell cellularNoise(const Eigen::Vector3f& position_m, float cell_m, std::uint32_t seed);
}  // namespace avx2

}  // namespace scanner::simulation
