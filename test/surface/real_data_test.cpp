#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>

#include "fixtures.h"
#include "scanner/core/ply.h"
#include "scanner/core/se3.h"
#include "scanner/surface/surface.h"
#include "surface/knn.h"

namespace scanner::surface {
namespace {

std::string dataFolder() {
  const char* folder = std::getenv("SCANNER_DATA");
  return folder != nullptr ? folder : SCANNER_SOURCE_DIR "/../shared/data";
}

/// Normals from the 16 nearest neighbours, towards the scanner: Stanford scans look along -z.
void addNormals(PointCloud& cloud) {
  const KdTree tree(cloud.points);
  std::vector<std::size_t> indices;
  std::vector<float> d2;
  cloud.normals.clear();
  for (const auto& p : cloud.points) {
    tree.nearest(p, 16, indices, d2);
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const std::size_t i : indices) mean += cloud.points[i].cast<double>();
    mean /= static_cast<double>(indices.size());
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const std::size_t i : indices) {
      const Eigen::Vector3d d = cloud.points[i].cast<double>() - mean;
      scatter += d * d.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
    const Eigen::Vector3d n = solver.eigenvectors().col(0);
    cloud.normals.push_back((n.z() < 0.0 ? Eigen::Vector3d(-n) : n).cast<float>());
  }
}

std::vector<double> distances(const PointCloud& from, const PointCloud& to) {
  const KdTree tree(to.points);
  std::vector<std::size_t> indices;
  std::vector<float> d2;
  std::vector<double> out;
  for (const auto& p : from.points) {
    tree.nearest(p, 1, indices, d2);
    out.push_back(std::sqrt(double{d2[0]}));
  }
  std::sort(out.begin(), out.end());
  return out;
}

TEST(RealDataBunny, TenScansBecomeOneCleanMesh) {
  const std::string folder = dataFolder() + "/stanford/bunny/";
  if (!std::filesystem::exists(folder + "bun.conf")) {
    GTEST_SKIP() << "no recordings at " << folder << " (set SCANNER_DATA)";
  }
  std::ifstream conf(folder + "bun.conf");
  std::vector<PointCloud> clouds;
  std::vector<Eigen::Isometry3d> poses;
  std::string line;
  while (std::getline(conf, line)) {
    std::istringstream words(line);
    std::string key, file;
    double x, y, z, qx, qy, qz, qw;
    if (!(words >> key >> file >> x >> y >> z >> qx >> qy >> qz >> qw) || key != "bmesh") continue;
    Result<Mesh> scan = readPly(folder + file);
    ASSERT_TRUE(scan.isOk()) << scan.status().message();
    clouds.push_back(scan->vertices);
    addNormals(clouds.back());
    poses.push_back(
        makePose({x, y, z}, Eigen::Quaterniond(qw, qx, qy, qz).normalized().conjugate()));
  }
  ASSERT_EQ(clouds.size(), 10U);
  std::vector<PosedCloud> views;
  for (std::size_t i = 0; i < clouds.size(); ++i) views.push_back({&clouds[i], poses[i]});
  SurfaceStatistics stats;
  const Result<Mesh> mesh = buildSurface(views, {}, 2, &stats);
  ASSERT_TRUE(mesh.isOk()) << mesh.status().message();
  const Result<Mesh> reference = readPly(folder + "reference_bun_zipper.ply");
  ASSERT_TRUE(reference.isOk());
  // Point to point: vertices are about a millimetre apart, so half of that is the floor.
  const auto accuracy = distances(mesh->vertices, reference->vertices);
  const auto coverage = distances(reference->vertices, mesh->vertices);
  const auto at = [](const std::vector<double>& d, double share) {
    return d[static_cast<std::size_t>(share * static_cast<double>(d.size() - 1))] * 1e3;
  };
  std::cout << "vertices " << stats.model.vertices << " faces " << stats.model.faces
            << " components " << stats.model.components << " boundary "
            << stats.model.boundary_edges << "; to reference (mm): median " << at(accuracy, 0.5)
            << " 95% " << at(accuracy, 0.95) << " max " << at(accuracy, 1.0)
            << "; from reference: median " << at(coverage, 0.5) << " 95% " << at(coverage, 0.95)
            << " max " << at(coverage, 1.0) << "; fuse " << stats.fusion_s << " s, pivot "
            << stats.ball_pivot_s << " s\n";
  EXPECT_EQ(stats.model.components, 1U);
  EXPECT_EQ(stats.model.non_manifold_edges, 0U);
  EXPECT_LT(stats.model.boundary_edges, 100U);
  EXPECT_LT(at(accuracy, 0.5), 0.7);
  EXPECT_LT(at(accuracy, 0.9), 1.2);
  EXPECT_LT(at(coverage, 0.5), 0.9);
  EXPECT_LT(at(coverage, 0.99), 2.0);
}

}  // namespace
}  // namespace scanner::surface
