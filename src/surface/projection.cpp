#include "surface/projection.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "scanner/core/parallel.h"
#include "surface/point_grid.h"

namespace scanner::surface {
namespace {

struct Neighbor {
  std::size_t index;
  double weight;
};

struct Projection {
  double height = 0.0;  // along `up`
  Eigen::Vector3d normal;
  Eigen::Vector3d up;
};

/// Weighted fit of height(u, v) about `center` with Terms coefficients: 1 u v (u^2 uv v^2).
/// Coordinates are scaled by the radius to keep the normal equations well conditioned.
template <int Terms>
bool fitHeight(const FusedPoints& points, const std::vector<Neighbor>& neighbors,
               const Eigen::Vector3d& center, double radius_m, Projection& out) {
  using Row = Eigen::Matrix<double, Terms, 1>;
  const Eigen::Vector3d t1 = out.up.unitOrthogonal();
  const Eigen::Vector3d t2 = out.up.cross(t1);
  Eigen::Matrix<double, Terms, Terms> A = Eigen::Matrix<double, Terms, Terms>::Zero();
  Row b = Row::Zero();
  for (const Neighbor& n : neighbors) {
    const Eigen::Vector3d d = (points.points[n.index].cast<double>() - center) / radius_m;
    const double u = t1.dot(d);
    const double v = t2.dot(d);
    Row row;
    row[0] = 1.0, row[1] = u, row[2] = v;
    if constexpr (Terms == 6) row[3] = u * u, row[4] = u * v, row[5] = v * v;
    A.template selfadjointView<Eigen::Lower>().rankUpdate(row, n.weight);
    b += n.weight * out.up.dot(d) * row;
  }
  // A trace of regularisation on all but the height: thin neighbourhoods tend to flat.
  const double ridge = 1e-4 * A(0, 0);
  for (int i = 1; i < Terms; ++i) A(i, i) += ridge * (i < 3 ? 1.0 : 10.0);
  const Eigen::LDLT<Eigen::Matrix<double, Terms, Terms>> ldlt(A);
  if (ldlt.info() != Eigen::Success || !ldlt.isPositive()) return false;
  const Row x = ldlt.solve(b);
  if (!x.allFinite()) return false;
  out.height = x[0] * radius_m;
  out.normal = (out.up - x[1] * t1 - x[2] * t2).normalized();
  return true;
}

/// Share of the mean of the neighbours that lies aside: large at the rim of a surface, where a
/// quadric would extrapolate.
double eccentricity(const FusedPoints& points, const std::vector<Neighbor>& neighbors,
                    const Eigen::Vector3d& center, const Eigen::Vector3d& up, double radius_m) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double total = 0.0;
  for (const Neighbor& n : neighbors) {
    mean += n.weight * (points.points[n.index].cast<double>() - center);
    total += n.weight;
  }
  mean /= total;
  return (mean - up * up.dot(mean)).norm() / radius_m;
}

}  // namespace

void projectOntoLocalSurface(FusedPoints& points, double radius_m, int degree,
                             double cos_normal_angle, int threads) {
  const PointGrid grid(points.points, radius_m);
  std::vector<Eigen::Vector3f> new_points = points.points;
  std::vector<Eigen::Vector3f> new_normals = points.normals;
  const auto cos_angle = static_cast<float>(cos_normal_angle);
  parallelFor(points.size(), 2048, threads, [&](std::size_t begin, std::size_t end) {
    std::vector<Neighbor> neighbors;
    for (std::size_t k = begin; k < end; ++k) {
      const std::size_t i = grid.order()[k];
      neighbors.clear();
      Projection fit;
      Eigen::Vector3d up = Eigen::Vector3d::Zero();
      grid.forEachWithin(points.points[i], radius_m, [&](std::size_t j, float d2) {
        if (points.normals[j].dot(points.normals[i]) < cos_angle) return;
        // Close to a Gaussian of 0.4 radii, but zero at the radius and the same on every machine.
        const double inside = 1.0 - double{d2} / (radius_m * radius_m);
        const double w = double{points.weights[j]} * inside * inside * inside;
        neighbors.push_back({j, w});
        up += w * points.normals[j].cast<double>();
      });
      if (neighbors.size() < 4) continue;
      fit.up = up.normalized();
      const Eigen::Vector3d center = points.points[i].cast<double>();
      const bool quadric = degree >= 2 && neighbors.size() >= 10 &&
                           eccentricity(points, neighbors, center, fit.up, radius_m) < 0.2;
      const bool ok = quadric ? fitHeight<6>(points, neighbors, center, radius_m, fit)
                              : fitHeight<3>(points, neighbors, center, radius_m, fit);
      if (!ok || std::abs(fit.height) > radius_m) continue;
      new_points[i] = (center + fit.height * fit.up).cast<float>();
      new_normals[i] = fit.normal.cast<float>();
    }
  });
  points.points = std::move(new_points);
  points.normals = std::move(new_normals);
}

}  // namespace scanner::surface
