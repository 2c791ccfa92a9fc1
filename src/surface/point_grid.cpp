#include "surface/point_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace scanner::surface {
namespace {

// 21 bits an axis. A cloud wider than that many cells is clamped to the border cells, which keeps
// answers right (clamping never moves two cells further apart) and only costs time there.
constexpr std::int64_t kMaxCell = (std::int64_t{1} << 21) - 4;
constexpr std::uint64_t kEmpty = std::numeric_limits<std::uint64_t>::max();

std::int64_t axisCell(float value, float origin, double inverse_cell) {
  const double cell = std::floor((double{value} - double{origin}) * inverse_cell);
  return static_cast<std::int64_t>(std::clamp(cell, 0.0, static_cast<double>(kMaxCell)));
}

}  // namespace

PointGrid::PointGrid(const std::vector<Eigen::Vector3f>& points, double cell_m)
    : inverse_cell_(1.0 / cell_m) {
  if (points.empty()) return;
  origin_ = points.front();
  for (const auto& p : points) origin_ = origin_.cwiseMin(p);
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keyed(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    keyed[i] = {keyOf(cellOf(points[i])), static_cast<std::uint32_t>(i)};
  }
  std::sort(keyed.begin(), keyed.end());
  std::vector<std::uint64_t> keys(points.size());
  order_.resize(points.size());
  sorted_.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    keys[i] = keyed[i].first;
    order_[i] = keyed[i].second;
    sorted_[i] = points[keyed[i].second];
  }
  buildTable(keys);
}

PointGrid::Cell PointGrid::cellOf(const Eigen::Vector3f& p) const {
  return {axisCell(p.x(), origin_.x(), inverse_cell_), axisCell(p.y(), origin_.y(), inverse_cell_),
          axisCell(p.z(), origin_.z(), inverse_cell_)};
}

std::uint64_t PointGrid::keyOf(const Cell& c) {
  // One is added so that the neighbours of border cells stay non-negative.
  return (static_cast<std::uint64_t>(c.z + 1) << 42) | (static_cast<std::uint64_t>(c.y + 1) << 21) |
         static_cast<std::uint64_t>(c.x + 1);
}

std::size_t PointGrid::hash(std::uint64_t key) const {
  return static_cast<std::size_t>((key * 0x9E3779B97F4A7C15ULL) >> shift_);
}

void PointGrid::buildTable(const std::vector<std::uint64_t>& sorted_keys) {
  std::size_t cells = 0;
  for (std::size_t i = 0; i < sorted_keys.size(); ++i) {
    cells += i == 0 || sorted_keys[i] != sorted_keys[i - 1] ? 1 : 0;
  }
  int bits = 4;
  while ((std::size_t{1} << bits) < 2 * cells) ++bits;
  shift_ = 64 - bits;
  table_.assign(std::size_t{1} << bits, Slot{kEmpty, {}});
  const std::size_t mask = table_.size() - 1;
  for (std::size_t begin = 0; begin < sorted_keys.size();) {
    std::size_t end = begin + 1;
    while (end < sorted_keys.size() && sorted_keys[end] == sorted_keys[begin]) ++end;
    std::size_t slot = hash(sorted_keys[begin]);
    while (table_[slot].key != kEmpty) slot = (slot + 1) & mask;
    table_[slot] = {sorted_keys[begin],
                    {static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end)}};
    begin = end;
  }
}

PointGrid::Range PointGrid::find(std::uint64_t key) const {
  if (table_.empty()) return {};
  const std::size_t mask = table_.size() - 1;
  for (std::size_t slot = hash(key);; slot = (slot + 1) & mask) {
    if (table_[slot].key == key) return table_[slot].range;
    if (table_[slot].key == kEmpty) return {};
  }
}

}  // namespace scanner::surface
