#include "stereo/validate.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "stereo/matcher.h"
#include "stereo/synthetic.h"

namespace scanner::stereo {
namespace {

using testing::sameBytes;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

cv::Mat row(const std::vector<float>& values) { return cv::Mat(values, true).reshape(1, 1); }

int countValid(const cv::Mat& disparity) { return cv::countNonZero(disparity == disparity); }

/// Terraces with holes and spikes.
cv::Mat patchwork(int width, int height, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  cv::Mat d(height, width, CV_32FC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::uint64_t bits = generator();
      float value =
          static_cast<float>(20 + 2 * (x / 9 + y / 7) % 11) + 0.1f * static_cast<float>(bits % 8);
      if (bits % 16 == 9) value += 3.0f;
      d.at<float>(y, x) = bits % 8 == 3 ? kNan : value;
    }
  }
  return d;
}

/// Flood fill.
std::size_t removeSmallSurfacesSimply(float max_step, std::size_t min_size, cv::Mat& disparity) {
  cv::Mat seen(disparity.size(), CV_8UC1, cv::Scalar(0));
  std::size_t removed = 0;
  const cv::Rect inside(0, 0, disparity.cols, disparity.rows);
  const std::array<cv::Point, 4> next{cv::Point(1, 0), {-1, 0}, {0, 1}, {0, -1}};
  const cv::Mat d = disparity.clone();
  for (int y = 0; y < d.rows; ++y) {
    for (int x = 0; x < d.cols; ++x) {
      if (std::isnan(d.at<float>(y, x)) || seen.at<std::uint8_t>(y, x) != 0) continue;
      std::vector<cv::Point> region{{x, y}};
      seen.at<std::uint8_t>(y, x) = 1;
      for (std::size_t i = 0; i < region.size(); ++i) {
        for (const cv::Point& by : next) {
          const cv::Point from = region[i], to = from + by;
          if (!inside.contains(to) || seen.at<std::uint8_t>(to) != 0) continue;
          if (!(std::abs(d.at<float>(to) - d.at<float>(from)) <= max_step)) continue;
          seen.at<std::uint8_t>(to) = 1;
          region.push_back(to);
        }
      }
      if (region.size() >= min_size) continue;
      removed += region.size();
      for (const cv::Point& p : region) disparity.at<float>(p) = kNan;
    }
  }
  return removed;
}

TEST(RemoveOutside, ChecksRangeMarginAndMasks) {
  //                 x: 0     1    2    3    4    5    6     7
  const cv::Mat all = row({0.4f, 1, 0, 4, 2, 9, kNan, 2.4f});
  cv::Mat d = all.clone();
  EXPECT_EQ(removeOutside(1, 8, 0, {}, {}, d), 4U);  // 0.4 and 0: range; 3-4 < 0; 9: range
  EXPECT_TRUE(std::isnan(d.at<float>(3)));
  EXPECT_EQ(d.at<float>(1), 1.0f);  // matches column 0
  d = all.clone();
  EXPECT_EQ(removeOutside(1, 8, 1, {}, {}, d), 5U);
  cv::Mat left(1, 8, CV_8UC1, cv::Scalar(255)), right = left.clone();
  left.at<std::uint8_t>(4) = 0;
  right.at<std::uint8_t>(5) = 0;  // 7 - 2.4 rounds to 5
  d = all.clone();
  EXPECT_EQ(removeOutside(1, 8, 0, left, right, d), 6U);
  EXPECT_EQ(countValid(d), 1);
}

TEST(RemoveInconsistent, WholePixelAndFractionalRightDisparity) {
  const cv::Mat all = row({0, 1, 2.2f, 2, 3.9f, kNan});
  const std::vector<short> whole{2, 1, kNoDisparity, 0, 0, 0};
  cv::Mat d = all.clone();
  // x 0: to column 0, 2 px off; 1: to 0, 1 px off; 2: to 0; 3: to 1; 4: to 0.
  EXPECT_EQ(removeInconsistent(cv::Mat(whole, true).reshape(1, 1), 1.0, d), 2U);
  EXPECT_TRUE(std::isnan(d.at<float>(0)));
  EXPECT_TRUE(std::isnan(d.at<float>(4)));
  const cv::Mat fraction = row({2.2f, kNan, 2, 0, 0, 0});
  d = all.clone();
  EXPECT_EQ(removeInconsistent(fraction, 1.0, d), 4U);
  EXPECT_EQ(d.at<float>(2), 2.2f);
  cv::Mat none = row({3, 3});
  EXPECT_EQ(removeInconsistent(cv::Mat(1, 2, CV_16SC1, cv::Scalar(kNoDisparity)), 10.0, none), 2U);
}

TEST(RemoveImprecise, SigmaAboveTheLimitOrUnknown) {
  cv::Mat d = row({1, 2, 3, kNan});
  EXPECT_EQ(removeImprecise(row({0.2f, 0.3f, kNan, 0.1f}), 0.25, d), 2U);
  EXPECT_EQ(countValid(d), 1);
}

TEST(RemoveSmallSurfaces, SmallOnesGoLargeOnesStay) {
  cv::Mat d(40, 60, CV_32FC1, cv::Scalar(kNan));
  d(cv::Rect(2, 2, 20, 10)).setTo(10.0f);   // 200 px
  d(cv::Rect(30, 2, 10, 10)).setTo(10.0f);  // 100 px
  d(cv::Rect(2, 20, 20, 9)).setTo(10.0f);   // 180 px, and a step of 2 px below it
  d(cv::Rect(2, 29, 20, 9)).setTo(12.0f);
  EXPECT_EQ(removeSmallSurfaces(1.0, 200, d), 100U + 180U + 180U);
  EXPECT_EQ(countValid(d), 200);
}

TEST(RemoveSmallSurfaces, AgreesWithAFloodFill) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    for (const int size : {2, 9, 40}) {
      // Several strips high, and a seam at the last row.
      const cv::Mat start = patchwork(83, 193, seed);
      cv::Mat expected = start.clone(), found = start.clone();
      const std::size_t removed =
          removeSmallSurfacesSimply(0.55f, static_cast<std::size_t>(size), expected);
      EXPECT_GT(removed, 0U);
      EXPECT_EQ(removeSmallSurfaces(static_cast<double>(0.55f), size, found, 2), removed);
      EXPECT_TRUE(sameBytes(expected, found)) << seed << " " << size;
    }
  }
}

TEST(RemoveSmallSurfaces, ASpiralAcrossAllStripsIsOneSurface) {
  cv::Mat d(200, 64, CV_32FC1, cv::Scalar(kNan));
  // A comb whose teeth meet at the very bottom only.
  for (int x = 0; x < 64; x += 2) d.col(x).setTo(5.0f);
  for (int x = 1; x < 64; x += 4) d.at<float>(199, x) = 5.0f;
  for (int x = 3; x < 64; x += 4) d.at<float>(0, x) = 5.0f;
  EXPECT_EQ(removeSmallSurfaces(0.0, countValid(d), d, 2), 0U);
  EXPECT_EQ(removeSmallSurfaces(0.0, countValid(d) + 1, d, 2), 32U * 200U + 32U);
}

TEST(Validation, SameBytesForAnyThreadCount) {
  const cv::Mat start = patchwork(120, 300, 9);
  cv::Mat right(start.size(), CV_16SC1, cv::Scalar(24));
  const auto run = [&](int threads) {
    cv::Mat d = start.clone();
    std::size_t removed = removeOutside(21, 38, 2, {}, {}, d, threads);
    removed += removeInconsistent(right, 6.0, d, threads);
    removed += removeImprecise(start, 36.0, d, threads);
    removed += removeSmallSurfaces(1.0, 12, d, threads);
    EXPECT_EQ(removed + static_cast<std::size_t>(countValid(d)),
              static_cast<std::size_t>(countValid(start)));
    return d;
  };
  const cv::Mat one = run(1);
  EXPECT_GT(countValid(one), 1000);
  for (const int threads : {2, 3, 7}) EXPECT_TRUE(sameBytes(one, run(threads))) << threads;
}

}  // namespace
}  // namespace scanner::stereo
