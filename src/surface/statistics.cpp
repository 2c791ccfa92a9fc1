#include "scanner/surface/statistics.h"

#include <algorithm>
#include <vector>

#include "surface/mesh_edges.h"

namespace scanner::surface {

MeshStatistics meshStatistics(const Mesh& mesh) {
  std::vector<Face> faces;
  faces.reserve(mesh.faces.size());
  for (const Face& f : mesh.faces) {
    const bool valid =
        std::all_of(f.begin(), f.end(), [&](std::uint32_t v) { return v < mesh.vertices.size(); });
    if (valid) faces.push_back(f);
  }
  MeshStatistics s;
  s.vertices = mesh.vertices.size();
  s.faces = faces.size();
  facePieces(faces, s.components);
  std::size_t edges = 0;
  double length = 0.0;
  const auto uses = sortedEdgeUses(faces);
  forEachEdge(uses, [&](std::size_t begin, std::size_t end) {
    ++edges;
    s.boundary_edges += end - begin == 1 ? 1 : 0;
    s.non_manifold_edges += end - begin > 2 ? 1 : 0;
    const auto& points = mesh.vertices.points;
    length += (points[uses[begin].low] - points[uses[begin].high]).cast<double>().norm();
  });
  if (edges > 0) s.mean_spacing_m = length / static_cast<double>(edges);
  return s;
}

}  // namespace scanner::surface
