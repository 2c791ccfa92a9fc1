#include "scanner/simulation/motion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iostream>
#include <nlohmann/json.hpp>
#include <vector>

#include "scanner/core/se3.h"
#include "scanner/core/status.h"
#include "scanner/simulation/motion_statistics.h"
#include "simulation/motion_subjects.h"

namespace scanner::simulation {
namespace {

constexpr double kDegrees = 180.0 / 3.14159265358979323846;

double viewTime(const MotionOptions& options, int view) {
  return firstViewTime(options) + view / options.view_rate_hz;
}

/// What the camera sees of an elliptic cylinder that fills the bounds of the subject.
struct Sight {
  double fill = 0.0;       ///< share of the frame on the object
  double nearest_m = 1e9;  ///< surface in the frame
};

Sight look(const Eigen::Isometry3d& T_map_camera, const Eigen::AlignedBox3d& bounds) {
  constexpr int kColumns = 40;
  constexpr int kRows = 30;
  const Eigen::Vector3d half = 0.5 * bounds.sizes();
  const Eigen::Vector3d from = T_map_camera.translation() - bounds.center();
  Sight sight;
  for (int i = 0; i < kColumns * kRows; ++i) {
    const int row = i / kColumns;
    const double u = (i % kColumns + 0.5) / kColumns - 0.5;
    const double v = (row + 0.5) / kRows - 0.5;
    const Eigen::Vector3d ray =
        T_map_camera.linear() * Eigen::Vector3d(u * 1024 / 1098, v * 768 / 1098, 1.0).normalized();
    const Eigen::Vector2d p = from.head<2>().cwiseQuotient(half.head<2>());
    const Eigen::Vector2d d = ray.head<2>().cwiseQuotient(half.head<2>());
    const double a = d.squaredNorm();
    const double b = p.dot(d);
    const double root = b * b - a * (p.squaredNorm() - 1.0);
    if (root < 0.0) continue;
    const double depth = (-b - std::sqrt(root)) / a;
    if (depth < 0.0 || std::abs(from.z() + depth * ray.z()) > half.z()) continue;
    sight.fill += 1.0 / (kColumns * kRows);
    sight.nearest_m = std::min(sight.nearest_m, depth);
  }
  return sight;
}

void expectExactDerivatives(const Motion& motion) {
  constexpr double kStep = 1e-4;
  for (double t = 0.05; t < motion.duration() - 0.05; t += 0.0137) {
    const MotionState before = motion.at(t - kStep);
    const MotionState now = motion.at(t);
    const MotionState after = motion.at(t + kStep);
    const auto slope = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
      return Eigen::Vector3d((b - a) / (2.0 * kStep));
    };
    const Eigen::Vector3d velocity =
        slope(before.T_map_base.translation(), after.T_map_base.translation());
    ASSERT_LT((now.velocity - velocity).norm(), 2e-6) << t;
    ASSERT_LT((now.acceleration - slope(before.velocity, after.velocity)).norm(), 2e-5) << t;
    const Eigen::Quaterniond turned(before.T_map_base.linear().transpose() *
                                    after.T_map_base.linear());
    // Half of the turn lies before `now`, so that the mean rate is that in the middle.
    ASSERT_LT((now.angular_velocity - logSo3(turned) / (2.0 * kStep)).norm(), 2e-5) << t;
    const Eigen::Vector3d angular = slope(before.angular_velocity, after.angular_velocity);
    ASSERT_LT((now.angular_acceleration - angular).norm(), 2e-4) << t;
  }
}

/// Largest change of an acceleration, m/s^2 or rad/s^2, within `step`.
double largestChange(const Motion& motion, double step) {
  double largest = 0.0;
  MotionState last = motion.at(0.0);
  for (double t = step; t < motion.duration(); t += step) {
    const MotionState now = motion.at(t);
    largest = std::max({largest, (now.acceleration - last.acceleration).norm(),
                        (now.angular_acceleration - last.angular_acceleration).norm()});
    last = now;
  }
  return largest;
}

TEST(MotionTest, DerivativesAreThoseOfThePose) {
  expectExactDerivatives(*makeMotion(test::statue(), {}, 1));
  expectExactDerivatives(*makeMotion(test::pole(), {}, 1));
}

TEST(MotionTest, AccelerationHasNoJumps) {
  // A jump would not shrink with the step.
  for (const MotionSubject& subject : {test::statue(), test::pole()}) {
    const auto motion = makeMotion(subject, {}, 1);
    const double coarse = largestChange(*motion, 1e-3);
    EXPECT_LT(largestChange(*motion, 1e-4), 0.12 * coarse) << subject.path;
  }
}

TEST(MotionTest, StaysWithinWhatAHandDoes) {
  for (const MotionSubject& subject : {test::statue(), test::pole()}) {
    for (int seed = 1; seed <= 5; ++seed) {
      const auto motion = makeMotion(subject, {}, seed);
      double lowest_z = 1e9;
      for (double t = 0.0; t < motion->duration(); t += 0.005) {
        const MotionState state = motion->at(t);
        ASSERT_LT(state.velocity.norm(), 0.7);
        ASSERT_LT(state.acceleration.norm(), 5.0);
        ASSERT_LT(state.angular_velocity.norm() * kDegrees, 200.0);
        lowest_z = std::min(lowest_z, state.T_map_base.translation().z());
      }
      EXPECT_GT(lowest_z, 0.1);
    }
  }
}

TEST(MotionTest, StandsStillBeforeTheFirstViewAndAtTheEnd) {
  MotionOptions options;
  const auto hand = makeMotion(test::statue(), options, 1);
  for (double t = 0.0; t <= firstViewTime(options); t += 0.01) {
    ASSERT_LT(hand->at(t).velocity.norm(), 0.006);
    ASSERT_LT(hand->at(t).acceleration.norm(), 0.1);
    ASSERT_LT(hand->at(t).angular_velocity.norm(), 0.015);
  }
  EXPECT_LT(hand->at(hand->duration() - 0.5).velocity.norm(), 0.006);

  options.tremor_m = 0.0;
  options.tremor_deg = 0.0;
  const auto tripod = makeMotion(test::statue(), options, 1);
  EXPECT_EQ(tripod->at(firstViewTime(options)).velocity.norm(), 0.0);
  EXPECT_TRUE(tripod->at(0.0).T_map_base.isApprox(tripod->at(2.9).T_map_base, 0.0));
  EXPECT_EQ(tripod->at(tripod->duration() - 0.99).velocity.norm(), 0.0);
  EXPECT_GT(tripod->at(firstViewTime(options) + 0.3).velocity.norm(), 0.01);
}

TEST(MotionTest, TremorHasTheAskedSize) {
  MotionOptions options;
  const auto hand = makeMotion(test::statue(), options, 1);
  options.tremor_m = 0.0;
  options.tremor_deg = 0.0;
  const auto steady = makeMotion(test::statue(), options, 1);
  const Eigen::Isometry3d& T_base_camera = test::statue().T_base_camera;
  double position = 0.0;
  double rotation = 0.0;
  int count = 0;
  for (double t = 5.0; t < 29.0; t += 0.01, ++count) {
    const Eigen::Isometry3d a = steady->at(t).T_map_base * T_base_camera;
    const Eigen::Isometry3d b = hand->at(t).T_map_base * T_base_camera;
    position += (a.translation() - b.translation()).squaredNorm();
    rotation += std::pow(rotationAngle(a.inverse() * b) * kDegrees, 2);
  }
  EXPECT_NEAR(std::sqrt(position / count), 0.0015, 0.0002);
  EXPECT_NEAR(std::sqrt(rotation / count), 0.25, 0.05);  // heading counts less when tilted
}

TEST(MotionTest, OrbitHasTheStepsOfTable52) {
  const MotionOptions options;
  for (int seed = 0; seed < 24; ++seed) {
    const MotionSubject subject = seed % 2 == 0 ? test::slimStatue() : test::statue();
    const auto motion = makeMotion(subject, options, seed);
    const MotionStatistics statistics = motionStatistics(*motion, options);
    if (seed == 0) std::cout << motionTable("artwork", statistics);
    ASSERT_EQ(statistics.rows.size(), 49U);
    EXPECT_NEAR(statistics.summary.arc_deg.mean, 8.7313, 0.05 * 8.7313) << seed;
    EXPECT_NEAR(statistics.summary.arc_deg.sigma, 4.4186, 0.15 * 4.4186) << seed;
    EXPECT_NEAR(statistics.summary.rho_m.mean, 0.0993, 0.05 * 0.0993) << seed;
    EXPECT_NEAR(statistics.summary.rho_m.sigma, 0.0311, 0.15 * 0.0311) << seed;
  }
}

TEST(MotionTest, OrbitClosesTheLoop) {
  const MotionOptions options;
  for (const MotionSubject& subject : {test::statue(), test::slimStatue()}) {
    for (int seed = 0; seed < 6; ++seed) {
      const auto motion = makeMotion(subject, options, seed);
      const auto camera = [&](int view) {
        return motion->at(viewTime(options, view)).T_map_base * subject.T_base_camera;
      };
      // Round a slim object the way is short, and the last pictures repeat some of the first.
      double nearest_m = 1e9;
      double nearest_deg = 0.0;
      for (int view = 0; view < 8; ++view) {
        const Eigen::Isometry3d gap = camera(view).inverse() * camera(options.views - 1);
        if (gap.translation().norm() >= nearest_m) continue;
        nearest_m = gap.translation().norm();
        nearest_deg = rotationAngle(gap) * kDegrees;
      }
      EXPECT_LT(nearest_m, 0.1) << seed;
      EXPECT_LT(nearest_deg, 15.0) << seed;
    }
  }
}

TEST(MotionTest, OrbitKeepsTheObjectInThePictureAndInReach) {
  const MotionOptions options;
  for (const MotionSubject& subject : {test::statue(), test::slimStatue()}) {
    for (int seed = 0; seed < 12; ++seed) {
      const auto motion = makeMotion(subject, options, seed);
      for (int view = 0; view < options.views; ++view) {
        const Sight sight = look(
            motion->at(viewTime(options, view)).T_map_base * subject.T_base_camera, subject.bounds);
        EXPECT_GT(sight.fill, 0.4) << seed << " " << view;
        EXPECT_GT(sight.nearest_m, 0.45) << seed << " " << view;
        EXPECT_LT(sight.nearest_m, 0.7) << seed << " " << view;
      }
    }
  }
}

/// How many pictures show the point at the azimuth and height on the side of the object, no more
/// than 63 deg from its normal.
int timesSeen(const std::vector<Eigen::Isometry3d>& cameras, const Eigen::AlignedBox3d& bounds,
              double azimuth, double z) {
  const Eigen::Vector3d half = 0.5 * bounds.sizes();
  const Eigen::Vector3d normal(std::cos(azimuth), std::sin(azimuth), 0.0);
  const Eigen::Vector3d scaled = normal.cwiseProduct(half);
  Eigen::Vector3d point = scaled.cwiseProduct(half) / scaled.norm();
  point.z() = z;
  return static_cast<int>(
      std::count_if(cameras.begin(), cameras.end(), [&](const Eigen::Isometry3d& T_map_camera) {
        const Eigen::Vector3d p = T_map_camera.inverse() * point;
        const double facing = (T_map_camera.translation() - point).normalized().dot(normal);
        return facing > 0.45 && p.z() > 0.0 && std::abs(p.x() / p.z()) < 0.45 &&
               std::abs(p.y() / p.z()) < 0.34;
      }));
}

TEST(MotionTest, OrbitSeesAllSidesOfTheObject) {
  const MotionOptions options;
  const MotionSubject subject = test::statue();
  for (int seed = 0; seed < 6; ++seed) {
    const auto motion = makeMotion(subject, options, seed);
    std::vector<Eigen::Isometry3d> cameras;
    cameras.reserve(static_cast<std::size_t>(options.views));
    for (int view = 0; view < options.views; ++view) {
      cameras.push_back(motion->at(viewTime(options, view)).T_map_base * subject.T_base_camera);
    }
    int points = 0;
    int once = 0;
    int twice = 0;
    for (int i = 0; i < 72; ++i) {
      for (double z = 0.03; z < 0.73; z += 0.05, ++points) {
        const int seen = timesSeen(cameras, subject.bounds, i * 5.0 / kDegrees, z);
        once += seen >= 1 ? 1 : 0;
        twice += seen >= 2 ? 1 : 0;
      }
    }
    EXPECT_GT(once, 0.985 * points) << seed;
    EXPECT_GT(twice, 0.95 * points) << seed;
  }
}

TEST(MotionTest, PassesGoUpDownAndUpAgain) {
  const MotionOptions options;
  const MotionSubject subject = test::pole();
  const auto motion = makeMotion(subject, options, 1);
  const MotionStatistics statistics = motionStatistics(*motion, options);
  std::cout << motionTable("totem", statistics);
  EXPECT_NEAR(statistics.summary.rho_m.mean, 0.0993, 0.05 * 0.0993);
  EXPECT_LT(statistics.summary.arc_deg.median, 4.0);

  int turns = 0;
  double trend = 1.0;
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  double low = 1e9;
  double high = 0.0;
  for (int view = 0; view < options.views; ++view) {
    const Eigen::Isometry3d T_map_camera =
        motion->at(viewTime(options, view)).T_map_base * subject.T_base_camera;
    const Eigen::Vector3d position = T_map_camera.translation();
    low = std::min(low, position.z());
    high = std::max(high, position.z());
    const double rise = view == 0 ? 0.0 : position.z() - last.z();
    if (std::abs(rise) > 0.05 && rise * trend < 0.0) {
      ++turns;
      trend = rise;
    }
    last = position;
    const Sight sight = look(T_map_camera, subject.bounds);
    EXPECT_GT(sight.fill, 0.5) << view;
    EXPECT_GT(sight.nearest_m, 0.5) << view;
    EXPECT_LT(sight.nearest_m, 0.7) << view;
  }
  EXPECT_EQ(turns, 2);
  EXPECT_LT(low, 0.35);
  EXPECT_GT(high, 1.5);
}

TEST(MotionTest, PictureIsUpright) {
  for (const MotionSubject& subject : {test::statue(), test::pole()}) {
    const auto motion = makeMotion(subject, {}, 3);
    for (double t = 0.0; t < motion->duration(); t += 0.5) {
      const Eigen::Isometry3d T = motion->at(t).T_map_base * subject.T_base_camera;
      EXPECT_GT(-T.linear().col(1).z(), 0.7);                  // y of the picture points down
      EXPECT_LT(std::abs(T.linear().col(0).z()), 0.1);         // x is level
      EXPECT_LT(T.linear().col(2).dot(T.translation()), 0.0);  // and the object is ahead
    }
  }
}

TEST(MotionTest, FewPicturesAreTheStartOfALongScan) {
  MotionOptions options;
  options.views = 8;
  const auto motion = makeMotion(test::statue(), options, 1);
  const double rho = motionStatistics(*motion, options).summary.rho_m.mean;
  EXPECT_NEAR(rho, 0.0993, 0.02);
  options.views = 1;
  EXPECT_NEAR(makeMotion(test::statue(), options, 1)->duration(), options.still_s + 1.0, 1e-9);
}

TEST(MotionTest, HigherRateTakesMorePicturesOfTheSameMotion) {
  MotionOptions options;
  options.view_rate_hz = 7.28;
  options.views = 197;
  const auto motion = makeMotion(test::statue(), options, 1);
  const MotionStatistics statistics = motionStatistics(*motion, options);
  EXPECT_NEAR(statistics.summary.rho_m.mean, 0.0993 / 4.0, 0.003);
  EXPECT_NEAR(motion->duration(), makeMotion(test::statue(), {}, 1)->duration(), 1e-6);
}

TEST(MotionTest, LargerAndSmallerObjectsStayInReach) {
  const MotionOptions options;
  const Eigen::Vector3d sizes[] = {{0.9, 0.35, 0.4}, {0.15, 0.15, 0.2}, {0.5, 0.5, 1.2}};
  for (const Eigen::Vector3d& size : sizes) {
    MotionSubject subject = test::statue();
    const Eigen::Vector3d half(0.5 * size.x(), 0.5 * size.y(), 0.0);
    subject.bounds = {-half, half + Eigen::Vector3d(0.0, 0.0, size.z())};
    const auto motion = makeMotion(subject, options, 1);
    for (int view = 0; view < options.views; ++view) {
      const Eigen::Isometry3d T_map_camera =
          motion->at(viewTime(options, view)).T_map_base * subject.T_base_camera;
      const Sight sight = look(T_map_camera, subject.bounds);
      EXPECT_GT(sight.fill, 0.04) << size.transpose() << " view " << view;
      EXPECT_GT(sight.nearest_m, 0.43) << size.transpose() << " view " << view;
      EXPECT_LT(sight.nearest_m, 1.1) << size.transpose() << " view " << view;
    }
  }
}

TEST(MotionTest, EvenStepsWithoutPauses) {
  MotionOptions options;
  options.pauses = false;
  const auto motion = makeMotion(test::statue(), options, 1);
  const MotionStatistics statistics = motionStatistics(*motion, options);
  EXPECT_NEAR(statistics.summary.rho_m.mean, 0.0993, 0.05 * 0.0993);
  EXPECT_LT(statistics.summary.rho_m.sigma, 0.015);
  EXPECT_LT(statistics.summary.arc_deg.sigma, 2.0);
}

TEST(MotionTest, SameSeedSameBits) {
  const auto a = makeMotion(test::statue(), {}, 5);
  const auto b = makeMotion(test::statue(), {}, 5);
  const auto c = makeMotion(test::statue(), {}, 6);
  for (double t = 0.0; t < a->duration(); t += 0.1) {
    EXPECT_EQ(a->at(t).T_map_base.matrix(), b->at(t).T_map_base.matrix());
    EXPECT_EQ(a->at(t).acceleration, b->at(t).acceleration);
  }
  EXPECT_GT((a->at(10.0).T_map_base.translation() - c->at(10.0).T_map_base.translation()).norm(),
            1e-3);
}

TEST(MotionTest, RefusesWhatItCannotDo) {
  MotionSubject subject = test::statue();
  subject.path = "spiral";
  EXPECT_THROW(makeMotion(subject, {}, 1), ConfigurationError);
  subject = test::statue();
  subject.bounds.setEmpty();
  EXPECT_THROW(makeMotion(subject, {}, 1), ConfigurationError);
  MotionOptions options;
  EXPECT_THROW(loadOptions(ParameterTree{{"views", 0}}, "simulation.motion", options),
               ConfigurationError);
}

}  // namespace
}  // namespace scanner::simulation
