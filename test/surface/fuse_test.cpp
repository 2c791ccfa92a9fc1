#include "scanner/surface/fuse.h"

#include <gtest/gtest.h>

#include <limits>

#include "fixtures.h"
#include "scanner/core/status.h"
#include "scanner/surface/surface.h"

namespace scanner::surface {
namespace {

using test::kPi;

/// Views of a sphere from points round it: each sees the half that faces it, in its own frame, with
/// Gaussian noise along the normal.
struct SphereScan {
  std::vector<PointCloud> clouds;
  std::vector<PosedCloud> views;

  SphereScan(int count, std::size_t points, double radius, double noise, unsigned seed) {
    std::mt19937 rng(seed);
    std::normal_distribution<double> gauss(0.0, 1.0);
    clouds.resize(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) {
      const Eigen::Isometry3d T_map_view(Eigen::AngleAxisd(
          0.1 + 2.0 * kPi * i / count, Eigen::Vector3d(0.2, 0.5, 1.0).normalized()));
      const double tilt = i % 3 == 0 ? 0.0 : (i % 3 == 1 ? 1.2 : -1.2);
      const Eigen::Vector3d towards =
          Eigen::AngleAxisd(2.0 * kPi * i / count, Eigen::Vector3d::UnitZ()) *
          Eigen::Vector3d(std::cos(tilt), 0.0, std::sin(tilt));
      // Another lattice for each view, so that samples do not coincide.
      const Eigen::Matrix3d turn =
          Eigen::AngleAxisd(0.7 * i, Eigen::Vector3d(1.0, 0.3 * i, 0.5).normalized()).matrix();
      const PointCloud all = test::spherePoints(points, radius);
      for (std::size_t k = 0; k < all.size(); ++k) {
        const Eigen::Vector3d n = turn * all.normals[k].cast<double>();
        if (n.dot(towards) < 0.2) continue;
        const Eigen::Vector3d p = (radius + noise * gauss(rng)) * n;
        PointCloud& cloud = clouds[static_cast<std::size_t>(i)];
        cloud.points.push_back((T_map_view.inverse() * p).cast<float>());
        cloud.normals.push_back((T_map_view.linear().transpose() * n).cast<float>());
        cloud.colors.push_back({200, 100, static_cast<std::uint8_t>(10 * (i % 3))});
        cloud.sigmas.push_back(static_cast<float>(noise));
      }
      views.push_back({nullptr, T_map_view});
    }
    for (std::size_t i = 0; i < views.size(); ++i) views[i].cloud = &clouds[i];
  }
};

TEST(Fuse, NoiseOfViewsAveragesOutInOneLayer) {
  constexpr double kRadius = 0.1, kNoise = 0.5e-3;
  const SphereScan scan(12, 40000, kRadius, kNoise, 1);
  FusionStatistics stats;
  const PointCloud fused = fuse(scan.views, {}, 2, &stats);
  ASSERT_GT(fused.size(), 5000U);
  EXPECT_NEAR(test::radialRms(scan.clouds[0], kRadius), kNoise, 0.1 * kNoise);
  // About five views see a point, and each voxel averages several points besides.
  EXPECT_LT(test::radialRms(fused, kRadius), kNoise / std::sqrt(12.0));
  // One layer: no two points over each other, so their number follows from the area.
  const double spacing = 0.8 * stats.voxel_m;
  const double most = 4.0 * kPi * kRadius * kRadius / (0.69 * spacing * spacing);
  EXPECT_LT(static_cast<double>(fused.size()), most);
  for (std::size_t i = 0; i < fused.size(); ++i) {
    ASSERT_NEAR(fused.normals[i].norm(), 1.0F, 1e-4F);
    ASSERT_GT(fused.normals[i].dot(fused.points[i].normalized()), 0.95F);
    ASSERT_LT(fused.sigmas[i], 0.501e-3F);
    ASSERT_NEAR(fused.colors[i].r, 200, 1);
  }
}

TEST(Fuse, BuildsAClosedSphere) {
  const SphereScan scan(12, 40000, 0.1, 0.5e-3, 2);
  SurfaceStatistics stats;
  const Result<Mesh> mesh = buildSurface(scan.views, {}, 2, &stats);
  ASSERT_TRUE(mesh.isOk()) << mesh.status().message();
  EXPECT_EQ(stats.model.components, 1U);
  EXPECT_EQ(stats.model.boundary_edges, 0U);
  EXPECT_EQ(stats.model.non_manifold_edges, 0U);
  EXPECT_EQ(test::eulerCharacteristic(*mesh), 2);
  EXPECT_NEAR(test::volume(*mesh), 4.0 / 3.0 * kPi * 1e-3, 0.02 * 4.2e-3);
  EXPECT_TRUE(mesh->vertices.hasColors());
}

TEST(Fuse, SameBytesForAnyThreadCount) {
  const SphereScan scan(11, 5000, 0.1, 0.5e-3, 3);
  PointCloud fused_1, fused_2;
  const Result<Mesh> a = buildSurface(scan.views, {}, 1, nullptr, &fused_1);
  const Result<Mesh> b = buildSurface(scan.views, {}, 2, nullptr, &fused_2);
  ASSERT_TRUE(a.isOk() && b.isOk());
  EXPECT_EQ(fused_1.points, fused_2.points);
  EXPECT_TRUE(test::sameBytes(*a, *b));
}

TEST(Fuse, SidesOfAThinSheetStayApart) {
  const PointCloud top = test::planePoints(60, 60, 1e-3, 0.3e-3, 1.0);
  const PointCloud bottom = test::planePoints(60, 60, 1e-3, -0.3e-3, -1.0);
  const auto identity = Eigen::Isometry3d::Identity();
  const PointCloud fused =
      fuse({{&top, identity}, {&bottom, identity}, {&top, identity}, {&bottom, identity}}, {}, 1);
  ASSERT_GT(fused.size(), 1000U);
  for (std::size_t i = 0; i < fused.size(); ++i) {
    ASSERT_NEAR(fused.points[i].z(), fused.normals[i].z() > 0.0F ? 0.3e-3F : -0.3e-3F, 1e-5F);
    ASSERT_GT(std::abs(fused.normals[i].z()), 0.99F);
  }
}

TEST(Fuse, WeighsBySigma) {
  PointCloud good = test::planePoints(50, 50, 1e-3, 0.0);
  PointCloud poor = test::planePoints(50, 50, 1e-3, 1e-3);
  good.sigmas.assign(good.size(), 0.5e-3F);
  poor.sigmas.assign(poor.size(), 1.0e-3F);
  FusionOptions options;
  options.voxel_m = 4e-3;
  const auto T = Eigen::Isometry3d::Identity() * Eigen::Translation3d(0.0, 0.0, 1e-3);
  const PointCloud fused = fuse({{&good, T}, {&poor, T}}, options, 1);
  ASSERT_FALSE(fused.empty());
  for (const auto& p : fused.points) EXPECT_NEAR(p.z(), 1e-3F + 0.2e-3F, 2e-5F);
}

TEST(Fuse, DropsWhatFewViewsSeeWhereManyLook) {
  std::vector<PointCloud> clouds(8, test::planePoints(60, 60, 1e-3, 0.0));
  // One view saw a ridge above the plane that the others do not; only one saw the far plane.
  const std::size_t ordinary = clouds[0].size();
  for (int i = 0; i < 60; ++i) {
    for (int j = 0; j < 3; ++j) {
      clouds[0].points.push_back(
          {static_cast<float>(i) * 1e-3F, 0.03F + static_cast<float>(j) * 1e-3F, 5e-3F});
      clouds[0].normals.push_back({0.0F, 0.0F, 1.0F});
    }
  }
  PointCloud alone = test::planePoints(30, 30, 1e-3, 0.2);
  clouds[0].append(alone);
  std::vector<PosedCloud> views;
  for (const auto& cloud : clouds) views.push_back({&cloud, Eigen::Isometry3d::Identity()});
  FusionStatistics stats;
  const PointCloud fused = fuse(views, {}, 2, &stats);
  std::size_t ridge = 0, far = 0;
  for (const auto& p : fused.points) {
    ridge += p.z() > 2e-3F && p.z() < 0.1F ? 1 : 0;
    far += p.z() > 0.1F ? 1 : 0;
  }
  EXPECT_EQ(ridge, 0U);
  EXPECT_GT(far, 100U);
  EXPECT_GT(stats.unsupported, 0U);
  EXPECT_EQ(ordinary, 3600U);
}

TEST(Fuse, DropsIsolatedPoints) {
  PointCloud cloud = test::planePoints(60, 60, 1e-3, 0.0);
  cloud.points.push_back({0.03F, 0.03F, 0.05F});
  cloud.normals.push_back({0.0F, 0.0F, 1.0F});
  FusionStatistics stats;
  const PointCloud fused = fuse({{&cloud, Eigen::Isometry3d::Identity()}}, {}, 1, &stats);
  EXPECT_GE(stats.isolated, 1U);
  for (const auto& p : fused.points) EXPECT_LT(p.z(), 1e-3F);
}

TEST(Fuse, CurvedPlacesDoNotShrink) {
  const PointCloud sphere = test::spherePoints(20000, 0.02);
  FusionOptions options;
  options.voxel_m = 1e-3;
  const PointCloud quadric = fuse({{&sphere, Eigen::Isometry3d::Identity()}}, options, 1);
  options.projection_degree = 1;
  const PointCloud plane = fuse({{&sphere, Eigen::Isometry3d::Identity()}}, options, 1);
  EXPECT_LT(test::radialRms(quadric, 0.02), 0.02e-3);
  EXPECT_GT(test::radialRms(plane, 0.02), 2.0 * test::radialRms(quadric, 0.02));
}

TEST(Fuse, RejectsBrokenArguments) {
  const PointCloud cloud = test::planePoints(5, 5, 1e-3, 0.0);
  Eigen::Isometry3d bad = Eigen::Isometry3d::Identity();
  bad.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(fuse({{nullptr, Eigen::Isometry3d::Identity()}}, {}, 1), ConfigurationError);
  EXPECT_THROW(fuse({{&cloud, bad}}, {}, 1), ConfigurationError);
  EXPECT_THROW(fuse({{&cloud, Eigen::Isometry3d::Identity()}}, {}, 0), ConfigurationError);
}

TEST(BuildSurface, SaysWhatIsWrongWithTheData) {
  const auto identity = Eigen::Isometry3d::Identity();
  const auto message = [&](const PointCloud& cloud) {
    const Result<Mesh> result = buildSurface({{&cloud, identity}}, {}, 1);
    EXPECT_FALSE(result.isOk());
    EXPECT_NE(result.status().code(), StatusCode::kOk);
    return result.status().message();
  };
  EXPECT_EQ(buildSurface({}, {}, 1).status().code(), StatusCode::kNotEnoughData);
  EXPECT_NE(message({}).find("0 points left of 0"), std::string::npos);
  PointCloud nan = test::planePoints(10, 10, 1e-3, 0.0);
  for (auto& p : nan.points) p.x() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NE(message(nan).find("100 unusable"), std::string::npos);
  PointCloud no_normals = test::planePoints(10, 10, 1e-3, 0.0);
  no_normals.normals.clear();
  EXPECT_NE(message(no_normals).find("100 unusable"), std::string::npos);
  PointCloud one_place = test::planePoints(10, 10, 0.0, 0.0);
  EXPECT_FALSE(message(one_place).empty());
  EXPECT_FALSE(message(test::planePoints(2, 1, 1e-3, 0.0)).empty());
}

TEST(BuildSurface, SkipsNanPointsAmongGoodOnes) {
  PointCloud cloud = test::planePoints(40, 40, 1e-3, 0.0);
  for (std::size_t i = 0; i < cloud.size(); i += 7) {
    cloud.normals[i].y() = std::numeric_limits<float>::quiet_NaN();
  }
  SurfaceStatistics stats;
  const Result<Mesh> mesh = buildSurface({{&cloud, Eigen::Isometry3d::Identity()}}, {}, 1, &stats);
  ASSERT_TRUE(mesh.isOk()) << mesh.status().message();
  EXPECT_EQ(stats.fusion.unusable_points, 229U);
  EXPECT_TRUE(allFinite(mesh->vertices));
}

}  // namespace
}  // namespace scanner::surface
