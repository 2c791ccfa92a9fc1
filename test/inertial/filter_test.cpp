#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "scanner/core/status.h"
#include "scanner/inertial/butterworth.h"
#include "scanner/inertial/verlet.h"

namespace scanner::inertial {
namespace {

constexpr double kPi = 3.14159265358979323846;

double closedFormGain(double f, double low, double high) {
  const double w = std::tan(kPi * f / 2.0);
  const double wl = std::tan(kPi * low / 2.0);
  const double wh = std::tan(kPi * high / 2.0);
  const double q = (w * w - wl * wh) / ((wh - wl) * w);
  return 1.0 / std::sqrt(1.0 + q * q);
}

TEST(Butterworth, GainFollowsTheClosedForm) {
  const ButterworthBandPass filter(0.01, 0.9);
  for (double f = 0.002; f < 0.999; f += 0.01) {
    EXPECT_NEAR(filter.gain(f), closedFormGain(f, 0.01, 0.9), 1e-12) << f;
  }
  EXPECT_NEAR(filter.gain(0.01), std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(filter.gain(0.9), std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(filter.gain(0.0), 0.0, 1e-12);
  EXPECT_NEAR(filter.gain(1.0), 0.0, 1e-12);
}

TEST(Butterworth, FilteredSineHasThatGain) {
  for (const double f : {0.005, 0.02, 0.1, 0.5, 0.9}) {
    ButterworthBandPass filter(0.01, 0.9);
    double in = 0.0, out = 0.0;
    for (int i = 0; i < 20000; ++i) {
      const double x = std::sin(kPi * f * i);
      const double y = filter.filter(Eigen::Vector3d::Constant(x)).x();
      if (i >= 12000) in += x * x, out += y * y;
    }
    EXPECT_NEAR(std::sqrt(out / in), closedFormGain(f, 0.01, 0.9), 2e-3) << f;
  }
}

TEST(Butterworth, DoesNotRingWhenStartedInSteadyState) {
  ButterworthBandPass filter(0.01, 0.9);
  const Eigen::Vector3d value(0.3, -2.0, 9.8);
  filter.resetToSteadyState(value);
  for (int i = 0; i < 1000; ++i) EXPECT_LT(filter.filter(value).norm(), 1e-12);
}

TEST(Butterworth, RefusesEdgesOutOfOrder) {
  EXPECT_THROW(ButterworthBandPass(0.5, 0.5), ConfigurationError);
  EXPECT_THROW(ButterworthBandPass(0.0, 0.5), ConfigurationError);
  EXPECT_THROW(ButterworthBandPass(0.1, 1.0), ConfigurationError);
  EXPECT_THROW(ButterworthBandPass(std::nan(""), 0.9), ConfigurationError);
}

TEST(SampleRate, IsNotMovedByMissingSamplesAndJitter) {
  std::vector<Time> stamps;
  for (int i = 0; i < 300; ++i) {
    if (i % 10 == 3) continue;
    stamps.push_back(fromNanoseconds(i * 10'000'000LL + (i * 7919) % 1000));
  }
  EXPECT_NEAR(estimateSampleRate(stamps), 100.0, 0.02);
  EXPECT_EQ(estimateSampleRate({}), 0.0);
  EXPECT_EQ(estimateSampleRate({fromNanoseconds(5)}), 0.0);
}

TEST(Verlet, IsExactForConstantAcceleration) {
  const Eigen::Vector3d a(1.0, -2.0, 0.5), v0(0.3, 0.1, -0.7);
  const double h = 0.01;
  const auto x = integrateVerlet(std::vector<Eigen::Vector3d>(500, a), h, v0);
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double t = h * static_cast<double>(i);
    EXPECT_LT((x[i] - (v0 * t + 0.5 * t * t * a)).norm(), 1e-9);
  }
}

TEST(Verlet, TimeCorrectedIsExactForConstantAccelerationAndUnevenSteps) {
  const Eigen::Vector3d a(1.0, -2.0, 0.5), v0(0.3, 0.1, -0.7);
  std::vector<double> t{0.0};
  for (int i = 0; i < 500; ++i) t.push_back(t.back() + 0.004 + 0.002 * (i * i % 7));
  const std::vector<Eigen::Vector3d> samples(t.size(), a);
  const auto x = integrateVerletTimeCorrected(t, samples, v0);
  VerletIntegrator integrator(Eigen::Vector3d::Zero(), v0, a);
  for (std::size_t i = 0; i < t.size(); ++i) {
    if (i > 0) integrator.advance(t[i] - t[i - 1], a);
    EXPECT_LT((x[i] - (v0 * t[i] + 0.5 * t[i] * t[i] * a)).norm(), 1e-9);
    EXPECT_LT((integrator.position() - x[i]).norm(), 1e-12);
    EXPECT_LT((integrator.velocity() - (v0 + a * t[i])).norm(), 1e-9);
  }
}

// x = sin(2 t): the error at t = 3 for n steps, even or uneven.
double sineError(int n, bool uneven) {
  std::vector<double> t;
  std::vector<Eigen::Vector3d> a;
  for (int i = 0; i <= n; ++i) {
    const double s = static_cast<double>(i) / n;
    t.push_back(3.0 * (uneven ? s + 0.1 * std::sin(2.0 * kPi * s) / (2.0 * kPi) : s));
    a.push_back(Eigen::Vector3d::Constant(-4.0 * std::sin(2.0 * t.back())));
  }
  const Eigen::Vector3d v0 = Eigen::Vector3d::Constant(2.0);
  const auto x = uneven ? integrateVerletTimeCorrected(t, a, v0) : integrateVerlet(a, 3.0 / n, v0);
  return std::abs(x.back().x() - std::sin(6.0));
}

TEST(Verlet, ConvergesWithSecondOrderOnASinusoid) {
  for (const bool uneven : {false, true}) {
    const double order = std::log2(sineError(400, uneven) / sineError(800, uneven));
    EXPECT_NEAR(order, 2.0, 0.15) << (uneven ? "uneven" : "even");
    EXPECT_LT(sineError(300, uneven), 1e-3);
  }
}

TEST(Verlet, RestartFromRestIsASubtractionOfVelocity) {
  VerletIntegrator whole(Eigen::Vector3d::Zero(), Eigen::Vector3d(0.1, 0.2, 0.3),
                         Eigen::Vector3d::Zero());
  const auto acceleration = [](int i) {
    return Eigen::Vector3d(std::sin(0.1 * i), std::cos(0.2 * i), 0.01 * i);
  };
  const auto step = [](int i) { return 0.008 + 0.001 * (i % 5); };
  for (int i = 1; i < 40; ++i) whole.advance(step(i), acceleration(i));
  const Eigen::Vector3d p = whole.position(), v = whole.velocity();
  VerletIntegrator part(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), whole.acceleration());
  double t = 0.0;
  for (int i = 40; i < 100; ++i) {
    whole.advance(step(i), acceleration(i));
    part.advance(step(i), acceleration(i));
    t += step(i);
  }
  EXPECT_LT((whole.position() - p - v * t - part.position()).norm(), 1e-12);
}

TEST(Verlet, RefusesBadSteps) {
  const std::vector<Eigen::Vector3d> a(3, Eigen::Vector3d::Zero());
  EXPECT_THROW(integrateVerlet(a, 0.0), ConfigurationError);
  EXPECT_THROW(integrateVerletTimeCorrected({0.0, 1.0}, a), ConfigurationError);
  EXPECT_THROW(integrateVerletTimeCorrected({0.0, 1.0, 1.0}, a), ConfigurationError);
  EXPECT_TRUE(integrateVerlet({}, 0.1).empty());
}

}  // namespace
}  // namespace scanner::inertial
