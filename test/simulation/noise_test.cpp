#include "scanner/simulation/noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "scanner/simulation/random.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3f;

Vector3f randomPoint(Random* random, double half) {
  const auto coordinate = [&] { return static_cast<float>(random->uniform(-half, half)); };
  const float x = coordinate(), y = coordinate(), z = coordinate();
  return {x, y, z};
}

struct Moments {
  double mean = 0.0, sigma = 0.0, largest = 0.0;
};

template <typename Function>
Moments momentsOf(Function&& noise, double half) {
  constexpr int kSamples = 100000;
  Random random(11);
  double sum = 0.0, squares = 0.0;
  Moments m;
  for (int i = 0; i < kSamples; ++i) {
    const double v = static_cast<double>(noise(randomPoint(&random, half)));
    sum += v;
    squares += v * v;
    m.largest = std::max(m.largest, std::abs(v));
  }
  m.mean = sum / kSamples;
  m.sigma = std::sqrt(squares / kSamples - m.mean * m.mean);
  return m;
}

TEST(NoiseTest, HashIsUniformAndDependsOnEverything) {
  double sum = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const float h = hashUnit(i % 27 - 13, i / 27 % 27 - 13, i / 729 - 13, 5);
    ASSERT_GE(h, 0.0F);
    ASSERT_LT(h, 1.0F);
    sum += static_cast<double>(h);
  }
  EXPECT_NEAR(sum / 20000.0, 0.5, 0.01);
  const float h = hashUnit(1, 2, 3, 4);
  EXPECT_NE(h, hashUnit(2, 1, 3, 4));
  EXPECT_NE(h, hashUnit(1, 2, -3, 4));
  EXPECT_NE(h, hashUnit(1, 2, 3, 5));
}

TEST(NoiseTest, GradientNoiseIsBoundedWithZeroMean) {
  const Moments m = momentsOf([](const Vector3f& p) { return gradientNoise(p, 3); }, 40.0);
  EXPECT_NEAR(m.mean, 0.0, 0.005);
  EXPECT_GT(m.sigma, 0.2);
  EXPECT_LT(m.largest, 1.1);
}

TEST(NoiseTest, GradientNoiseIsContinuousAcrossCells) {
  Random random(12);
  for (int i = 0; i < 1000; ++i) {
    Vector3f p = randomPoint(&random, 20.0);
    p[i % 3] = std::round(p[i % 3]);
    Vector3f before = p, after = p;
    before[i % 3] -= 1e-4F;
    after[i % 3] += 1e-4F;
    EXPECT_NEAR(gradientNoise(before, 7), gradientNoise(after, 7), 1e-3F);
  }
}

TEST(NoiseTest, GradientIsTheDerivative) {
  Random random(13);
  constexpr float kStep = 0.004F;
  for (int i = 0; i < 500; ++i) {
    const Vector3f p = randomPoint(&random, 5.0);
    Vector3f gradient;
    EXPECT_NEAR(gradientNoise(p, 9, &gradient), gradientNoise(p, 9), 1e-6F);
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3f step = kStep * Vector3f::Unit(axis);
      const float slope =
          (gradientNoise(p + step, 9) - gradientNoise(p - step, 9)) / (2.0F * kStep);
      EXPECT_NEAR(gradient[axis], slope, 2e-3F);
    }
  }
}

TEST(NoiseTest, FractalNoiseFadesWithTheFootprint) {
  const auto sigmaAt = [](float footprint_m) {
    return momentsOf(
               [=](const Vector3f& p) {
                 return fractalNoise(p, 0.016F, 0.001F, 0.8F, footprint_m, 21);
               },
               1.0)
        .sigma;
  };
  const double full = sigmaAt(0.0F);
  EXPECT_GT(full, 0.08);
  // Nothing is lost while the finest octave has two pixels; everything below the longest wave.
  EXPECT_DOUBLE_EQ(sigmaAt(0.0005F), full);
  double before = full;
  for (const float footprint : {0.0008F, 0.0016F, 0.004F, 0.008F, 0.012F}) {
    const double sigma = sigmaAt(footprint);
    EXPECT_LT(sigma, before) << footprint;
    before = sigma;
  }
  EXPECT_EQ(sigmaAt(0.016F), 0.0);
}

TEST(NoiseTest, FractalNoiseStaysInBounds) {
  const Moments m = momentsOf(
      [](const Vector3f& p) { return fractalNoise(p, 0.1F, 0.001F, 0.9F, 0.0F, 2); }, 1.0);
  EXPECT_NEAR(m.mean, 0.0, 0.01);
  EXPECT_LT(m.largest, 1.0);
}

/// The skipping of far cells must not miss a feature point: against all cells of a 5x5x5 block the
/// nearest can only be nearer.
TEST(NoiseTest, CellularNoiseIsAContinuousDistance) {
  Random random(14);
  for (int i = 0; i < 2000; ++i) {
    const Vector3f p = randomPoint(&random, 0.3);
    const Cell cell = cellularNoise(p, 0.01F, 17);
    EXPECT_LE(cell.nearest, cell.second);
    EXPECT_LT(cell.nearest, 1.6F);
    EXPECT_GE(cell.id, 0.0F);
    EXPECT_LT(cell.id, 1.0F);
    // A distance changes by at most the way gone.
    const Vector3f q = p + Vector3f(1e-5F, -2e-5F, 1e-5F);
    const Cell moved = cellularNoise(q, 0.01F, 17);
    EXPECT_NEAR(moved.nearest, cell.nearest, 2.6e-3F);
    EXPECT_NEAR(moved.second, cell.second, 2.6e-3F);
  }
}

}  // namespace
}  // namespace scanner::simulation
