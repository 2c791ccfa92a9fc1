#include "scanner/registration/icp.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "registration/synthetic.h"
#include "scanner/registration/normals.h"

namespace scanner::registration {
namespace {

using synthetic::kDegree;
using synthetic::Random;

std::vector<Eigen::Vector3d> randomPoints(std::size_t n, Random& random) {
  std::vector<Eigen::Vector3d> points(n);
  for (auto& p : points)
    p = Eigen::Vector3d(random.gaussian(), random.gaussian(), random.gaussian());
  return points;
}

Reference referenceOf(const PointCloud& cloud) {
  return {{std::make_shared<const IndexedCloud>(cloud), Eigen::Isometry3d::Identity(), 0}};
}

IcpOptions convergent(Metric metric) {
  IcpOptions o;
  o.metric = metric;
  o.stop = StopRule::kAtConvergence;
  o.max_iterations = 100;
  o.converged_translation_m = 1e-9;
  o.converged_rotation_deg = 1e-7;
  return o;
}

PointCloud bodyCloud() {
  const auto T = synthetic::lookAt({0.75, 0.0, 0.1}, {0.0, 0.0, 0.0});
  return synthetic::castView(0, T, 80, 60, 0.0, 1)->cloud;
}

TEST(PointToPoint, RecoversAKnownMotionFromExactPairs) {
  Random random(1);
  for (int trial = 0; trial < 20; ++trial) {
    const auto from = randomPoints(trial < 10 ? 3 : 30, random);
    const Eigen::Isometry3d T = random.motion(3.1 * random.uniform(), 2.0);
    std::vector<Eigen::Vector3d> to;
    for (const auto& p : from) to.push_back(T * p);
    const auto found = alignPointToPoint(from, to);
    ASSERT_TRUE(found);
    EXPECT_TRUE(found->isApprox(T, 1e-9));
  }
}

TEST(PointToPoint, NeverAReflection) {
  Random random(2);
  for (int trial = 0; trial < 20; ++trial) {
    const auto from = randomPoints(8, random);
    std::vector<Eigen::Vector3d> to;
    for (const auto& p : from) to.emplace_back(-p.x(), p.y(), p.z());
    EXPECT_NEAR(alignPointToPoint(from, to)->linear().determinant(), 1.0, 1e-9);
  }
}

TEST(PointToPoint, InverseAndEquivariance) {
  Random random(3);
  const auto a = randomPoints(20, random);
  auto b = randomPoints(20, random);  // no exact relation: the properties hold for any pairs
  const auto forward = alignPointToPoint(a, b);
  EXPECT_TRUE(alignPointToPoint(b, a)->isApprox(forward->inverse(), 1e-9));
  const Eigen::Isometry3d G = random.motion(1.0, 1.0);
  for (auto& p : b) p = G * p;
  EXPECT_TRUE(alignPointToPoint(a, b)->isApprox(G * *forward, 1e-9));
  EXPECT_TRUE(alignPointToPoint(a, a)->isApprox(Eigen::Isometry3d::Identity(), 1e-9));
}

TEST(PointToPoint, TooFewOrUnfinitePairsAreRefused) {
  const std::vector<Eigen::Vector3d> two(2, Eigen::Vector3d::Zero());
  EXPECT_EQ(alignPointToPoint(two, two).status().code(), StatusCode::kNotEnoughData);
  const std::vector<Eigen::Vector3d> bad(4, Eigen::Vector3d::Constant(std::nan("")));
  EXPECT_EQ(alignPointToPoint(bad, bad).status().code(), StatusCode::kInvalidInput);
}

TEST(Correspondences, BothCompatibilityFormulas) {
  CorrespondenceOptions plain;
  CorrespondenceOptions printed;
  printed.compatibility = Compatibility::kPrintedFormula;
  const Eigen::Vector3f x(1, 0, 0);
  const auto at = [](double deg) {
    return Eigen::Vector3d(std::cos(deg * kDegree), std::sin(deg * kDegree), 0.0)
        .cast<float>()
        .eval();
  };
  EXPECT_TRUE(compatible(x, at(29.0), plain));
  EXPECT_FALSE(compatible(x, at(31.0), plain));
  EXPECT_FALSE(compatible(x, at(180.0), plain));
  EXPECT_TRUE(compatible(x, at(14.0), printed));
  EXPECT_FALSE(compatible(x, at(16.0), printed));
  EXPECT_TRUE(compatible(x, at(180.0), printed));  // as printed: the sign is lost
}

TEST(Correspondences, NearestCompatibleMatchesBruteForce) {
  Random random(5);
  PointCloud reference;
  for (int i = 0; i < 2000; ++i) {
    reference.points.push_back(random.direction().cast<float>() *
                               static_cast<float>(random.uniform()));
    reference.normals.push_back(random.direction().cast<float>());
  }
  const IndexedCloud index(reference);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3f p = random.direction().cast<float>() * 0.8F;
    const Eigen::Vector3f n = random.direction().cast<float>();
    const float min_cos = std::cos(30.0F * static_cast<float>(kDegree));
    float best = 0.09F;
    std::size_t expected = reference.size();
    for (std::size_t k = 0; k < reference.size(); ++k) {
      const float d = (reference.points[k] - p).squaredNorm();
      if (d < best && reference.normals[k].dot(n) >= min_cos) {
        best = d;
        expected = k;
      }
    }
    const auto match = index.nearestCompatible(p, n, min_cos, false, 0.09F);
    ASSERT_EQ(match.found, expected < reference.size());
    if (match.found) {
      EXPECT_EQ(match.index, expected);
    }
  }
}

TEST(Correspondences, RejectionAtTwiceTheMedian) {
  std::vector<Correspondence> pairs(5);
  const double distances[] = {1.0, 2.0, 3.0, 6.0, 6.1};
  for (std::size_t i = 0; i < 5; ++i) pairs[i].distance = distances[i];
  EXPECT_EQ(rejectDistant(pairs, 2.0).size(), 4U);
  EXPECT_EQ(rejectDistant(pairs, 0.0).size(), 5U);
  EXPECT_TRUE(rejectDistant({}, 2.0).empty());
}

TEST(Icp, BothMetricsReturnToTheTruth) {
  const PointCloud cloud = bodyCloud();
  const Reference reference = referenceOf(cloud);
  Random random(6);
  for (Metric metric : {Metric::kPointToPoint, Metric::kPointToPlane}) {
    const Eigen::Isometry3d T = random.motion(3.0 * kDegree, 0.01);
    const Moving moving{transformed(cloud, T.inverse()), {}};
    const IcpResult result =
        icp(reference, moving, Eigen::Isometry3d::Identity(), Eigen::Isometry3d::Identity(),
            Variant::kFull, convergent(metric), {}, 2);
    EXPECT_TRUE(result.accepted) << result.status.message();
    EXPECT_LT((result.T_ref_mov.translation() - T.translation()).norm(), 2e-6);
    EXPECT_LT(rotationAngle(result.T_ref_mov.inverse() * T), 2e-6);
    EXPECT_GT(result.overlap, 0.99);
    EXPECT_EQ(result.degenerate_directions, 0);
  }
}

TEST(Icp, TranslationalFindsAShiftAndLeavesTheRotation) {
  const PointCloud cloud = bodyCloud();
  // Well below the spacing of the rays: a lattice shifted by its own pitch would fit as well.
  const Eigen::Isometry3d T = makePose({0.002, -0.001, 0.003}, Eigen::Quaterniond::Identity());
  const Moving moving{transformed(cloud, T.inverse()), {}};
  for (Metric metric : {Metric::kPointToPoint, Metric::kPointToPlane}) {
    const IcpResult result =
        icp(referenceOf(cloud), moving, Eigen::Isometry3d::Identity(),
            Eigen::Isometry3d::Identity(), Variant::kTranslational, convergent(metric), {}, 1);
    EXPECT_LT((result.T_ref_mov.translation() - T.translation()).norm(), 1e-6);
    EXPECT_LT(rotationAngle(result.T_ref_mov), 1e-12);
  }
}

TEST(Icp, StopsAtTheThresholdOrConverges) {
  const PointCloud cloud = bodyCloud();
  const Eigen::Isometry3d T = makePose({0.01, 0.0, 0.0}, Eigen::Quaterniond::Identity());
  const Moving moving{transformed(cloud, T.inverse()), {}};
  const IcpOptions early;
  const auto I = Eigen::Isometry3d::Identity();
  const IcpResult a = icp(referenceOf(cloud), moving, I, I, Variant::kFull, early, {}, 1);
  const IcpResult b = icp(referenceOf(cloud), moving, I, I, Variant::kFull,
                          convergent(Metric::kPointToPoint), {}, 1);
  EXPECT_TRUE(a.accepted);
  EXPECT_LT(a.iterations, b.iterations);
  EXPECT_GT(a.mean_distance_m, b.mean_distance_m);
}

TEST(Icp, SlidingPlaneKeepsThePriorInItsFreeDirections) {
  Random random(8);
  PointCloud plane;
  for (int i = 0; i < 4000; ++i) {
    plane.points.emplace_back(static_cast<float>(random.uniform() - 0.5),
                              static_cast<float>(random.uniform() - 0.5), 0.0F);
    const Eigen::Vector3d n(0.01 * random.gaussian(), 0.01 * random.gaussian(), 1.0);
    plane.normals.push_back(n.normalized().cast<float>());
  }
  const Eigen::Isometry3d start =
      makePose({0.03, -0.02, 0.01}, expSo3(Eigen::Vector3d(0.02, -0.01, 0.03)));
  const Moving moving{plane, {}};
  const IcpResult result = icp(referenceOf(plane), moving, start, start, Variant::kFull,
                               convergent(Metric::kPointToPlane), {}, 1);
  EXPECT_EQ(result.degenerate_directions, 3);
  // Height and tilt are found; shift in the plane and turn about its normal stay the prior's.
  EXPECT_NEAR(result.T_ref_mov.translation().z(), 0.0, 1e-3);
  EXPECT_NEAR(result.T_ref_mov.linear().col(2).z(), 1.0, 1e-4);
  EXPECT_NEAR(result.T_ref_mov.translation().x(), start.translation().x(), 2e-3);
  EXPECT_NEAR(result.T_ref_mov.translation().y(), start.translation().y(), 2e-3);
  EXPECT_NEAR(rollPitchYaw(result.T_ref_mov.linear()).z(), 0.03, 2e-3);
  const Eigen::SelfAdjointEigenSolver<Matrix6> solver(result.information);
  EXPECT_GT(solver.eigenvalues()(0), 0.0);
}

TEST(Icp, RefusesRatherThanAcceptsAWrongResult) {
  const PointCloud cloud = bodyCloud();
  const Eigen::Isometry3d T = makePose({0.02, 0.0, 0.0}, expSo3(Eigen::Vector3d(0, 0, 0.05)));
  const Moving moving{transformed(cloud, T.inverse()), {}};
  const auto I = Eigen::Isometry3d::Identity();
  IcpOptions o = convergent(Metric::kPointToPlane);
  o.max_rotation_deg = 1.0;
  EXPECT_EQ(icp(referenceOf(cloud), moving, I, I, Variant::kFull, o, {}, 1).status.code(),
            StatusCode::kOutOfRange);
  o.max_rotation_deg = 0.0;
  o.max_translation_m = 0.001;
  EXPECT_EQ(icp(referenceOf(cloud), moving, I, I, Variant::kFull, o, {}, 1).status.code(),
            StatusCode::kOutOfRange);
  const IcpResult empty = icp({}, moving, I, I, Variant::kFull, o, {}, 1);
  EXPECT_EQ(empty.status.code(), StatusCode::kNotEnoughData);
}

TEST(Icp, SameBytesForEveryThreadCount) {
  const PointCloud cloud = bodyCloud();
  Random random(9);
  const Eigen::Isometry3d T = random.motion(2.0 * kDegree, 0.01);
  const Moving moving{transformed(cloud, T.inverse()), {}};
  const auto I = Eigen::Isometry3d::Identity();
  const auto o = convergent(Metric::kPointToPlane);
  const auto one = icp(referenceOf(cloud), moving, I, I, Variant::kFull, o, {}, 1);
  const auto two = icp(referenceOf(cloud), moving, I, I, Variant::kFull, o, {}, 2);
  EXPECT_EQ(one.T_ref_mov.matrix(), two.T_ref_mov.matrix());
  EXPECT_EQ(one.information, two.information);
}

TEST(Normals, OfASphereTowardsTheViewpoint) {
  Random random(10);
  PointCloud sphere;
  for (int i = 0; i < 3000; ++i) sphere.points.push_back(random.direction().cast<float>());
  const Eigen::Vector3d viewpoint(0, 0, 10);
  estimateNormalsKnn(sphere, 12, viewpoint, 2);
  for (std::size_t i = 0; i < sphere.size(); ++i) {
    EXPECT_GT(std::abs(sphere.normals[i].dot(sphere.points[i])), 0.98F);
    EXPECT_GE(sphere.normals[i].dot(viewpoint.cast<float>() - sphere.points[i]), 0.0F);
  }
}

}  // namespace
}  // namespace scanner::registration
