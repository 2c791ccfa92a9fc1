#include "evaluation/surface_samples.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace scanner::evaluation {
namespace {

// The plastic number's powers give the plane's most even additive sequence (Roberts' R2).
constexpr double kStepU = 0.7548776662466927;
constexpr double kStepV = 0.5698402909980532;

double fraction(double x) { return x - std::floor(x); }

SurfaceSamples samplePoints(const PointCloud& cloud, std::size_t count) {
  std::vector<std::size_t> usable;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (cloud.points[i].allFinite()) usable.push_back(i);
  }
  SurfaceSamples samples;
  const std::size_t n = std::min(count, usable.size());
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t i = usable[k * usable.size() / n];
    samples.points.emplace_back(cloud.points[i].cast<double>());
    if (cloud.hasNormals()) samples.normals.emplace_back(cloud.normals[i].cast<double>());
  }
  return samples;
}

}  // namespace

Status checkModel(const Mesh& model) {
  if (model.vertices.empty()) return {StatusCode::kNotEnoughData, "the model has no points"};
  for (const auto& face : model.faces) {
    if (std::any_of(face.begin(), face.end(),
                    [&](std::uint32_t i) { return i >= model.vertices.size(); })) {
      return {StatusCode::kInvalidInput, "the model has a face that names a vertex it lacks"};
    }
  }
  return Status::ok();
}

SurfaceSamples sampleSurface(const Mesh& mesh, std::size_t count, int seed) {
  const auto& points = mesh.vertices.points;
  std::vector<double> area_until(mesh.faces.size());
  double area = 0.0;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto& [a, b, c] = mesh.faces[f];
    const double own =
        0.5 *
        (points[b] - points[a]).cast<double>().cross((points[c] - points[a]).cast<double>()).norm();
    if (std::isfinite(own)) area += own;
    area_until[f] = area;
  }
  if (!(area > 0.0)) return samplePoints(mesh.vertices, count);
  SurfaceSamples samples;
  samples.points.reserve(count);
  samples.normals.reserve(count);
  std::size_t f = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double target = area * (static_cast<double>(k) + 0.5) / static_cast<double>(count);
    while (area_until[f] < target) ++f;
    const double n = static_cast<double>(k) + 1000.0 * seed;
    double u = fraction(n * kStepU), v = fraction(n * kStepV);
    if (u + v > 1.0) {
      u = 1.0 - u;
      v = 1.0 - v;
    }
    const Eigen::Vector3d a = points[mesh.faces[f][0]].cast<double>();
    const Eigen::Vector3d ab = points[mesh.faces[f][1]].cast<double>() - a;
    const Eigen::Vector3d ac = points[mesh.faces[f][2]].cast<double>() - a;
    samples.points.emplace_back(a + u * ab + v * ac);
    samples.normals.emplace_back(ab.cross(ac).normalized());
  }
  return samples;
}

}  // namespace scanner::evaluation
