#include "scanner/core/se3.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace scanner {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// Rotation vectors where implementations go wrong: zero, tiny, ordinary, nearly pi.
std::vector<Eigen::Vector3d> edgeRotations() {
  const Eigen::Vector3d axis = Eigen::Vector3d(0.3, -0.5, 0.8).normalized();
  std::vector<Eigen::Vector3d> rotations;
  for (const double angle : {0.0, 1e-12, 1e-7, 9.9e-5, 1.01e-4, 1e-2, 1.0, 3.0, kPi - 1e-7}) {
    rotations.push_back(angle * axis);
  }
  return rotations;
}

TEST(So3, LogInvertsExp) {
  for (const Eigen::Vector3d& w : edgeRotations()) {
    EXPECT_NEAR((logSo3(expSo3(w)) - w).norm(), 0.0, 1e-9) << w.transpose();
  }
}

TEST(So3, ExpAgreesWithAngleAxis) {
  for (const Eigen::Vector3d& w : edgeRotations()) {
    if (w.norm() == 0.0) continue;
    const Eigen::Quaterniond oracle(Eigen::AngleAxisd(w.norm(), w.normalized()));
    EXPECT_NEAR(angleBetween(expSo3(w), oracle), 0.0, 1e-12);
  }
}

TEST(Se3, LogInvertsExpAndExpOfNegativeIsInverse) {
  for (const Eigen::Vector3d& w : edgeRotations()) {
    Twist xi;
    xi << 0.3, -2.0, 1.5, w;
    EXPECT_NEAR((logSe3(expSe3(xi)) - xi).norm(), 0.0, 1e-8) << w.transpose();
    const Eigen::Isometry3d identity = expSe3(xi) * expSe3(-xi);
    EXPECT_NEAR((identity.matrix() - Eigen::Matrix4d::Identity()).norm(), 0.0, 1e-12);
  }
}

TEST(Se3, ScrewMotionHasItsClosedForm) {
  // A quarter turn about z while moving: the path is an arc of radius v/w.
  Twist xi;
  xi << 1.0, 0.0, 0.0, 0.0, 0.0, kPi / 2.0;
  const Eigen::Vector3d end = expSe3(xi).translation();
  EXPECT_NEAR(end.x(), 2.0 / kPi, 1e-12);
  EXPECT_NEAR(end.y(), 2.0 / kPi, 1e-12);
  EXPECT_NEAR(end.z(), 0.0, 1e-12);
}

TEST(AngleBetween, KeepsSmallAnglesAndIgnoresTheSignOfTheQuaternion) {
  const Eigen::Quaterniond a = expSo3({0.1, 0.2, 0.3});
  const Eigen::Quaterniond b = a * expSo3({1e-9, 0.0, 0.0});
  EXPECT_NEAR(angleBetween(a, b), 1e-9, 1e-15);
  const Eigen::Quaterniond negative(-b.w(), -b.x(), -b.y(), -b.z());
  EXPECT_NEAR(angleBetween(a, negative), 1e-9, 1e-15);
}

TEST(Interpolate, EndsAndMiddle) {
  const Eigen::Isometry3d a = makePose({1, 2, 3}, expSo3({0, 0, 0.2}));
  const Eigen::Isometry3d b = makePose({3, 2, 1}, expSo3({0, 0, 0.6}));
  EXPECT_TRUE(interpolate(a, b, 0.0).isApprox(a, 1e-12));
  EXPECT_TRUE(interpolate(a, b, 1.0).isApprox(b, 1e-12));
  EXPECT_TRUE(interpolate(a, b, 0.5).isApprox(makePose({2, 2, 2}, expSo3({0, 0, 0.4})), 1e-12));
}

TEST(NearestRotation, IsARotationEvenForAReflection) {
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 50; ++trial) {
    Eigen::Matrix3d m;
    for (int i = 0; i < 9; ++i) m.data()[i] = normal(generator);
    const Eigen::Matrix3d R = nearestRotation(m);
    EXPECT_NEAR((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 0.0, 1e-12);
    EXPECT_NEAR(R.determinant(), 1.0, 1e-12);
  }
}

TEST(RollPitchYaw, RebuildsTheRotation) {
  const Eigen::Vector3d rpy(0.3, -0.7, 2.5);
  const Eigen::Matrix3d R = (Eigen::AngleAxisd(rpy.z(), Eigen::Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(rpy.y(), Eigen::Vector3d::UnitY()) *
                             Eigen::AngleAxisd(rpy.x(), Eigen::Vector3d::UnitX()))
                                .toRotationMatrix();
  EXPECT_NEAR((rollPitchYaw(R) - rpy).norm(), 0.0, 1e-12);
}

TEST(IsFinite, FindsNan) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  EXPECT_TRUE(isFinite(T));
  T.translation().y() = std::nan("");
  EXPECT_FALSE(isFinite(T));
}

}  // namespace
}  // namespace scanner
