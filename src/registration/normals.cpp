#include "scanner/registration/normals.h"

#include <Eigen/Eigenvalues>
#include <limits>

#include "scanner/core/parallel.h"
#include "scanner/core/status.h"
#include "scanner/registration/indexed_cloud.h"

namespace scanner::registration {
namespace {

template <typename Towards>
void estimate(PointCloud& cloud, std::size_t neighbours, int threads, const Towards& towards) {
  if (neighbours < 3) throw ConfigurationError("normals: at least 3 neighbours are needed");
  PointCloud positions;
  positions.points = cloud.points;
  const PointCloud finite = finitePoints(positions, false);
  const IndexedCloud index(finite);
  const Eigen::Vector3f undefined =
      Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
  cloud.normals.assign(cloud.size(), undefined);
  parallelFor(cloud.size(), 1024, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector3f& p = cloud.points[i];
      if (!p.allFinite()) continue;
      const auto near = index.nearest(p, neighbours + 1);
      if (near.size() < 4) continue;
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      for (std::size_t k : near) mean += finite.points[k].cast<double>();
      mean /= static_cast<double>(near.size());
      Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
      for (std::size_t k : near) {
        const Eigen::Vector3d d = finite.points[k].cast<double>() - mean;
        scatter += d * d.transpose();
      }
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
      // On a line the middle eigenvalue vanishes too, and any direction would do.
      if (!(solver.eigenvalues()(1) > 1e-6 * solver.eigenvalues()(2))) continue;
      Eigen::Vector3d n = solver.eigenvectors().col(0);
      if (n.dot(towards(p.cast<double>())) < 0.0) n = -n;
      cloud.normals[i] = n.normalized().cast<float>();
    }
  });
}

}  // namespace

void estimateNormalsKnn(PointCloud& cloud, std::size_t neighbours, const Eigen::Vector3d& viewpoint,
                        int threads) {
  estimate(cloud, neighbours, threads,
           [&](const Eigen::Vector3d& p) -> Eigen::Vector3d { return viewpoint - p; });
}

void estimateNormalsTowards(PointCloud& cloud, std::size_t neighbours,
                            const Eigen::Vector3d& direction, int threads) {
  estimate(cloud, neighbours, threads,
           [&](const Eigen::Vector3d&) -> Eigen::Vector3d { return direction; });
}

}  // namespace scanner::registration
