#include "scanner/registration/trials.h"

#include <gtest/gtest.h>

#include "registration/synthetic.h"

namespace scanner::registration {
namespace {

using synthetic::kDegree;

PointCloud bodyCloud() {
  const auto T = synthetic::lookAt({0.75, 0.0, 0.1}, {0.0, 0.0, 0.0});
  return synthetic::castView(0, T, 60, 45, 0.0, 1)->cloud;
}

// Moving cloud and reference are the same points, so that T_ref_mov = identity is exact.
TrialInput inputFor(const PointCloud& cloud, const Eigen::Isometry3d& T_prior) {
  TrialInput input;
  input.reference = {
      {std::make_shared<const IndexedCloud>(cloud), Eigen::Isometry3d::Identity(), 0}};
  input.moving.samples = cloud;
  input.T_prior = T_prior;
  input.last_view_median = medianPoint(cloud);
  return input;
}

RegistrationOptions strict() {
  RegistrationOptions o;
  o.icp.stop = StopRule::kAtConvergence;
  o.icp.max_iterations = 60;
  o.icp.accept_mean_m = 1e-5;
  return o;
}

Eigen::Isometry3d shift(double x, double y, double z) {
  return makePose({x, y, z}, Eigen::Quaterniond::Identity());
}

TEST(Trials, Step1TakesAPureShift) {
  const PointCloud cloud = bodyCloud();
  const auto outcome = runTrials(inputFor(cloud, shift(0.004, 0.003, 0.002)), strict(), 1);
  ASSERT_TRUE(outcome.success);
  EXPECT_EQ(outcome.step, 1);
  EXPECT_EQ(outcome.icp_runs, 1);
  EXPECT_LT(outcome.icp.T_ref_mov.translation().norm(), 1e-6);
}

TEST(Trials, Step2TakesATurn) {
  const PointCloud cloud = bodyCloud();
  Eigen::Isometry3d T_prior = shift(0.0, 0.0, 0.7);
  T_prior = T_prior * makePose({0, 0, 0}, expSo3(Eigen::Vector3d(0.0, 2.0 * kDegree, 0.0))) *
            shift(0.0, 0.0, -0.7);
  const auto outcome = runTrials(inputFor(cloud, T_prior), strict(), 1);
  ASSERT_TRUE(outcome.success);
  EXPECT_EQ(outcome.step, 2);
  EXPECT_EQ(outcome.icp_runs, 2);
}

TEST(Trials, Step3PutsTheMediansOnEachOther) {
  const PointCloud cloud = bodyCloud();
  // Far away every sample finds the same rim, so that only the medians bring it back.
  const auto outcome = runTrials(inputFor(cloud, shift(5.0, 3.0, 2.0)), strict(), 1);
  ASSERT_TRUE(outcome.success);
  EXPECT_EQ(outcome.step, 3);
}

TEST(Trials, Step4IsStep3WithATurn) {
  const PointCloud cloud = bodyCloud();
  Eigen::Isometry3d T_prior = shift(5.0, 3.0, 2.0);
  T_prior.linear() = expSo3(Eigen::Vector3d(0.0, 3.0 * kDegree, 0.0)).toRotationMatrix();
  const auto outcome = runTrials(inputFor(cloud, T_prior), strict(), 1);
  ASSERT_TRUE(outcome.success);
  EXPECT_EQ(outcome.step, 4);
}

TEST(Trials, Steps5And6UseTheWholeReference) {
  const PointCloud cloud = bodyCloud();
  TrialInput input = inputFor(cloud, shift(5.0, 3.0, 2.0));
  input.last_view_median = Eigen::Vector3d(-4.0, 5.0, 6.0);
  auto outcome = runTrials(input, strict(), 1);
  ASSERT_TRUE(outcome.success);
  EXPECT_EQ(outcome.step, 5);
  input.T_prior.linear() = expSo3(Eigen::Vector3d(0.0, 3.0 * kDegree, 0.0)).toRotationMatrix();
  outcome = runTrials(input, strict(), 1);
  ASSERT_TRUE(outcome.success);
  EXPECT_EQ(outcome.step, 6);
}

TEST(Trials, Step7RepeatsWithoutTheCrowdedBuckets) {
  // A crowd of false samples, all with one normal, that no reference point explains: they spoil
  // every mean until step 7 drops their bucket.
  const PointCloud cloud = bodyCloud();
  TrialInput input = inputFor(cloud, shift(0.003, 0.002, 0.001));
  const Eigen::Vector3f normal = cloud.normals[cloud.size() / 2];
  for (int i = 0; i < 200; ++i) {
    input.moving.samples.points.push_back(cloud.points[cloud.size() / 2] + normal * 0.004F);
    input.moving.samples.normals.push_back(normal);
    input.moving.samples.sigmas.push_back(0.0F);
  }
  RegistrationOptions options = strict();
  options.correspondence.rejection_factor = 0.0;
  const auto outcome = runTrials(input, options, 1);
  ASSERT_TRUE(outcome.success);
  EXPECT_TRUE(outcome.resampled);
  EXPECT_EQ(outcome.reportedStep(), 7);
  EXPECT_GT(outcome.icp_runs, 6);
  options.trials.resample = false;
  EXPECT_EQ(runTrials(input, options, 1).reportedStep(), 8);
}

TEST(Trials, Step8GivesUpWithAReason) {
  const PointCloud cloud = bodyCloud();
  RegistrationOptions options = strict();
  options.icp.accept_mean_m = 1e-9;
  options.icp.max_iterations = 1;
  Eigen::Isometry3d T_prior = shift(0.05, 0.02, 0.01);
  T_prior.linear() = expSo3(Eigen::Vector3d(0.05, 0.02, 0.04)).toRotationMatrix();
  const auto outcome = runTrials(inputFor(cloud, T_prior), options, 1);
  EXPECT_FALSE(outcome.success);
  EXPECT_EQ(outcome.reportedStep(), 8);
  EXPECT_EQ(outcome.icp_runs, 12);  // steps 1 to 6, twice
  EXPECT_FALSE(outcome.icp.status.message().empty());
}

TEST(Trials, StatisticsAddUpOverTheStages) {
  TrialStatistics s;
  s.intra_group[2] = 3;
  s.inter_group[2] = 4;
  s.recovery[8] = 1;
  EXPECT_EQ(s.total()[2], 7U);
  EXPECT_EQ(s.total()[8], 1U);
}

}  // namespace
}  // namespace scanner::registration
