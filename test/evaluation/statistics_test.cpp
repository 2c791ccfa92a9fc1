#include "scanner/evaluation/statistics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace scanner::evaluation {
namespace {

TEST(Statistics, FollowsTheClosedForms) {
  std::vector<double> x;
  for (int i = 100; i >= 1; --i) x.push_back(i);
  const Statistics s = summarize(x);
  EXPECT_EQ(s.count, 100u);
  EXPECT_DOUBLE_EQ(s.median, 50.5);
  EXPECT_DOUBLE_EQ(s.mean, 50.5);
  EXPECT_NEAR(s.sigma, std::sqrt(100.0 * 101.0 / 12.0), 1e-12);  // n (n + 1) / 12, n - 1 below
  EXPECT_EQ(s.min, 1.0);
  EXPECT_EQ(s.max, 100.0);
}

TEST(Statistics, OddCountHasAMiddle) {
  EXPECT_EQ(summarize(std::vector<double>{9.0, -1.0, 2.0}).median, 2.0);
}

TEST(Statistics, OneSampleHasNoSpreadAndNoneIsUnknown) {
  const Statistics one = summarize(std::vector<double>{3.0});
  EXPECT_EQ(one.sigma, 0.0);
  EXPECT_EQ(one.median, 3.0);
  const Statistics none = summarize(std::vector<double>{});
  EXPECT_EQ(none.count, 0u);
  EXPECT_TRUE(std::isnan(none.mean) && std::isnan(none.median) && std::isnan(none.sigma));
}

TEST(Statistics, LeavesOutWhatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const Statistics s = summarize(std::vector<double>{1.0, nan, 3.0, infinity});
  EXPECT_EQ(s.count, 2u);
  EXPECT_EQ(s.mean, 2.0);
}

TEST(Statistics, DoesNotDependOnTheOrder) {
  std::vector<double> x{0.1, 1e9, -3.7, 2.2, 1e-9, 5.5};
  const Statistics a = summarize(x);
  std::reverse(x.begin(), x.end());
  const Statistics b = summarize(x);
  EXPECT_EQ(a.mean, b.mean);
  EXPECT_EQ(a.sigma, b.sigma);
}

}  // namespace
}  // namespace scanner::evaluation
