#include "scanner/inertial/odometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "inertial/motion.h"
#include "scanner/core/se3.h"
#include "scanner/core/status.h"
#include "scanner/inertial/attitude.h"

namespace scanner::inertial {
namespace {

using testing::at;
using testing::Noise;
using testing::orbit;
using testing::Path;
using testing::sense;

constexpr double kDegree = 3.14159265358979323846 / 180.0;
const Noise kMtiNoise{0.012, 0.05, Eigen::Vector3d(-0.004, 0.002, 0.003), 7};

InertialOdometry filled(const InertialOptions& options, const std::vector<ImuSample>& samples) {
  InertialOdometry odometry(options);
  for (const ImuSample& s : samples) odometry.add(s);
  return odometry;
}

Path still(const Eigen::Quaterniond& q) {
  return [q](double) { return makePose(Eigen::Vector3d(1.0, 2.0, 3.0), q); };
}

TEST(InertialOptions, DefaultsAreThePublishedOnesAndBoundsHold) {
  const InertialOptions o;
  EXPECT_EQ(o.gravity_mps2, 9.82);
  EXPECT_EQ(o.band_low, 0.01);
  EXPECT_EQ(o.band_high, 0.9);
  EXPECT_TRUE(o.start_from_rest);
  EXPECT_FALSE(o.use_registration_velocity);
  EXPECT_EQ(o.orientation_time_constant_s, 0.0);
  InertialOptions bad;
  bad.band_low = 0.95;
  EXPECT_THROW(InertialOdometry{bad}, ConfigurationError);
  bad = {};
  bad.init_s = 100.0;
  EXPECT_THROW(InertialOdometry{bad}, ConfigurationError);
}

TEST(InertialOptions, AreDescribedCompletely) {
  InertialOptions options;
  options.use_registration_velocity = true;
  options.max_gap_s = 0.2;
  const ParameterTree tree = dumpOptions(options);
  EXPECT_EQ(tree.size(), 22u);
  InertialOptions loaded;
  loadOptions(tree, "inertial", loaded);
  EXPECT_TRUE(loaded.use_registration_velocity);
  EXPECT_EQ(loaded.max_gap_s, 0.2);
  EXPECT_THROW(loadOptions(ParameterTree{{"gravity", 9.8}}, "inertial", loaded),
               ConfigurationError);
  EXPECT_THROW(loadOptions(ParameterTree{{"gravity_mps2", 98.2}}, "inertial", loaded),
               ConfigurationError);
}

TEST(Levelling, PutsTheSpecificForceUpright) {
  for (const Eigen::Vector3d& f : {Eigen::Vector3d(9.06, 0.12, -3.68), Eigen::Vector3d(0, 0, 9.8),
                                   Eigen::Vector3d(0, 0, -9.8), Eigen::Vector3d(-3, 9, 1)}) {
    const Eigen::Vector3d up = levelFromGravity(f, 0.3) * f.normalized();
    EXPECT_LT((up - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
  }
}

TEST(InertialOdometry, SaysWhatItDoesNotKnow) {
  InertialOdometry odometry{InertialOptions()};
  EXPECT_EQ(odometry.predict(at(0)).status().code(), StatusCode::kNotEnoughData);
  const auto samples = sense(still(Eigen::Quaterniond::Identity()), 100, 3.0, 9.82, true);
  for (std::size_t i = 0; i < 50; ++i) odometry.add(samples[i]);
  EXPECT_EQ(odometry.predict(at(0.2)).status().code(), StatusCode::kNotEnoughData);
  for (std::size_t i = 50; i < samples.size(); ++i) odometry.add(samples[i]);
  EXPECT_TRUE(odometry.predict(at(0.0)).isOk()) << "states reach back to the first sample";
  EXPECT_TRUE(odometry.predict(at(0.2)).isOk());
  EXPECT_TRUE(odometry.predict(at(3.05)).isOk());
  EXPECT_EQ(odometry.predict(at(3.2)).status().code(), StatusCode::kOutOfRange);
  EXPECT_EQ(odometry.predict(at(-0.1)).status().code(), StatusCode::kOutOfRange);
  EXPECT_NEAR(odometry.statistics().sample_rate_hz, 100.0, 1e-6);
  EXPECT_NEAR(odometry.statistics().band_high_hz, 45.0, 1e-6);
}

TEST(InertialOdometry, KeepsABoundedHistory) {
  InertialOptions options;
  options.history_s = 5.0;
  const InertialOdometry odometry =
      filled(options, sense(still(Eigen::Quaterniond::Identity()), 50, 30.0, 9.82, true));
  EXPECT_TRUE(odometry.predict(at(26.0)).isOk());
  EXPECT_EQ(odometry.predict(at(24.0)).status().code(), StatusCode::kOutOfRange);
}

TEST(InertialOdometry, StandingStillStaysInPlace) {
  const Eigen::Quaterniond q = expSo3(Eigen::Vector3d(0.3, -0.2, 1.0));
  for (const bool orientation : {true, false}) {
    const InertialOdometry odometry =
        filled({}, sense(still(q), 100, 20.0, 9.82, orientation, kMtiNoise));
    const auto a = odometry.predict(at(2.0));
    const auto b = odometry.predict(at(20.0));
    ASSERT_TRUE(a.isOk() && b.isOk());
    EXPECT_TRUE(b->stationary);
    EXPECT_GT(odometry.statistics().stationary_s, 19.0);
    EXPECT_LT((odometry.statistics().gyro_bias - kMtiNoise.gyro_bias).norm(), 0.001);
    EXPECT_LT(angleBetween(Eigen::Quaterniond(a->T_odom_base.linear()),
                           Eigen::Quaterniond(b->T_odom_base.linear())),
              1.0 * kDegree);
    const Eigen::Isometry3d step =
        relativePrior(*odometry.predict(at(10.0)), *odometry.predict(at(10.55)), {});
    EXPECT_LT(step.translation().norm(), 0.02);
  }
}

TEST(InertialOdometry, LevelsASensorWithoutOrientation) {
  const Eigen::Quaterniond q = expSo3(Eigen::Vector3d(0.4, -1.1, 2.0));
  const InertialOdometry odometry = filled({}, sense(still(q), 200, 5.0, 9.82, false));
  const auto state = odometry.predict(at(5.0));
  ASSERT_TRUE(state.isOk());
  const Eigen::Matrix3d R = state->T_odom_base.linear();
  EXPECT_LT((R.transpose() * Eigen::Vector3d::UnitZ() -
             q.toRotationMatrix().transpose() * Eigen::Vector3d::UnitZ())
                .norm(),
            1e-6);
  EXPECT_NEAR(rollPitchYaw(R).z(), 0.0, 1e-6);
}

TEST(InertialOdometry, UsesTheOrientationOfTheSensorAsItIs) {
  const Path path = orbit(2.0);
  const InertialOdometry odometry = filled({}, sense(path, 100, 10.0, 9.82, true));
  for (double t = 0.0; t < 10.0; t += 0.37) {
    const auto state = odometry.predict(at(t));
    ASSERT_TRUE(state.isOk());
    EXPECT_LT((state->T_odom_base.linear() - path(t).linear()).norm(), 1e-3) << t;
  }
}

TEST(InertialOdometry, StreamIsContinuousAndItsVelocityIsItsDerivative) {
  const InertialOdometry odometry = filled({}, sense(orbit(1.5), 100, 6.0, 9.82, true));
  const double h = 1e-4;
  for (double t = 2.0; t < 5.9; t += 0.0313) {
    const auto a = odometry.predict(at(t - h)), b = odometry.predict(at(t + h));
    const Eigen::Vector3d v =
        (b->T_odom_base.translation() - a->T_odom_base.translation()) / (2.0 * h);
    EXPECT_LT((v - odometry.predict(at(t))->velocity).norm(), 0.02) << t;
  }
}

// A band-pass that lets through what a circle of 2 Hz needs, so that the closed form holds.
TEST(InertialOdometry, FollowsAFastCircularMotion) {
  const double w = 4.0 * 3.14159265358979323846, r = 0.1;
  const Path path = [&](double t) {
    return makePose(Eigen::Vector3d(r * std::cos(w * t), r * std::sin(w * t), 0.0),
                    Eigen::Quaterniond::Identity());
  };
  InertialOptions options;
  options.band_low = 1e-5;
  options.band_high = 0.995;
  options.start_from_rest = false;
  const InertialOdometry odometry = filled(options, sense(path, 200, 4.0, 9.82, true));
  // The stream starts at rest: what is missing is a constant velocity, so second differences count.
  const double dt = 0.125;
  for (double t = 1.0; t < 3.5; t += 0.1) {
    const auto p = [&](double s) -> Eigen::Vector3d {
      return odometry.predict(at(s))->T_odom_base.translation();
    };
    const Eigen::Vector3d got = p(t - dt) - 2.0 * p(t) + p(t + dt);
    const Eigen::Vector3d want =
        path(t - dt).translation() - 2.0 * path(t).translation() + path(t + dt).translation();
    EXPECT_LT((got - want).norm(), 0.01 * want.norm()) << t;
  }
}

TEST(InertialOdometry, RelativePriorFromRestIntegratesTheIntervalAlone) {
  InertialOptions options;
  const InertialOdometry odometry = filled(options, sense(orbit(1.5), 100, 6.0, 9.82, true));
  const OdometryState a = *odometry.predict(at(3.0));
  const OdometryState b = *odometry.predict(at(3.55));
  const Eigen::Isometry3d rest = relativePrior(a, b, options);
  options.start_from_rest = false;
  const Eigen::Isometry3d moving = relativePrior(a, b, options);
  const Eigen::Vector3d difference = moving.translation() - rest.translation();
  EXPECT_LT((difference - a.T_odom_base.linear().transpose() * a.velocity * 0.55).norm(), 1e-12);
  EXPECT_LT((moving.matrix() - (a.T_odom_base.inverse() * b.T_odom_base).matrix()).norm(), 1e-12);
  const auto prior = odometry.prior(at(3.0), at(3.55));
  ASSERT_TRUE(prior.isOk());
  EXPECT_LT((prior->matrix() - rest.matrix()).norm(), 1e-12);
}

TEST(InertialOdometry, CountsAndSkipsBadSamples) {
  const auto samples = sense(still(Eigen::Quaterniond::Identity()), 100, 3.0, 9.82, true);
  InertialOdometry clean{InertialOptions()}, dirty{InertialOptions()};
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_TRUE(clean.add(samples[i]).isOk());
    EXPECT_TRUE(dirty.add(samples[i]).isOk());
    if (i != 150) continue;
    EXPECT_EQ(dirty.add(samples[150]).code(), StatusCode::kInvalidInput);
    EXPECT_EQ(dirty.add(samples[100]).code(), StatusCode::kInvalidInput);
    ImuSample nan = samples[151];
    nan.linear_acceleration.x() = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(dirty.add(nan).code(), StatusCode::kInvalidInput);
    nan = samples[151];
    nan.orientation = Eigen::Quaterniond(0, 0, 0, 0);
    EXPECT_EQ(dirty.add(nan).code(), StatusCode::kInvalidInput);
  }
  EXPECT_EQ(dirty.statistics().duplicates, 1u);
  EXPECT_EQ(dirty.statistics().backwards, 1u);
  EXPECT_EQ(dirty.statistics().non_finite, 2u);
  EXPECT_EQ(dirty.statistics().samples, samples.size());
  EXPECT_EQ(clean.predict(at(2.5))->T_odom_base.matrix(),
            dirty.predict(at(2.5))->T_odom_base.matrix());
}

TEST(InertialOdometry, RestartsBehindAGap) {
  for (const bool orientation : {true, false}) {
    InertialOdometry odometry{InertialOptions()};
    const auto samples = sense(orbit(1.0), 100, 8.0, 9.82, orientation);
    int gap_statuses = 0;
    for (const ImuSample& s : samples) {
      if (s.stamp > at(3.0) && s.stamp < at(3.5)) continue;
      if (odometry.add(s).code() == StatusCode::kOutOfRange) ++gap_statuses;
      if (s.stamp == at(4.0)) {
        EXPECT_EQ(odometry.predict(at(3.2)).status().code(), StatusCode::kOutOfRange);
        EXPECT_EQ(odometry.predict(at(3.8)).status().code(), StatusCode::kNotEnoughData);
        EXPECT_TRUE(odometry.predict(at(2.9)).isOk());
      }
    }
    EXPECT_EQ(gap_statuses, 1);
    EXPECT_EQ(odometry.statistics().gaps, 1u);
    EXPECT_NEAR(odometry.statistics().longest_gap_s, 0.5, 0.02);
    EXPECT_EQ(odometry.predict(at(3.2)).status().code(), StatusCode::kOutOfRange);
    const auto before = odometry.predict(at(2.9)), after = odometry.predict(at(3.5));
    ASSERT_TRUE(before.isOk() && after.isOk());
    EXPECT_NE(before->segment, after->segment);
    EXPECT_LT(after->velocity.norm(), 1e-9);
    EXPECT_EQ(odometry.prior(at(2.9), at(3.6)).status().code(), StatusCode::kOutOfRange);
    EXPECT_TRUE(odometry.prior(at(3.6), at(4.1)).isOk());
    EXPECT_EQ(relativePrior(*before, *after, {}).translation().norm(), 0.0);
  }
}

// ---- registration feedback -----------------------------------------------------------------

InertialOptions feedbackOptions() {
  InertialOptions options;
  options.use_registration_velocity = true;
  return options;
}

// Map differs from world by a yaw and a shift, and slightly in tilt, as a first pose from an AHRS.
const Eigen::Isometry3d kMapWorld =
    makePose(Eigen::Vector3d(5, -3, 1), expSo3(Eigen::Vector3d(0.005, -0.008, 0.9)));

// Largest translation error of the prior over the intervals between views 0.55 s apart, from
// `first_s` on: until a few poses have told the tilt of the map it is part of the error.
double worstPrior(const InertialOptions& options, bool orientation, const Noise& noise,
                  double pose_noise, double first_s = 0.0) {
  const Path path = orbit(2.0);
  const auto samples = sense(path, 100, 20.0, 9.82, orientation, noise);
  InertialOdometry odometry = filled(options, samples);
  std::mt19937_64 generator(3);
  std::normal_distribution<double> normal(0.0, pose_noise);
  double worst = 0.0;
  for (double t = 0.4; t + 0.55 < 20.0; t += 0.55) {
    Eigen::Isometry3d pose = kMapWorld * path(t);
    for (int k = 0; k < 3; ++k) pose.translation()[k] += normal(generator);
    odometry.correct(at(t), pose);
    const auto prior = odometry.prior(at(t), at(t + 0.55));
    EXPECT_TRUE(prior.isOk());
    const Eigen::Isometry3d truth = path(t).inverse() * path(t + 0.55);
    if (t < first_s) continue;
    worst = std::max(worst, (truth.inverse() * *prior).translation().norm());
  }
  return worst;
}

TEST(RegistrationVelocity, GivesThePriorToMillimetresWithoutNoise) {
  EXPECT_LT(worstPrior(feedbackOptions(), true, {}, 0.0), 0.02);
  EXPECT_LT(worstPrior(feedbackOptions(), true, {}, 0.0, 5.0), 0.004);
}

TEST(RegistrationVelocity, GivesThePriorToCentimetresWithNoiseWherePublishedGivesDecimetres) {
  const double thesis = worstPrior({}, true, kMtiNoise, 0.001);
  EXPECT_GT(thesis, 0.05);
  EXPECT_LT(worstPrior(feedbackOptions(), true, kMtiNoise, 0.001), 0.03);
  EXPECT_LT(worstPrior(feedbackOptions(), false, kMtiNoise, 0.001), 0.03);
}

TEST(RegistrationVelocity, SolvesTheVelocityOfAConstantMotion) {
  const Eigen::Vector3d v(0.2, -0.1, 0.05);
  const Path path = [&](double t) {
    return makePose(v * t, expSo3(Eigen::Vector3d(0.1, 0.2, 0.3)));
  };
  InertialOptions options = feedbackOptions();
  options.acceleration_bias_sigma_mps2 = 1e-4;
  options.still_acceleration_std_mps2 = 0.0;  // a smooth motion cannot be told from rest
  Noise noise;
  noise.acceleration_mps2 = 1e-6;
  InertialOdometry odometry = filled(options, sense(path, 100, 5.0, 9.82, true, noise));
  odometry.correct(at(2.0), kMapWorld * path(2.0));
  odometry.correct(at(2.5), kMapWorld * path(2.5));
  const auto state = odometry.predict(at(2.5));
  ASSERT_TRUE(state.isOk());
  // Tilt of the map (0.5 deg) is in the alignment; v is in odom, which is the world here.
  EXPECT_LT((state->velocity - v).norm(), 0.03);
  EXPECT_GT(state->position_sigma_m, 0.0);
}

TEST(RegistrationVelocity, DoesNotDependOnWhenAndInWhichOrderCorrectionsCame) {
  const Path path = orbit(2.0);
  const auto samples = sense(path, 100, 10.0, 9.82, true, kMtiNoise);
  const InertialOptions options = feedbackOptions();
  InertialOdometry afterwards = filled(options, samples);
  for (int k = 12; k >= 1; --k) afterwards.correct(at(0.7 * k), kMapWorld * path(0.7 * k));
  InertialOdometry live(options);
  int next = 1;
  for (const ImuSample& s : samples) {
    live.add(s);
    if (next <= 12 && s.stamp > at(0.7 * next + 0.4)) {
      EXPECT_TRUE(live.predict(at(0.7 * next)).isOk());
      live.correct(at(0.7 * next), kMapWorld * path(0.7 * next));
      ++next;
    }
  }
  for (double t = 0.5; t < 10.0; t += 0.31) {
    EXPECT_EQ(afterwards.predict(at(t))->T_odom_base.matrix(),
              live.predict(at(t))->T_odom_base.matrix())
        << t;
    EXPECT_EQ(afterwards.predict(at(t))->velocity, live.predict(at(t))->velocity) << t;
  }
}

TEST(RegistrationVelocity, PositionStaysContinuousOverACorrection) {
  const Path path = orbit(2.0);
  InertialOdometry odometry =
      filled(feedbackOptions(), sense(path, 100, 10.0, 9.82, true, kMtiNoise));
  for (int k = 1; k < 12; ++k) odometry.correct(at(0.7 * k), kMapWorld * path(0.7 * k));
  for (int k = 1; k < 12; ++k) {
    const auto a = odometry.predict(at(0.7 * k - 1e-5)), b = odometry.predict(at(0.7 * k + 1e-5));
    EXPECT_LT((a->T_odom_base.translation() - b->T_odom_base.translation()).norm(), 2e-5);
  }
}

TEST(RegistrationVelocity, HoldsThePositionWhileStandingStill) {
  // 0.7 deg of tilt error would carry a sensor at rest half a metre away in three seconds.
  auto samples = sense(still(Eigen::Quaterniond::Identity()), 100, 4.0, 9.82, true, kMtiNoise);
  for (ImuSample& s : samples) s.orientation = expSo3(Eigen::Vector3d(0.012, 0.0, 0.0));
  InertialOdometry odometry = filled(feedbackOptions(), samples);
  odometry.correct(at(0.3), Eigen::Isometry3d::Identity());
  const auto prior = odometry.prior(at(0.3), at(3.3));
  ASSERT_TRUE(prior.isOk());
  EXPECT_LT(prior->translation().norm(), 1e-3);
}

TEST(RegistrationVelocity, IgnoresAndCountsUnusableCorrections) {
  InertialOdometry odometry = filled(feedbackOptions(), sense(orbit(1), 100, 5.0, 9.82, true));
  const auto before = odometry.predict(at(4.0));
  Eigen::Isometry3d nan = Eigen::Isometry3d::Identity();
  nan.translation().x() = std::numeric_limits<double>::quiet_NaN();
  odometry.correct(at(2.0), nan);
  odometry.correct(at(-1.0), Eigen::Isometry3d::Identity());
  odometry.correct(at(7.0), Eigen::Isometry3d::Identity());
  EXPECT_EQ(odometry.statistics().corrections_ignored, 3u);
  EXPECT_EQ(odometry.statistics().corrections, 0u);
  EXPECT_EQ(odometry.predict(at(4.0))->T_odom_base.matrix(), before->T_odom_base.matrix());
}

TEST(Attitude, GyroCarriesTheRotationWhenTheSensorOrientationOnlyPulls) {
  // The orientation of the sensor is off by a slowly changing degree; the gyro is good.
  const Path path = orbit(1.0);
  auto samples = sense(path, 100, 20.0, 9.82, true);
  for (ImuSample& s : samples) {
    const double t = toSeconds(s.stamp - at(0));
    s.orientation = expSo3(Eigen::Vector3d(0, 0.017 * std::sin(0.8 * t), 0.0)) * *s.orientation;
  }
  const auto worst = [&](double constant) {
    InertialOptions options;
    options.orientation_time_constant_s = constant;
    const InertialOdometry odometry = filled(options, samples);
    double angle = 0.0;
    for (double t = 1.0; t < 19.0; t += 0.5) {
      const Eigen::Isometry3d truth = path(t).inverse() * path(t + 0.5);
      angle = std::max(angle, rotationAngle(truth.inverse() * *odometry.prior(at(t), at(t + 0.5))));
    }
    return angle;
  };
  EXPECT_GT(worst(0.0), 0.3 * kDegree);
  EXPECT_LT(worst(10.0), 0.1 * kDegree);
}

}  // namespace
}  // namespace scanner::inertial
