#include "scanner/registration/sampling.h"

#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>

#include "registration/synthetic.h"

namespace scanner::registration {
namespace {

using synthetic::kDegree;

// Half a flat wall, the rest random directions: what normal-space sampling is for.
PointCloud wallAndRelief(std::size_t n) {
  synthetic::Random random(1);
  PointCloud cloud;
  for (std::size_t i = 0; i < n; ++i) {
    cloud.points.push_back(random.direction().cast<float>());
    cloud.normals.push_back(i % 2 == 0 ? Eigen::Vector3f(1.0F, 0.0F, 0.0F)
                                       : random.direction().cast<float>());
  }
  return cloud;
}

TEST(Sampling, BucketsFollowTheSphericalAngles) {
  const NormalBuckets buckets(5.0 * kDegree);
  EXPECT_EQ(buckets.count(), 72U * 36U);
  EXPECT_EQ(buckets.of(Eigen::Vector3f(0, 0, 1)) / 72U, 0U);
  EXPECT_EQ(buckets.of(Eigen::Vector3f(0, 0, -1)) / 72U, 35U);
  const auto at = [&](double theta_deg, double phi_deg) {
    const double t = theta_deg * kDegree;
    const double p = phi_deg * kDegree;
    return buckets.of(
        Eigen::Vector3d(std::sin(p) * std::cos(t), std::sin(p) * std::sin(t), std::cos(p))
            .cast<float>());
  };
  EXPECT_EQ(at(11.0, 42.0), at(14.0, 44.0));
  EXPECT_NE(at(11.0, 42.0), at(16.0, 42.0));
  EXPECT_NE(at(11.0, 42.0), at(11.0, 46.0));
  EXPECT_THROW(NormalBuckets(0.0), ConfigurationError);
}

TEST(Sampling, BucketsAreEvenUpToOneOrExhausted) {
  const PointCloud cloud = wallAndRelief(20000);
  const NormalBuckets buckets(5.0 * kDegree);
  const auto chosen = sampleNormalSpace(cloud.normals, 3000, 5.0 * kDegree, 3);
  ASSERT_EQ(chosen.size(), 3000U);
  EXPECT_TRUE(std::is_sorted(chosen.begin(), chosen.end()));
  EXPECT_EQ(std::adjacent_find(chosen.begin(), chosen.end()), chosen.end());
  std::map<std::size_t, std::size_t> available;
  std::map<std::size_t, std::size_t> taken;
  for (const auto& n : cloud.normals) ++available[buckets.of(n)];
  for (std::size_t i : chosen) ++taken[buckets.of(cloud.normals[i])];
  std::size_t most = 0;
  for (const auto& [bucket, count] : taken) most = std::max(most, count);
  for (const auto& [bucket, count] : available) {
    EXPECT_GE(taken[bucket] + 1, std::min(count, most)) << "bucket " << bucket;
  }
}

TEST(Sampling, SameSeedSameSamplesOtherSeedOthers) {
  const PointCloud cloud = wallAndRelief(5000);
  const auto a = sampleNormalSpace(cloud.normals, 500, 5.0 * kDegree, 3);
  EXPECT_EQ(a, sampleNormalSpace(cloud.normals, 500, 5.0 * kDegree, 3));
  EXPECT_NE(a, sampleNormalSpace(cloud.normals, 500, 5.0 * kDegree, 4));
}

TEST(Sampling, FactorAndMinimumSetTheCount) {
  const PointCloud cloud = wallAndRelief(20000);
  SamplingOptions options;
  options.min_samples = 10;
  EXPECT_EQ(sampleCloud(cloud, SamplingMethod::kNormalSpace, 100.0, options, 1).size(), 200U);
  EXPECT_EQ(sampleCloud(cloud, SamplingMethod::kUniform, 100.0, options, 1).size(), 200U);
  options.min_samples = 700;
  EXPECT_EQ(sampleCloud(cloud, SamplingMethod::kNormalSpace, 100.0, options, 1).size(), 700U);
  options.min_samples = 50000;
  EXPECT_EQ(sampleCloud(cloud, SamplingMethod::kNormalSpace, 100.0, options, 1).size(), 20000U);
}

TEST(Sampling, VoxelTakesOnePointPerVoxel) {
  const std::vector<Eigen::Vector3f> points = {
      {0.1F, 0, 0}, {0.2F, 0, 0}, {1.1F, 0, 0}, {-0.1F, 0, 0}, {1.2F, 0, 0}};
  EXPECT_EQ(sampleVoxel(points, 1.0), (std::vector<std::size_t>{0, 2, 3}));
  EXPECT_THROW(sampleVoxel(points, 0.0), ConfigurationError);
}

TEST(Sampling, Step7DropsBucketsAboveTheMedian) {
  // Buckets of 1, 2, 3, 4 and 5 samples: those of 4 and 5 go.
  std::vector<Eigen::Vector3f> normals;
  for (int b = 1; b <= 5; ++b) {
    const double a = 20.0 * b * kDegree + 0.01;
    for (int i = 0; i < b; ++i) {
      normals.push_back(Eigen::Vector3d(std::cos(a), std::sin(a), 0.0).cast<float>());
    }
  }
  EXPECT_EQ(dropCrowdedBuckets(normals, 5.0 * kDegree),
            (std::vector<std::size_t>{0, 1, 2, 3, 4, 5}));
  EXPECT_TRUE(dropCrowdedBuckets({}, 5.0 * kDegree).empty());
}

TEST(RegistrationOptionsTest, DefaultsAreThePublishedValuesAndSurviveTheTree) {
  RegistrationOptions o;
  EXPECT_NO_THROW(validate(o));
  EXPECT_EQ(o.sampling.moving_factor, 100.0);
  EXPECT_EQ(o.icp.accept_mean_m, 0.003);
  EXPECT_EQ(o.icp.max_iterations, 10);
  EXPECT_EQ(o.groups.cutoff_deg, 20.0);
  o.icp.metric = Metric::kPointToPlane;
  RegistrationOptions loaded;
  loadOptions(dumpOptions(o), "registration", loaded);
  EXPECT_EQ(loaded.icp.metric, Metric::kPointToPlane);
  o.icp.max_iterations = 0;
  EXPECT_THROW(validate(o), ConfigurationError);
}

}  // namespace
}  // namespace scanner::registration
