#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "scanner/core/mesh.h"

namespace scanner::surface {

using Face = std::array<std::uint32_t, 3>;

/// One side of one face. Uses of the same edge share (low, high).
struct EdgeUse {
  std::uint32_t low, high;  ///< vertices, low < high
  std::uint32_t face;
  bool forward;  ///< the face runs from low to high

  std::uint32_t from() const { return forward ? low : high; }
  std::uint32_t to() const { return forward ? high : low; }
  bool sameEdge(const EdgeUse& o) const { return low == o.low && high == o.high; }
};

/// All sides of all faces, sorted by edge, then by face. Sides joining a vertex to itself are left
/// out.
std::vector<EdgeUse> sortedEdgeUses(const std::vector<Face>& faces);

/// Calls visit(begin, end) for each edge with the range of its uses.
template <typename Visit>
void forEachEdge(const std::vector<EdgeUse>& uses, Visit&& visit) {
  for (std::size_t begin = 0; begin < uses.size();) {
    std::size_t end = begin + 1;
    while (end < uses.size() && uses[end].sameEdge(uses[begin])) ++end;
    visit(begin, end);
    begin = end;
  }
}

/// Disjoint sets of 0 .. n-1.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t n);
  std::uint32_t find(std::uint32_t i);
  void unite(std::uint32_t a, std::uint32_t b);  ///< the smaller root stays the root

 private:
  std::vector<std::uint32_t> parent_;
};

/// Piece of each face, pieces joined by edges and numbered from 0 in order of their first face.
std::vector<std::uint32_t> facePieces(const std::vector<Face>& faces, std::size_t& count);

/// Vertex neighbours as offsets into one list (ascending), and whether a vertex lies on the
/// boundary.
struct VertexGraph {
  std::vector<std::uint32_t> begin;  ///< neighbours of v: [begin[v], begin[v+1])
  std::vector<std::uint32_t> neighbors;
  std::vector<char> boundary;
};
VertexGraph vertexGraph(const Mesh& mesh);

/// Half the cross product: direction of the face normal, length of the area (m^2).
Eigen::Vector3d areaVector(const Mesh& mesh, const Face& face);

}  // namespace scanner::surface
