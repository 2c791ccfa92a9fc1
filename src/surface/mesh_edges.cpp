#include "surface/mesh_edges.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>
#include <tuple>

namespace scanner::surface {

std::vector<EdgeUse> sortedEdgeUses(const std::vector<Face>& faces) {
  std::vector<EdgeUse> uses;
  uses.reserve(3 * faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = faces[f][k];
      const std::uint32_t b = faces[f][(k + 1) % 3];
      if (a == b) continue;
      uses.push_back({std::min(a, b), std::max(a, b), static_cast<std::uint32_t>(f), a < b});
    }
  }
  std::sort(uses.begin(), uses.end(), [](const EdgeUse& x, const EdgeUse& y) {
    return std::tie(x.low, x.high, x.face, x.forward) < std::tie(y.low, y.high, y.face, y.forward);
  });
  return uses;
}

DisjointSets::DisjointSets(std::size_t n) : parent_(n) {
  std::iota(parent_.begin(), parent_.end(), 0U);
}

std::uint32_t DisjointSets::find(std::uint32_t i) {
  while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
  return i;
}

void DisjointSets::unite(std::uint32_t a, std::uint32_t b) {
  a = find(a);
  b = find(b);
  parent_[std::max(a, b)] = std::min(a, b);
}

std::vector<std::uint32_t> facePieces(const std::vector<Face>& faces, std::size_t& count) {
  DisjointSets sets(faces.size());
  const auto uses = sortedEdgeUses(faces);
  forEachEdge(uses, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin + 1; i < end; ++i) sets.unite(uses[begin].face, uses[i].face);
  });
  std::vector<std::uint32_t> piece(faces.size());
  count = 0;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const std::uint32_t root = sets.find(static_cast<std::uint32_t>(f));
    piece[f] = root == f ? static_cast<std::uint32_t>(count++) : piece[root];
  }
  return piece;
}

VertexGraph vertexGraph(const Mesh& mesh) {
  const std::size_t n = mesh.vertices.size();
  VertexGraph graph;
  graph.begin.assign(n + 1, 0);
  graph.boundary.assign(n, 0);
  const auto uses = sortedEdgeUses(mesh.faces);
  forEachEdge(uses, [&](std::size_t begin, std::size_t end) {
    ++graph.begin[uses[begin].low + 1];
    ++graph.begin[uses[begin].high + 1];
    if (end - begin == 1) graph.boundary[uses[begin].low] = graph.boundary[uses[begin].high] = 1;
  });
  std::partial_sum(graph.begin.begin(), graph.begin.end(), graph.begin.begin());
  graph.neighbors.resize(graph.begin.back());
  std::vector<std::uint32_t> next(graph.begin.begin(), graph.begin.end() - 1);
  forEachEdge(uses, [&](std::size_t begin, std::size_t) {
    graph.neighbors[next[uses[begin].low]++] = uses[begin].high;
    graph.neighbors[next[uses[begin].high]++] = uses[begin].low;
  });
  return graph;
}

Eigen::Vector3d areaVector(const Mesh& mesh, const Face& face) {
  const Eigen::Vector3d a = mesh.vertices.points[face[0]].cast<double>();
  const Eigen::Vector3d b = mesh.vertices.points[face[1]].cast<double>();
  const Eigen::Vector3d c = mesh.vertices.points[face[2]].cast<double>();
  return 0.5 * (b - a).cross(c - a);
}

}  // namespace scanner::surface
