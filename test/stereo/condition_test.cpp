#include "scanner/stereo/condition.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace scanner::stereo {
namespace {

PointCloud box(std::size_t n, double low, double high, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::uniform_real_distribution<double> side(-0.2, 0.2), height(low, high);
  PointCloud cloud;
  for (std::size_t i = 0; i < n; ++i) {
    cloud.points.push_back(
        Eigen::Vector3d(side(generator), side(generator), height(generator)).cast<float>());
  }
  return cloud;
}

ConditioningOptions groundOnly() {
  ConditioningOptions o;
  o.remove_outliers = false;
  return o;
}

TEST(Condition, GroundGoesTheStatueStays) {
  PointCloud cloud = box(6000, 0.01, 0.75, 1);
  cloud.append(box(5000, -0.002, 0.002, 2));
  const Conditioned result = condition(cloud, groundOnly());
  EXPECT_TRUE(result.statistics.ground_found);
  EXPECT_NEAR(result.statistics.ground_height_m, 0.0, 0.015);
  EXPECT_LE(result.statistics.ground_half_width_m, 0.015);
  EXPECT_EQ(result.statistics.kept, result.kept.size());
  std::size_t ground_left = 0, statue_left = 0;
  for (const std::size_t i : result.kept) (i < 6000 ? statue_left : ground_left) += 1;
  EXPECT_EQ(ground_left, 0U);
  EXPECT_GT(statue_left, 5600U);
}

TEST(Condition, TheLowestOfSeveralLevelsIsTheGround) {
  PointCloud cloud = box(6000, 0.0, 0.75, 1);
  cloud.append(box(3000, 0.010, 0.012, 2));
  cloud.append(box(4000, 0.500, 0.502, 3));  // a shelf with more points
  const Conditioned result = condition(cloud, groundOnly());
  EXPECT_NEAR(result.statistics.ground_height_m, 0.011, 0.015);
}

TEST(Condition, AGroundOnTheBorderOfTwoBinsGoesAltogether) {
  // Heights start at -0.016, so that a border of bins lies within the ground's 20 mm.
  PointCloud cloud = box(6000, 0.03, 0.75, 1);
  cloud.append(box(8000, -0.016, 0.010, 2));
  const auto ground_left = [&](bool spans_bins) {
    ConditioningOptions o = groundOnly();
    o.ground_spans_bins = spans_bins;
    std::size_t left = 0;
    for (const std::size_t i : condition(cloud, o).kept) left += i < 6000 ? 0 : 1;
    return left;
  };
  EXPECT_GT(ground_left(false), 500U);  // the published rule
  EXPECT_EQ(ground_left(true), 0U);
}

TEST(Condition, AHorizontalSurfaceBeingScannedSurvives) {
  for (const double thickness : {0.0, 0.004, 0.02, 0.05}) {
    const PointCloud cloud = box(4000, 0.3, 0.3 + thickness + 1e-9, 4);
    const Conditioned result = condition(cloud, groundOnly());
    EXPECT_EQ(result.kept.size(), 4000U) << thickness;
    EXPECT_FALSE(result.statistics.ground_found);
  }
  // With a few stray heights the printed rule alone would take all of it.
  PointCloud cloud = box(4000, 0.300, 0.302, 4);
  cloud.append(box(60, 0.0, 1.5, 5));
  EXPECT_GT(condition(cloud, groundOnly()).kept.size(), 4000U);
  ConditioningOptions printed = groundOnly();
  printed.ground_max_share = 1.0;
  EXPECT_LT(condition(cloud, printed).kept.size(), 100U);
}

TEST(Condition, NoGroundNothingRemoved) {
  const Conditioned result = condition(box(50000, 0.0, 0.75, 6), groundOnly());
  EXPECT_GT(result.kept.size(), 45000U);
}

TEST(Condition, OutliersByAxis) {
  PointCloud cloud;
  for (int i = 0; i < 101; ++i) {
    cloud.points.emplace_back(0.001f * static_cast<float>(i), 0.002f * static_cast<float>(i), 0.5f);
  }
  cloud.points.emplace_back(5.0f, 0.1f, 0.5f);
  cloud.points.emplace_back(0.05f, -5.0f, 0.5f);
  cloud.points.emplace_back(5.0f, 5.0f, 0.5f);
  ConditioningOptions o;
  o.remove_ground = false;
  const Conditioned result = condition(cloud, o);
  EXPECT_EQ(result.kept.size(), 101U);
  EXPECT_EQ(result.kept.back(), 100U);
  EXPECT_EQ(result.statistics.outliers_x, 2U);
  EXPECT_EQ(result.statistics.outliers_y, 2U);
  o.remove_outliers = false;
  EXPECT_EQ(condition(cloud, o).kept.size(), 104U);
}

TEST(Condition, LimitIsTwoSigmaFromTheMedian) {
  // x = -2, -1, 0, 1, 2 and 6: median 0.5, sigma 2.828 (n - 1), so |x - 0.5| >= 5.657 goes.
  const auto kept = [](float last) {
    PointCloud cloud;
    for (const float x : {-2.0f, -1.0f, 0.0f, 1.0f, 2.0f, last}) cloud.points.emplace_back(x, 0, 0);
    ConditioningOptions o;
    o.remove_ground = false;
    return condition(cloud, o).kept.size();
  };
  EXPECT_EQ(kept(6.0f), 6U);
  EXPECT_EQ(kept(12.0f), 5U);
}

TEST(Condition, EmptyNanAndTinyClouds) {
  EXPECT_TRUE(condition({}, {}).kept.empty());
  PointCloud cloud;
  cloud.points.assign(100, Eigen::Vector3f::Constant(NAN));
  cloud.points[7].z() = INFINITY;
  const Conditioned result = condition(cloud, {});
  EXPECT_TRUE(result.kept.empty());
  EXPECT_EQ(result.statistics.not_finite, 100U);
  cloud.points[50] = {1, 2, 3};
  EXPECT_EQ(condition(cloud, {}).kept, (std::vector<std::size_t>{50}));
  // One stray point light years away must not ask for a histogram of that size.
  PointCloud far = box(1000, 0.0, 0.5, 8);
  far.points.emplace_back(0.0f, 0.0f, 1e12f);
  EXPECT_EQ(condition(far, groundOnly()).kept.size(), 1001U);
}

}  // namespace
}  // namespace scanner::stereo
