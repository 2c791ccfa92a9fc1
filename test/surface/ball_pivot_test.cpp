#include "scanner/surface/ball_pivot.h"

#include <gtest/gtest.h>

#include <limits>

#include "fixtures.h"

namespace scanner::surface {
namespace {

using test::kPi;

TEST(BallPivot, SphereIsClosedOutwardAndRound) {
  const PointCloud cloud = test::spherePoints(5000, 0.1);
  BallPivotStatistics stats;
  const Result<Mesh> mesh = ballPivot(cloud, {}, 1, &stats);
  ASSERT_TRUE(mesh.isOk()) << mesh.status().message();
  const MeshStatistics m = meshStatistics(*mesh);
  EXPECT_EQ(m.components, 1U);
  EXPECT_EQ(m.boundary_edges, 0U);
  EXPECT_EQ(m.non_manifold_edges, 0U);
  EXPECT_EQ(test::eulerCharacteristic(*mesh), 2);
  EXPECT_EQ(mesh->faces.size(), 2 * cloud.size() - 4);  // every point is used
  EXPECT_NEAR(test::volume(*mesh), 4.0 / 3.0 * kPi * 1e-3, 0.005 * 4.2e-3);
  EXPECT_NEAR(test::area(*mesh), 4.0 * kPi * 1e-2, 0.005 * 0.1257);
  EXPECT_EQ(mesh->vertices.points, cloud.points);
  EXPECT_EQ(mesh->vertices.colors, cloud.colors);
  EXPECT_NEAR(stats.spacing_m, 1.1 * std::sqrt(4.0 * kPi * 0.01 / 5000.0), 0.3e-3);
}

TEST(BallPivot, TorusHasGenusOne) {
  const Result<Mesh> mesh = ballPivot(test::torusPoints(0.1, 0.04, 2e-3), {});
  ASSERT_TRUE(mesh.isOk());
  EXPECT_EQ(test::eulerCharacteristic(*mesh), 0);
  const MeshStatistics m = meshStatistics(*mesh);
  EXPECT_EQ(m.components, 1U);
  EXPECT_EQ(m.boundary_edges, 0U);
  EXPECT_EQ(m.non_manifold_edges, 0U);
  EXPECT_NEAR(test::volume(*mesh), 2.0 * kPi * kPi * 0.1 * 0.0016, 0.01 * 3.16e-3);
}

TEST(BallPivot, IsDeterministicAndIgnoresThreads) {
  const PointCloud cloud = test::spherePoints(20000, 0.1);
  const Result<Mesh> a = ballPivot(cloud, {}, 1);
  const Result<Mesh> b = ballPivot(cloud, {}, 2);
  ASSERT_TRUE(a.isOk() && b.isOk());
  EXPECT_TRUE(test::sameBytes(*a, *b));
}

TEST(BallPivot, RegularGridIsFullyCovered) {
  // Four points on every circle: the worst case for ties.
  const Result<Mesh> mesh = ballPivot(test::planePoints(30, 20, 0.5, 0.0), {});
  ASSERT_TRUE(mesh.isOk());
  EXPECT_EQ(mesh->faces.size(), 2U * 29U * 19U);
  EXPECT_NEAR(test::area(*mesh), 14.5 * 9.5, 1e-6);
  EXPECT_EQ(meshStatistics(*mesh).non_manifold_edges, 0U);
  EXPECT_EQ(meshStatistics(*mesh).boundary_edges, 2U * (29U + 19U));
}

TEST(BallPivot, NearSheetsAreNotBridged) {
  // Facing the same way, three spacings apart.
  PointCloud cloud = test::planePoints(30, 30, 1e-3, 0.0);
  cloud.append(test::planePoints(30, 30, 1e-3, 3e-3));
  BallPivotOptions options;
  options.radius_count = 1;
  const Result<Mesh> same = ballPivot(cloud, options);
  ASSERT_TRUE(same.isOk());
  EXPECT_EQ(meshStatistics(*same).components, 2U);
  // Facing away from each other, a third of a spacing apart: a thin sheet.
  cloud = test::planePoints(30, 30, 1e-3, 0.0, -1.0);
  cloud.append(test::planePoints(30, 30, 1e-3, 0.3e-3, 1.0));
  const Result<Mesh> sheet = ballPivot(cloud, options);
  ASSERT_TRUE(sheet.isOk());
  for (const auto& f : sheet->faces) {
    ASSERT_EQ(f[0] < 900, f[1] < 900);
    ASSERT_EQ(f[0] < 900, f[2] < 900);
  }
  EXPECT_EQ(sheet->faces.size(), 2U * 2U * 29U * 29U);
}

TEST(BallPivot, LargerBallsBridgeSparsePlaces) {
  PointCloud cloud = test::planePoints(30, 30, 1e-3, 0.0);
  PointCloud sparse = test::planePoints(10, 15, 2e-3, 0.0);
  for (auto& p : sparse.points) p.x() += 0.031F;
  cloud.append(sparse);
  BallPivotOptions options;
  options.radius_count = 1;
  const auto one = ballPivot(cloud, options);
  options.radius_count = 3;
  BallPivotStatistics stats;
  const auto three = ballPivot(cloud, options, 1, &stats);
  ASSERT_TRUE(one.isOk() && three.isOk());
  EXPECT_EQ(meshStatistics(*three).components, 1U);
  EXPECT_GT(three->faces.size(), one->faces.size() + 200);
  EXPECT_EQ(stats.radii_m.size(), 3U);
  EXPECT_EQ(meshStatistics(*three).non_manifold_edges, 0U);
}

TEST(BallPivot, NoisyCloudStaysManifoldAndDuplicatesDoNotCrack) {
  PointCloud cloud = test::spherePoints(8000, 0.1);
  std::mt19937 rng(7);
  std::normal_distribution<float> gauss(0.0F, 0.6e-3F);
  for (auto& p : cloud.points) p += Eigen::Vector3f(gauss(rng), gauss(rng), gauss(rng));
  const PointCloud once = cloud;
  cloud.append(once);
  const Result<Mesh> mesh = ballPivot(cloud, {});
  ASSERT_TRUE(mesh.isOk());
  const MeshStatistics m = meshStatistics(*mesh);
  EXPECT_EQ(m.non_manifold_edges, 0U);
  EXPECT_LT(m.boundary_edges, m.faces / 50);
  for (const auto& f : mesh->faces) {
    for (const std::uint32_t v : f) ASSERT_LT(v, 8000U);
  }
}

TEST(BallPivot, ExplicitRadii) {
  const PointCloud cloud = test::planePoints(10, 10, 1e-3, 0.0);
  EXPECT_TRUE(ballPivotWithRadii(cloud, {1e-3, 2e-3}, {}).isOk());
  EXPECT_EQ(ballPivotWithRadii(cloud, {0.4e-3}, {}).status().code(), StatusCode::kNotEnoughData);
  EXPECT_THROW(ballPivotWithRadii(cloud, {}, {}), ConfigurationError);
  EXPECT_THROW(ballPivotWithRadii(cloud, {2e-3, 1e-3}, {}), ConfigurationError);
}

TEST(BallPivot, SaysWhatIsWrongWithTheData) {
  const auto code = [](const PointCloud& cloud) { return ballPivot(cloud, {}).status().code(); };
  EXPECT_EQ(code({}), StatusCode::kNotEnoughData);
  EXPECT_EQ(code(test::planePoints(2, 1, 1.0, 0.0)), StatusCode::kNotEnoughData);
  EXPECT_EQ(code(test::planePoints(5, 5, 0.0, 0.0)), StatusCode::kInvalidInput);
  EXPECT_EQ(code(test::planePoints(20, 1, 1.0, 0.0)), StatusCode::kNotEnoughData);  // a line
  PointCloud cloud = test::planePoints(5, 5, 1.0, 0.0);
  cloud.points[7].y() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(code(cloud), StatusCode::kInvalidInput);
  EXPECT_NE(ballPivot(cloud, {}).status().message().find("point 7"), std::string::npos);
  cloud.normals.clear();
  EXPECT_EQ(code(cloud), StatusCode::kInvalidInput);
}

}  // namespace
}  // namespace scanner::surface
