#include "simulation/polygonize.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include "scanner/core/parallel.h"
#include "scanner/core/status.h"
#include "simulation/brick_grid.h"
#include "simulation/cell_loops.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;
using Eigen::Vector3i;

/// A cell that the surface passes through.
struct SurfaceCell {
  Vector3i at;
  std::uint8_t inside = 0;  ///< bit i: corner i is inside
  CellLoops loops;
  std::uint32_t first_vertex = 0;
};

std::uint8_t insideMask(const BrickGrid& grid, const Vector3i& at) {
  unsigned mask = 0;
  for (int i = 0; i < 8; ++i) {
    if (grid.value(at + cornerOffset(i)) < 0.0F) mask |= 1U << static_cast<unsigned>(i);
  }
  return static_cast<std::uint8_t>(mask);
}

class Polygonizer {
 public:
  Polygonizer(const Implicit& solid, float cell_m, int threads)
      : solid_(solid), cell_m_(cell_m), threads_(threads), grid_(solid, cell_m, threads) {}

  Part run() {
    findCells();
    separateSheets();
    Part part;
    placeVertices(&part);
    connect(&part);
    return part;
  }

 private:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  void findCells();
  void separateSheets();
  void placeVertices(Part* part) const;
  void connect(Part* part) const;

  const SurfaceCell* cellAt(const Vector3i& at) const {
    const std::size_t entry = grid_.entry(at);
    if (entry == BrickGrid::kEmpty || cell_of_entry_[entry] == kNone) return nullptr;
    return &cells_[cell_of_entry_[entry]];
  }
  Vector3f crossing(const SurfaceCell& cell, int edge) const;
  Vector3f gradient(const Vector3f& p) const;
  Vector3f project(const Vector3f& start) const;
  float bisect(const Vector3f& start, const Vector3f& direction, float value) const;

  const Implicit& solid_;
  float cell_m_;
  int threads_;
  BrickGrid grid_;
  std::vector<SurfaceCell> cells_;
  std::vector<std::uint32_t> cell_of_entry_;  ///< by BrickGrid::entry
};

void Polygonizer::findCells() {
  const std::vector<Vector3i>& bricks = grid_.bricks();
  constexpr std::size_t kGrain = 64;
  std::vector<std::vector<SurfaceCell>> found(chunkCount(bricks.size(), kGrain));
  parallelFor(bricks.size(), kGrain, threads_, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      for (int i = 0; i < BrickGrid::kBrickCells; ++i) {
        const Vector3i at = bricks[b] * BrickGrid::kEdge + BrickGrid::localOffset(i);
        const std::uint8_t mask = insideMask(grid_, at);
        if (mask == 0 || mask == 255) continue;
        found[begin / kGrain].push_back({at, mask, findLoops(mask, 0), 0});
      }
    }
  });
  cell_of_entry_.assign(bricks.size() * BrickGrid::kBrickCells, kNone);
  for (const std::vector<SurfaceCell>& chunk : found) {
    for (const SurfaceCell& cell : chunk) {
      if (grid_.onBorder(cell.at)) {
        throw ConfigurationError("polygonize: the surface leaves the bounds that were given");
      }
      cell_of_entry_[grid_.entry(cell.at)] = static_cast<std::uint32_t>(cells_.size());
      cells_.push_back(cell);
    }
  }
  if (cells_.empty()) throw ConfigurationError("polygonize: there is no surface in the bounds");
}

/// Where both sheets through an ambiguous face belong to one loop in both cells that share it, the
/// dual edge between the two cells would have four triangles. Joining the other two corners of the
/// face instead splits the loop in two in both cells. Loops are only ever split, so one pass does.
void Polygonizer::separateSheets() {
  std::uint32_t vertices = 0;
  for (SurfaceCell& cell : cells_) {
    for (int axis = 0; axis < 3; ++axis) {
      const int face = 2 * axis + 1;
      if (!isAmbiguous(cell.inside, face) || !isOneLoop(cell.loops, face)) continue;
      const SurfaceCell* other = cellAt(cell.at + Vector3i::Unit(axis));
      if (other == nullptr || !isOneLoop(other->loops, face - 1)) continue;
      SurfaceCell& next = cells_[static_cast<std::size_t>(other - cells_.data())];
      cell.loops = findLoops(cell.inside, cell.loops.flipped_faces | (1U << unsigned(face)));
      next.loops = findLoops(next.inside, next.loops.flipped_faces | (1U << unsigned(face - 1)));
    }
  }
  for (SurfaceCell& cell : cells_) {
    cell.first_vertex = vertices;
    vertices += cell.loops.count;
  }
}

Vector3f Polygonizer::crossing(const SurfaceCell& cell, int edge) const {
  const auto [a, b] = edgeCorners(edge);
  const Vector3i from = cell.at + cornerOffset(a), to = cell.at + cornerOffset(b);
  const float va = grid_.value(from), vb = grid_.value(to);
  const float t = std::clamp(va / (va - vb), 0.0F, 1.0F);
  return (1.0F - t) * grid_.position(from) + t * grid_.position(to);
}

/// From four evaluations at the corners of a tetrahedron. The step is large against the resolution
/// of float and small against the cell.
Vector3f Polygonizer::gradient(const Vector3f& p) const {
  const float h = 0.2F * cell_m_;
  const std::array<Vector3f, 4> corners = {Vector3f(1, -1, -1), Vector3f(-1, -1, 1),
                                           Vector3f(-1, 1, -1), Vector3f(1, 1, 1)};
  Vector3f sum = Vector3f::Zero();
  for (const Vector3f& corner : corners) sum += corner * solid_.distance(p + h * corner);
  return sum / (4.0F * h);
}

/// Where along the line from `start`, within a cell, the sign changes; 0 when it does not.
float Polygonizer::bisect(const Vector3f& start, const Vector3f& direction, float value) const {
  float inner = 0.0F;
  float outer = value < 0.0F ? cell_m_ : -cell_m_;
  if ((solid_.distance(start + outer * direction) < 0.0F) == (value < 0.0F)) return 0.0F;
  constexpr int kHalvings = 16;
  for (int i = 0; i < kHalvings; ++i) {
    const float middle = 0.5F * (inner + outer);
    const bool same = (solid_.distance(start + middle * direction) < 0.0F) == (value < 0.0F);
    (same ? inner : outer) = middle;
  }
  return 0.5F * (inner + outer);
}

/// Onto the surface along the gradient at `start`: Newton's step, then the secant method.
Vector3f Polygonizer::project(const Vector3f& start) const {
  constexpr float kTolerance = 1e-6F;
  constexpr int kSteps = 6;
  const Vector3f slope = gradient(start);
  const float steepness = slope.norm();
  const float first_value = solid_.distance(start);
  if (!(steepness > 1e-3F) || std::abs(first_value) < kTolerance) return start;
  const Vector3f direction = slope / steepness;
  float t0 = 0.0F, v0 = first_value;
  float t1 = -first_value / steepness;
  for (int i = 0; i < kSteps && std::abs(t1) < cell_m_; ++i) {
    const float v1 = solid_.distance(start + t1 * direction);
    if (std::abs(v1) < kTolerance) return start + t1 * direction;
    if (v1 == v0) break;
    const float t2 = t1 - v1 * (t1 - t0) / (v1 - v0);
    t0 = t1;
    v0 = v1;
    t1 = t2;
  }
  return start + bisect(start, direction, first_value) * direction;
}

void Polygonizer::placeVertices(Part* part) const {
  const std::size_t count = cells_.back().first_vertex + cells_.back().loops.count;
  part->vertices.resize(count);
  part->normals.resize(count);
  parallelFor(cells_.size(), 256, threads_, [&](std::size_t begin, std::size_t end) {
    for (std::size_t c = begin; c < end; ++c) {
      const SurfaceCell& cell = cells_[c];
      for (unsigned loop = 0; loop < cell.loops.count; ++loop) {
        Vector3f sum = Vector3f::Zero();
        int crossings = 0;
        for (int edge = 0; edge < kCellEdges; ++edge) {
          if (cell.loops.of_edge[static_cast<std::size_t>(edge)] != loop) continue;
          sum += crossing(cell, edge);
          ++crossings;
        }
        const Vector3f p = project(sum / static_cast<float>(crossings));
        part->vertices[cell.first_vertex + loop] = p;
        part->normals[cell.first_vertex + loop] = gradient(p).normalized();
      }
    }
  });
}

/// One quadrilateral round every edge of the grid that crosses the surface.
void Polygonizer::connect(Part* part) const {
  part->faces.reserve(2 * part->vertices.size() + 64);
  for (const SurfaceCell& cell : cells_) {
    for (int axis = 0; axis < 3; ++axis) {
      const bool inside = (cell.inside & 1U) != 0;
      const bool end_inside = (cell.inside >> (1U << static_cast<unsigned>(axis)) & 1U) != 0;
      if (inside == end_inside) continue;
      const Vector3i b = Vector3i::Unit((axis + 1) % 3), c = Vector3i::Unit((axis + 2) % 3);
      // The four cells round the edge, counter-clockwise seen from its far end.
      constexpr std::array<std::array<int, 2>, 4> kRound = {{{1, 1}, {0, 1}, {0, 0}, {1, 0}}};
      std::array<std::uint32_t, 4> q{};
      for (std::size_t i = 0; i < 4; ++i) {
        const auto [back_b, back_c] = kRound[i];
        const SurfaceCell* around = cellAt(cell.at - back_b * b - back_c * c);
        if (around == nullptr) throw std::logic_error("polygonize: steeper than kSteepest");
        const int edge = 4 * axis + back_b + 2 * back_c;
        q[i] = around->first_vertex + around->loops.of_edge[static_cast<std::size_t>(edge)];
      }
      if (!inside) std::swap(q[1], q[3]);
      const std::vector<Vector3f>& v = part->vertices;
      if ((v[q[0]] - v[q[2]]).squaredNorm() <= (v[q[1]] - v[q[3]]).squaredNorm()) {
        part->faces.push_back({q[0], q[1], q[2]});
        part->faces.push_back({q[0], q[2], q[3]});
      } else {
        part->faces.push_back({q[1], q[2], q[3]});
        part->faces.push_back({q[1], q[3], q[0]});
      }
    }
  }
}

}  // namespace

Part polygonize(const Implicit& solid, float cell_m, int threads) {
  if (!(cell_m > 0.0F) || solid.bounds.isEmpty()) {
    throw ConfigurationError("polygonize: needs a positive cell and bounds that are not empty");
  }
  return Polygonizer(solid, cell_m, threads).run();
}

}  // namespace scanner::simulation
