#include "scanner/surface/smooth.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <vector>

#include "surface/mesh_edges.h"

namespace scanner::surface {
namespace {

using Positions = std::vector<Eigen::Vector3d>;

/// Mean of `values` over the neighbours of v; v's own without neighbours.
Eigen::Vector3d neighborMean(const Positions& values, const VertexGraph& graph, std::size_t v) {
  const std::uint32_t begin = graph.begin[v];
  const std::uint32_t end = graph.begin[v + 1];
  if (begin == end) return values[v];
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::uint32_t i = begin; i < end; ++i) sum += values[graph.neighbors[i]];
  return sum / static_cast<double>(end - begin);
}

void laplacian(Positions& p, const VertexGraph& graph, const SmoothingOptions& o) {
  for (int round = 0; round < o.iterations; ++round) {
    const Positions old = p;
    for (std::size_t v = 0; v < p.size(); ++v) {
      if (!graph.boundary[v]) p[v] += o.lambda * (neighborMean(old, graph, v) - old[v]);
    }
  }
}

/// Vollmer et al. 1999, section 4: smooth, then push back by the mean of what the vertex and its
/// neighbours moved.
void hcLaplacian(Positions& p, const VertexGraph& graph, const SmoothingOptions& o) {
  const Positions original = p;
  Positions moved(p.size(), Eigen::Vector3d::Zero());
  for (int round = 0; round < o.iterations; ++round) {
    const Positions old = p;
    for (std::size_t v = 0; v < p.size(); ++v) {
      if (graph.boundary[v]) continue;
      p[v] = neighborMean(old, graph, v);
      moved[v] = p[v] - (o.hc_alpha * original[v] + (1.0 - o.hc_alpha) * old[v]);
    }
    for (std::size_t v = 0; v < p.size(); ++v) {
      if (graph.boundary[v]) continue;
      p[v] -= o.hc_beta * moved[v] + (1.0 - o.hc_beta) * neighborMean(moved, graph, v);
    }
  }
}

struct FaceGeometry {
  std::vector<Eigen::Vector3d> normals;  ///< unit; zero for a face without area
  std::vector<Eigen::Vector3d> centers;
  std::vector<double> areas;
};

FaceGeometry faceGeometry(const Mesh& mesh, const Positions& p) {
  FaceGeometry g;
  for (const Face& f : mesh.faces) {
    const Eigen::Vector3d n = 0.5 * (p[f[1]] - p[f[0]]).cross(p[f[2]] - p[f[0]]);
    g.areas.push_back(n.norm());
    g.normals.push_back(n.norm() > 0.0 ? Eigen::Vector3d(n.normalized()) : Eigen::Vector3d::Zero());
    g.centers.push_back((p[f[0]] + p[f[1]] + p[f[2]]) / 3.0);
  }
  return g;
}

/// Pairs of faces that share an edge.
std::vector<std::pair<std::uint32_t, std::uint32_t>> adjacentFaces(const Mesh& mesh) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
  const auto uses = sortedEdgeUses(mesh.faces);
  forEachEdge(uses, [&](std::size_t begin, std::size_t end) {
    if (end - begin == 2) pairs.emplace_back(uses[begin].face, uses[begin + 1].face);
  });
  return pairs;
}

void twoStep(Mesh& mesh, Positions& p, const VertexGraph& graph, const SmoothingOptions& o) {
  const auto pairs = adjacentFaces(mesh);
  const double cos_feature = std::cos(o.feature_angle_deg * 3.14159265358979323846 / 180.0);
  for (int round = 0; round < o.iterations; ++round) {
    const FaceGeometry start = faceGeometry(mesh, p);
    std::vector<Eigen::Vector3d> normals = start.normals;
    for (int i = 0; i < o.normal_iterations; ++i) {
      std::vector<Eigen::Vector3d> sums(normals.size());
      for (std::size_t f = 0; f < sums.size(); ++f) sums[f] = start.areas[f] * normals[f];
      for (const auto& [a, b] : pairs) {
        // The weight falls to zero at the feature angle.
        const double w =
            std::max(0.0, normals[a].dot(normals[b]) - cos_feature) / (1.0 - cos_feature);
        sums[a] += w * w * start.areas[b] * normals[b];
        sums[b] += w * w * start.areas[a] * normals[a];
      }
      for (std::size_t f = 0; f < sums.size(); ++f) {
        if (sums[f].norm() > 0.0) normals[f] = sums[f].normalized();
      }
    }
    for (int i = 0; i < o.fit_iterations; ++i) {
      const FaceGeometry now = faceGeometry(mesh, p);
      Positions shift(p.size(), Eigen::Vector3d::Zero());
      std::vector<double> weight(p.size(), 0.0);
      for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        for (const std::uint32_t v : mesh.faces[f]) {
          shift[v] += now.areas[f] * normals[f] * normals[f].dot(now.centers[f] - p[v]);
          weight[v] += now.areas[f];
        }
      }
      for (std::size_t v = 0; v < p.size(); ++v) {
        if (!graph.boundary[v] && weight[v] > 0.0) p[v] += shift[v] / weight[v];
      }
    }
  }
}

}  // namespace

void recomputeNormals(Mesh& mesh) {
  std::vector<Eigen::Vector3d> sums(mesh.vertices.size(), Eigen::Vector3d::Zero());
  for (const Face& f : mesh.faces) {
    const Eigen::Vector3d n = areaVector(mesh, f);
    for (const std::uint32_t v : f) sums[v] += n;
  }
  const float nan = std::numeric_limits<float>::quiet_NaN();
  if (!mesh.vertices.hasNormals()) {
    mesh.vertices.normals.assign(mesh.vertices.size(), Eigen::Vector3f::Constant(nan));
  }
  for (std::size_t v = 0; v < sums.size(); ++v) {
    if (sums[v].norm() > 0.0) mesh.vertices.normals[v] = sums[v].normalized().cast<float>();
  }
}

Mesh smooth(Mesh mesh, const SmoothingOptions& options) {
  if (options.method == SmoothingMethod::kNone || options.iterations < 1 || mesh.faces.empty()) {
    return mesh;
  }
  const VertexGraph graph = vertexGraph(mesh);
  Positions p;
  for (const auto& point : mesh.vertices.points) p.push_back(point.cast<double>());
  switch (options.method) {
    case SmoothingMethod::kLaplacian:
      laplacian(p, graph, options);
      break;
    case SmoothingMethod::kHcLaplacian:
      hcLaplacian(p, graph, options);
      break;
    case SmoothingMethod::kTwoStep:
      twoStep(mesh, p, graph, options);
      break;
    case SmoothingMethod::kNone:
      break;
  }
  for (std::size_t v = 0; v < p.size(); ++v) mesh.vertices.points[v] = p[v].cast<float>();
  recomputeNormals(mesh);
  return mesh;
}

}  // namespace scanner::surface
