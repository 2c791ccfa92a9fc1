#include "scanner/core/cloud.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scanner/core/se3.h"

namespace scanner {
namespace {

const float kNan = std::nanf("");

PointCloud smallCloud() {
  PointCloud cloud;
  cloud.points = {{0, 0, 1}, {1, 0, 1}, {kNan, 0, 1}, {0, 2, 1}};
  cloud.normals = {{0, 0, -1}, {kNan, 0, 0}, {0, 0, -1}, {0, 1, 0}};
  cloud.colors = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {10, 11, 12}};
  cloud.sigmas = {0.1F, 0.2F, 0.3F, 0.4F};
  return cloud;
}

TEST(FinitePoints, DropsNanPositionsAndOnRequestNanNormals) {
  const PointCloud cloud = smallCloud();
  EXPECT_EQ(finitePoints(cloud, false).size(), 3U);
  const PointCloud strict = finitePoints(cloud, true);
  ASSERT_EQ(strict.size(), 2U);
  EXPECT_EQ(strict.colors[1], (Rgb8{10, 11, 12}));
  EXPECT_FLOAT_EQ(strict.sigmas[1], 0.4F);
  EXPECT_TRUE(allFinite(strict));
  EXPECT_FALSE(allFinite(cloud));
}

TEST(FinitePoints, NeedsNormalsWhenAskedForThem) {
  PointCloud cloud = smallCloud();
  cloud.normals.clear();
  EXPECT_THROW(finitePoints(cloud, true), std::invalid_argument);
  EXPECT_TRUE(finitePoints(PointCloud{}, true).empty());
}

TEST(Transformed, MovesPointsAndRotatesNormals) {
  const Eigen::Isometry3d T = makePose({0, 0, 5}, expSo3({0, 0, 1.5707963267948966}));
  const PointCloud moved = transformed(smallCloud(), T);
  EXPECT_TRUE(moved.points[3].isApprox(Eigen::Vector3f(-2, 0, 6), 1e-6F));
  EXPECT_TRUE(moved.normals[3].isApprox(Eigen::Vector3f(-1, 0, 0), 1e-6F));
}

TEST(Transformed, KeepsMicrometresFarFromTheOrigin) {
  PointCloud cloud;
  cloud.points = {{0.5F, 0.25F, 0.125F}};
  const Eigen::Isometry3d far = makePose({1000, 1000, 0}, expSo3({0, 0, 0.3}));
  const PointCloud there = transformed(cloud, far);
  const Eigen::Vector3d expected = far * cloud.points[0].cast<double>();
  EXPECT_LT((there.points[0].cast<double>() - expected).norm(), 1e-4);  // half a float's step
}

TEST(MedianPoint, IsPerAxisAndSkipsNan) {
  const Eigen::Vector3d median = medianPoint(smallCloud());
  EXPECT_DOUBLE_EQ(median.x(), 0.0);
  EXPECT_DOUBLE_EQ(median.y(), 0.0);
  EXPECT_DOUBLE_EQ(median.z(), 1.0);
  EXPECT_TRUE(std::isnan(medianPoint(PointCloud{}).x()));
}

TEST(Decimated, TakesEveryNth) {
  const PointCloud cloud = smallCloud();
  EXPECT_EQ(decimated(cloud, 1).size(), 4U);
  EXPECT_EQ(decimated(cloud, 3).size(), 2U);
  EXPECT_EQ(decimated(cloud, 100).size(), 1U);
  EXPECT_THROW(decimated(cloud, 0), std::invalid_argument);
}

TEST(Append, RefusesToMixAttributes) {
  PointCloud cloud = smallCloud();
  PointCloud bare;
  bare.points = {{1, 1, 1}};
  EXPECT_THROW(cloud.append(bare), std::invalid_argument);
  PointCloud empty;
  empty.append(cloud);
  EXPECT_EQ(empty.size(), 4U);
  EXPECT_TRUE(empty.hasColors());
}

}  // namespace
}  // namespace scanner
