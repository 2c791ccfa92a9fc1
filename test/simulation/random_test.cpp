#include "scanner/simulation/random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <set>

namespace scanner::simulation {
namespace {

TEST(RandomTest, BitsAreThoseOfTheStandard) {
  // The 10000th number of mt19937_64 with its default seed, as the C++ standard demands.
  Random random(5489U);
  for (int i = 1; i < 10000; ++i) random.bits();
  EXPECT_EQ(random.bits(), 9981545732273789042ULL);
}

TEST(RandomTest, UniformStaysInsideAndHasItsMoments) {
  Random random(1);
  constexpr int kCount = 100000;
  double sum = 0.0;
  double square = 0.0;
  for (int i = 0; i < kCount; ++i) {
    const double u = random.uniform(-2.0, 4.0);
    ASSERT_GE(u, -2.0);
    ASSERT_LT(u, 4.0);
    sum += u;
    square += u * u;
  }
  EXPECT_NEAR(sum / kCount, 1.0, 0.03);
  EXPECT_NEAR(square / kCount - 1.0, 3.0, 0.1);
}

TEST(RandomTest, NormalHasItsMoments) {
  Random random(2);
  constexpr int kCount = 200000;
  double sum = 0.0;
  double square = 0.0;
  double fourth = 0.0;
  double neighbours = 0.0;
  double last = 0.0;
  for (int i = 0; i < kCount; ++i) {
    const double x = random.normal();
    ASSERT_TRUE(std::isfinite(x));
    sum += x;
    square += x * x;
    fourth += x * x * x * x;
    neighbours += x * last;
    last = x;
  }
  EXPECT_NEAR(sum / kCount, 0.0, 0.01);
  EXPECT_NEAR(square / kCount, 1.0, 0.015);
  EXPECT_NEAR(fourth / kCount, 3.0, 0.15);
  EXPECT_NEAR(neighbours / kCount, 0.0, 0.01);
}

TEST(RandomTest, StreamsOfOneSeedDiffer) {
  std::set<std::uint64_t> seeds;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    for (std::uint64_t stream = 0; stream < 50; ++stream) seeds.insert(mixSeed(seed, stream));
  }
  EXPECT_EQ(seeds.size(), 2500U);
  EXPECT_EQ(mixSeed(7, 3), mixSeed(7, 3));
}

}  // namespace
}  // namespace scanner::simulation
