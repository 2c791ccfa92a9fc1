#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "simulation/polygonize.h"

namespace scanner::simulation {

/// Values of an implicit solid on the corners of a cubic grid, kept only in bricks of 4x4x4 near
/// the surface. A brick holds the corners at the low ends of its cells.
class BrickGrid {
 public:
  static constexpr int kEdge = 4;
  static constexpr int kBrickCells = kEdge * kEdge * kEdge;
  static constexpr std::size_t kEmpty = static_cast<std::size_t>(-1);

  BrickGrid(const Implicit& solid, float cell_m, int threads);

  /// Coordinates, in bricks, of those near the surface, in order.
  const std::vector<Eigen::Vector3i>& bricks() const { return bricks_; }
  /// Coordinates within a brick of its i-th cell or corner.
  static Eigen::Vector3i localOffset(int i) {
    return {i % kEdge, i / kEdge % kEdge, i / (kEdge * kEdge)};
  }
  Eigen::Vector3f position(const Eigen::Vector3i& corner) const {
    return origin_ + cell_m_ * corner.cast<float>();
  }
  /// Number of a corner (or cell) among those kept; kEmpty when far from the surface.
  std::size_t entry(const Eigen::Vector3i& at) const;
  /// Negative inside. Far from the surface only the sign counts.
  float value(const Eigen::Vector3i& corner) const;
  /// At the rim of the grid, where cells lack neighbours.
  bool onBorder(const Eigen::Vector3i& cell) const;

 private:
  std::size_t brickIndex(const Eigen::Vector3i& at) const;

  float cell_m_;
  Eigen::Vector3f origin_;
  Eigen::Vector3i brick_counts_;
  std::vector<std::int32_t> slots_;  ///< per brick: its place among bricks_, kOutside or kInside
  std::vector<Eigen::Vector3i> bricks_;
  std::vector<float> values_;
};

}  // namespace scanner::simulation
