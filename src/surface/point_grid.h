#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace scanner::surface {

/// Finite points sorted into cubic cells, for all neighbours within a radius of at most one cell
/// edge. Visits neighbours in an order fixed by the points alone. Points are copied in cell order,
/// which keeps neighbours close in memory. Reading is thread-safe.
class PointGrid {
 public:
  /// cell_m > 0; points finite.
  PointGrid(const std::vector<Eigen::Vector3f>& points, double cell_m);

  /// Calls visit(index, squared_distance) for every point within radius_m (<= cell_m) of p.
  template <typename Visit>
  void forEachWithin(const Eigen::Vector3f& p, double radius_m, Visit&& visit) const {
    const float r2 = static_cast<float>(radius_m * radius_m);
    const Cell c = cellOf(p);
    for (std::int64_t z = c.z - 1; z <= c.z + 1; ++z) {
      for (std::int64_t y = c.y - 1; y <= c.y + 1; ++y) {
        for (std::int64_t x = c.x - 1; x <= c.x + 1; ++x) {
          const Range range = find(keyOf({x, y, z}));
          for (std::uint32_t i = range.begin; i < range.end; ++i) {
            const float d2 = (sorted_[i] - p).squaredNorm();
            if (d2 <= r2) visit(static_cast<std::size_t>(order_[i]), d2);
          }
        }
      }
    }
  }

  /// Indices of the points in cell order: points close in it are mostly close in space.
  const std::vector<std::uint32_t>& order() const { return order_; }

 private:
  struct Cell {
    std::int64_t x, y, z;
  };
  struct Range {
    std::uint32_t begin = 0, end = 0;
  };
  struct Slot {
    std::uint64_t key;
    Range range;
  };

  Cell cellOf(const Eigen::Vector3f& p) const;
  static std::uint64_t keyOf(const Cell& c);
  Range find(std::uint64_t key) const;
  std::size_t hash(std::uint64_t key) const;
  void buildTable(const std::vector<std::uint64_t>& sorted_keys);

  double inverse_cell_;
  Eigen::Vector3f origin_ = Eigen::Vector3f::Zero();
  std::vector<Eigen::Vector3f> sorted_;
  std::vector<std::uint32_t> order_;
  std::vector<Slot> table_;
  int shift_ = 63;
};

}  // namespace scanner::surface
