#include "simulation/brick_grid.h"

#include <cmath>

#include "scanner/core/parallel.h"

namespace scanner::simulation {
namespace {

constexpr std::int32_t kOutside = -1;
constexpr std::int32_t kInside = -2;
constexpr std::int32_t kNear = 0;

}  // namespace

BrickGrid::BrickGrid(const Implicit& solid, float cell_m, int threads)
    : cell_m_(cell_m),
      // A margin of more than a cell, so that the outermost corners are outside; odd, so that a
      // solid that is symmetric in its bounds does not meet the corners exactly.
      origin_(solid.bounds.min() - Eigen::Vector3f::Constant(1.37F * cell_m)),
      brick_counts_((((solid.bounds.sizes() / cell_m).array() + 4.0F) / kEdge).ceil().cast<int>()) {
  const auto nx = static_cast<std::size_t>(brick_counts_.x());
  const auto ny = static_cast<std::size_t>(brick_counts_.y());
  slots_.resize(nx * ny * static_cast<std::size_t>(brick_counts_.z()));
  const auto brickAt = [&](std::size_t i) {
    return Eigen::Vector3i(static_cast<int>(i % nx), static_cast<int>(i / nx % ny),
                           static_cast<int>(i / (nx * ny)));
  };
  const float reach = kSteepest * 0.5F * std::sqrt(3.0F) * kEdge * cell_m;
  parallelFor(slots_.size(), 1024, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector3f center =
          position(kEdge * brickAt(i)) + Eigen::Vector3f::Constant(0.5F * kEdge * cell_m);
      const float d = solid.distance(center);
      slots_[i] = d > reach ? kOutside : d < -reach ? kInside : kNear;
    }
  });
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (slots_[i] != kNear) continue;
    slots_[i] = static_cast<std::int32_t>(bricks_.size());
    bricks_.push_back(brickAt(i));
  }
  values_.resize(bricks_.size() * kBrickCells);
  parallelFor(bricks_.size(), 64, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      for (int i = 0; i < kBrickCells; ++i) {
        values_[b * kBrickCells + static_cast<std::size_t>(i)] =
            solid.distance(position(kEdge * bricks_[b] + localOffset(i)));
      }
    }
  });
}

std::size_t BrickGrid::brickIndex(const Eigen::Vector3i& at) const {
  const Eigen::Vector3i brick = at / kEdge;
  return static_cast<std::size_t>(brick.x()) +
         static_cast<std::size_t>(brick_counts_.x()) *
             (static_cast<std::size_t>(brick.y()) +
              static_cast<std::size_t>(brick_counts_.y()) * static_cast<std::size_t>(brick.z()));
}

std::size_t BrickGrid::entry(const Eigen::Vector3i& at) const {
  const std::int32_t slot = slots_[brickIndex(at)];
  if (slot < 0) return kEmpty;
  const int local = at.x() % kEdge + kEdge * (at.y() % kEdge + kEdge * (at.z() % kEdge));
  return static_cast<std::size_t>(slot) * kBrickCells + static_cast<std::size_t>(local);
}

float BrickGrid::value(const Eigen::Vector3i& corner) const {
  // Corners at the far rim of the grid are in no brick: outside, as the margin makes sure.
  if ((corner.array() >= kEdge * brick_counts_.array()).any()) return cell_m_;
  const std::int32_t slot = slots_[brickIndex(corner)];
  if (slot < 0) return slot == kOutside ? cell_m_ : -cell_m_;
  return values_[entry(corner)];
}

bool BrickGrid::onBorder(const Eigen::Vector3i& cell) const {
  return (cell.array() <= 0).any() || (cell.array() >= kEdge * brick_counts_.array() - 1).any();
}

}  // namespace scanner::simulation
