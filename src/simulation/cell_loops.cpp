#include "simulation/cell_loops.h"

#include <algorithm>

namespace scanner::simulation {
namespace {

/// Corners and edges of a face in cyclic order; edge i joins corners i and i + 1.
struct Face {
  std::array<int, 4> corners;
  std::array<int, 4> edges;
};

Face describeFace(int face) {
  const int a = face / 2, side = face % 2;
  const int b = (a + 1) % 3, c = (a + 2) % 3;
  const int base = side << a;
  return {{base, base + (1 << b), base + (1 << b) + (1 << c), base + (1 << c)},
          {4 * b + 2 * side, 4 * c + side + 2, 4 * b + 1 + 2 * side, 4 * c + side}};
}

bool isInside(std::uint8_t inside, int corner) { return ((inside >> corner) & 1) != 0; }

class LoopFinder {
 public:
  explicit LoopFinder(std::uint8_t inside) : inside_(inside) {
    for (int edge = 0; edge < kCellEdges; ++edge) parent_[static_cast<std::size_t>(edge)] = edge;
  }

  void addFace(int number, bool flipped) {
    const Face face = describeFace(number);
    if (isAmbiguous(inside_, number)) {
      // Edges 3 and 0 meet at corner 0; the pairing cuts corners 0 and 2 off, or 1 and 3.
      const bool cut_first = isInside(inside_, face.corners[0]) != flipped;
      join(face.edges[0], face.edges[cut_first ? 3 : 1]);
      join(face.edges[2], face.edges[cut_first ? 1 : 3]);
      return;
    }
    int first = -1;
    for (const int edge : face.edges) {
      if (!isCrossed(edge)) continue;
      if (first >= 0) join(first, edge);
      first = edge;
    }
  }

  CellLoops number() {
    CellLoops loops;
    loops.of_edge.fill(CellLoops::kNoLoop);
    for (int edge = 0; edge < kCellEdges; ++edge) {
      if (!isCrossed(edge)) continue;
      std::uint8_t& of_root = loops.of_edge[static_cast<std::size_t>(root(edge))];
      if (of_root == CellLoops::kNoLoop) of_root = loops.count++;
      loops.of_edge[static_cast<std::size_t>(edge)] = of_root;
    }
    return loops;
  }

 private:
  bool isCrossed(int edge) const {
    const auto [a, b] = edgeCorners(edge);
    return isInside(inside_, a) != isInside(inside_, b);
  }
  int root(int edge) const {
    while (parent_[static_cast<std::size_t>(edge)] != edge) {
      edge = parent_[static_cast<std::size_t>(edge)];
    }
    return edge;
  }
  void join(int a, int b) {
    const int root_a = root(a), root_b = root(b);
    parent_[static_cast<std::size_t>(std::max(root_a, root_b))] = std::min(root_a, root_b);
  }

  std::uint8_t inside_;
  std::array<int, kCellEdges> parent_{};
};

}  // namespace

std::pair<int, int> edgeCorners(int edge) {
  const int axis = edge / 4;
  const int from = ((edge & 1) << ((axis + 1) % 3)) + ((edge >> 1 & 1) << ((axis + 2) % 3));
  return {from, from + (1 << axis)};
}

CellLoops findLoops(std::uint8_t inside, unsigned flipped_faces) {
  LoopFinder finder(inside);
  for (int face = 0; face < 6; ++face) {
    finder.addFace(face, (flipped_faces >> static_cast<unsigned>(face) & 1U) != 0);
  }
  CellLoops loops = finder.number();
  loops.flipped_faces = flipped_faces;
  return loops;
}

bool isAmbiguous(std::uint8_t inside, int face) {
  const std::array<int, 4> c = describeFace(face).corners;
  return isInside(inside, c[0]) == isInside(inside, c[2]) &&
         isInside(inside, c[1]) == isInside(inside, c[3]) &&
         isInside(inside, c[0]) != isInside(inside, c[1]);
}

bool isOneLoop(const CellLoops& loops, int face) {
  std::uint8_t first = CellLoops::kNoLoop;
  for (const int edge : describeFace(face).edges) {
    const std::uint8_t loop = loops.of_edge[static_cast<std::size_t>(edge)];
    if (loop == CellLoops::kNoLoop) continue;
    if (first != CellLoops::kNoLoop && loop != first) return false;
    first = loop;
  }
  return true;
}

}  // namespace scanner::simulation
