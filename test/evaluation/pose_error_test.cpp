#include "scanner/evaluation/pose_error.h"

#include <gtest/gtest.h>

#include <cmath>

namespace scanner::evaluation {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180.0;

Eigen::Isometry3d pose(double x, double y, double z, const Eigen::Vector3d& w) {
  return makePose(Eigen::Vector3d(x, y, z), expSo3(w));
}

Time at(double t) { return fromNanoseconds(1'700'000'000'000'000'000) + fromSeconds(t); }

TEST(MotionComponents, AreThoseOfTheTables) {
  const Eigen::Quaterniond q = Eigen::AngleAxisd(30 * kDegree, Eigen::Vector3d::UnitZ()) *
                               Eigen::AngleAxisd(-20 * kDegree, Eigen::Vector3d::UnitY()) *
                               Eigen::AngleAxisd(10 * kDegree, Eigen::Vector3d::UnitX());
  const MotionComponents m = motionComponents(makePose(Eigen::Vector3d(3, -4, 12), q));
  EXPECT_NEAR(m.roll_deg, 10.0, 1e-9);
  EXPECT_NEAR(m.pitch_deg, -20.0, 1e-9);
  EXPECT_NEAR(m.yaw_deg, 30.0, 1e-9);
  EXPECT_NEAR(m.arc_deg, 2.0 * std::acos(std::abs(q.w())) / kDegree, 1e-9);
  EXPECT_NEAR(m.rho_m, 13.0, 1e-12);
  EXPECT_EQ(m.z_m, 12.0);
}

TEST(PriorErrors, AreZeroForAPerfectPrior) {
  const Eigen::Isometry3d T = pose(0.1, 0.2, 0.3, {0.1, 0.2, -0.4});
  const auto rows = relativePriorErrors({{0, 1, T, T}});
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_NEAR(rows[0].motion.arc_deg, 0.0, 1e-6);
  EXPECT_NEAR(rows[0].motion.rho_m, 0.0, 1e-12);
}

TEST(PriorErrors, AreWhatRegistrationHadToAdd) {
  const Eigen::Isometry3d prior = pose(0.1, 0.0, 0.0, {0.0, 0.0, 0.5});
  const Eigen::Isometry3d missing = pose(0.03, 0.04, 0.0, {0.0, 0.0, 8.0 * kDegree});
  const auto rows = relativePriorErrors({{4, 5, prior, prior * missing}});
  EXPECT_EQ(rows[0].from, 4);
  EXPECT_EQ(rows[0].to, 5);
  EXPECT_NEAR(rows[0].motion.arc_deg, 8.0, 1e-9);
  EXPECT_NEAR(rows[0].motion.yaw_deg, 8.0, 1e-9);
  EXPECT_NEAR(rows[0].motion.rho_m, 0.05, 1e-12);
}

TEST(PriorErrors, AbsoluteErrorsAreCompounded) {
  std::vector<PriorPair> pairs;
  const Eigen::Isometry3d step = pose(0.1, 0.0, 0.0, Eigen::Vector3d::Zero());
  for (int i = 0; i < 10; ++i) {
    pairs.push_back({i, i + 1, step, pose(0.1, 0.02, 0.0, Eigen::Vector3d::Zero())});
  }
  const auto rows = absolutePriorErrors(pairs);
  ASSERT_EQ(rows.size(), 10u);
  for (int i = 0; i < 10; ++i) {
    const MotionRow& row = rows[static_cast<std::size_t>(i)];
    EXPECT_EQ(row.from, 0);
    EXPECT_EQ(row.to, i + 1);
    EXPECT_NEAR(row.motion.y_m, 0.02 * (i + 1), 1e-12);
  }
  const MotionSummary summary = summarize(rows);
  EXPECT_NEAR(summary.rho_m.mean, 0.11, 1e-12);
  EXPECT_NEAR(summary.rho_m.median, 0.11, 1e-12);
  pairs[5].from = 17;
  EXPECT_THROW(absolutePriorErrors(pairs), ConfigurationError);
}

TEST(Motions, BetweenNeighboursAreSeenFromTheMap) {
  Trajectory trajectory;
  for (int i = 0; i < 5; ++i) {
    trajectory.push_back(
        {at(i), pose(0.1 * i, 0.0, 0.0, Eigen::Vector3d(0, 0, 10.0 * kDegree * i))});
  }
  const auto rows = motionsBetweenNeighbours(trajectory);
  ASSERT_EQ(rows.size(), 4u);
  for (const MotionRow& row : rows) {
    EXPECT_NEAR(row.motion.x_m, 0.1, 1e-12);
    EXPECT_NEAR(row.motion.rho_m, 0.1, 1e-12);
    EXPECT_NEAR(row.motion.yaw_deg, 10.0, 1e-9);
  }
  EXPECT_TRUE(motionsBetweenNeighbours({}).empty());
}

Trajectory truthPath() {
  Trajectory truth;
  for (int i = 0; i <= 1000; ++i) {
    const double t = 0.01 * i;
    truth.push_back({at(t), pose(0.2 * t, 0.0, 1.0, Eigen::Vector3d(0, 0, 0.1 * t))});
  }
  return truth;
}

TEST(CompareToTruth, DoesNotSeeARigidChangeOfFrame) {
  const Eigen::Isometry3d T = pose(4.0, -2.0, 0.5, {0.3, -0.2, 1.1});
  Trajectory estimate;
  for (int i = 0; i < 15; ++i) {  // between the stamps of the truth
    const double t = 0.005 + 0.55 * i;
    estimate.push_back({at(t), T * pose(0.2 * t, 0.0, 1.0, Eigen::Vector3d(0, 0, 0.1 * t))});
  }
  const auto errors = compareToTruth(estimate, truthPath());
  ASSERT_TRUE(errors.isOk());
  EXPECT_EQ(errors->poses.size(), 15u);
  EXPECT_LT(errors->position_max_m, 1e-6);
  EXPECT_LT(errors->rotation_max_deg, 1e-5);
}

TEST(CompareToTruth, GivesTheClosedFormOfKnownErrors) {
  Trajectory estimate;
  for (int i = 0; i < 4; ++i) {
    Eigen::Isometry3d T = pose(0.2 * i, 0.0, 1.0, Eigen::Vector3d(0, 0, 0.1 * i));
    T = T * pose(0.0, 0.0, 0.01 * i, Eigen::Vector3d(0.0, 2.0 * kDegree * i, 0.0));
    estimate.push_back({at(i), T});
  }
  const auto errors = compareToTruth(estimate, truthPath());
  ASSERT_TRUE(errors.isOk());
  EXPECT_NEAR(errors->position_max_m, 0.03, 1e-9);
  EXPECT_NEAR(errors->position_rmse_m, 0.01 * std::sqrt((0 + 1 + 4 + 9) / 4.0), 1e-9);
  EXPECT_NEAR(errors->rotation_max_deg, 6.0, 1e-6);
  EXPECT_NEAR(errors->rotation_rmse_deg, 2.0 * std::sqrt((0 + 1 + 4 + 9) / 4.0), 1e-6);
}

TEST(CompareToTruth, CountsPosesWithoutTruth) {
  Trajectory estimate;
  for (const double t : {-1.0, 1.0, 2.0, 50.0}) {
    estimate.push_back({at(t), pose(0.2 * t, 0.0, 1.0, Eigen::Vector3d(0, 0, 0.1 * t))});
  }
  const auto errors = compareToTruth(estimate, truthPath());
  ASSERT_TRUE(errors.isOk());
  EXPECT_EQ(errors->skipped, 2);
  EXPECT_EQ(errors->poses.size(), 2u);
  EXPECT_EQ(compareToTruth(estimate, {}).status().code(), StatusCode::kNotEnoughData);
  EXPECT_EQ(compareToTruth({}, truthPath()).status().code(), StatusCode::kNotEnoughData);
}

}  // namespace
}  // namespace scanner::evaluation
