#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "scanner/evaluation/stereo_evaluation.h"

namespace scanner::evaluation {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

cv::Mat row(std::initializer_list<float> values) {
  return cv::Mat(std::vector<float>(values)).reshape(1, 1).clone();
}
cv::Mat mask(std::initializer_list<int> values) {
  cv::Mat out(1, static_cast<int>(values.size()), CV_8UC1);
  std::transform(values.begin(), values.end(), out.begin<std::uint8_t>(),
                 [](int v) { return static_cast<std::uint8_t>(v); });
  return out;
}
cv::Mat everywhere(const cv::Mat& map) { return {map.size(), CV_8UC1, cv::Scalar(255)}; }

TEST(StereoMeasures, KnownErrorsGiveKnownShares) {
  const cv::Mat truth = row({10, 10, 10, 10, 10, 10, 10, 10});
  // Errors 0, 0.6, -0.8, 1.5, 3, -5, two without disparity.
  const cv::Mat disparity = row({10, 10.6F, 9.2F, 11.5F, 13, 5, kNone, kNone});
  const cv::Mat filled = row({10, 10.6F, 9.2F, 11.5F, 13, 5, 10, kNone});
  const auto m = measureDisparity(truth, everywhere(truth), disparity, filled);
  EXPECT_EQ(m.pixels, 8U);
  EXPECT_EQ(m.valid, 6U);
  EXPECT_DOUBLE_EQ(m.density, 0.75);
  const BadShares valid{5.0 / 6, 3.0 / 6, 2.0 / 6, 1.0 / 6};
  const BadShares all{7.0 / 8, 5.0 / 8, 4.0 / 8, 3.0 / 8};
  const BadShares after{6.0 / 8, 4.0 / 8, 3.0 / 8, 2.0 / 8};
  for (std::size_t i = 0; i < kBadThresholds.size(); ++i) {
    EXPECT_DOUBLE_EQ(m.bad_valid[i], valid[i]) << kBadThresholds[i];
    EXPECT_DOUBLE_EQ(m.bad_all[i], all[i]) << kBadThresholds[i];
    EXPECT_DOUBLE_EQ(m.bad_filled[i], after[i]) << kBadThresholds[i];
  }
  EXPECT_NEAR(m.inlier_rms_px, std::sqrt((0.36 + 0.64) / 3.0), 1e-6);
  EXPECT_NEAR(m.median_px, 0.5 * (0.8 + 1.5), 1e-6);
}

TEST(StereoMeasures, OnlyTheRegionAndKnownTruthCount) {
  const cv::Mat truth = row({4, kNone, 4, 4});
  const cv::Mat disparity = row({4, 90, 4, 90});
  const auto m = measureDisparity(truth, mask({255, 255, 255, 0}), disparity, {});
  EXPECT_EQ(m.pixels, 2U);
  EXPECT_DOUBLE_EQ(m.bad_valid[1], 0.0);
  EXPECT_TRUE(std::isnan(m.bad_filled[1]));
}

TEST(StereoMeasures, AnErrorOfTheThresholdIsNotBadWhateverTheRounding) {
  // 10 / 3 in float, one pixel away.
  const float third = 10.0F / 3.0F;
  const cv::Mat truth = row({third, third, third});
  const cv::Mat disparity = row({third + 1.0F, third - 1.0F, third + 1.001F});
  const auto m = measureDisparity(truth, everywhere(truth), disparity, {});
  EXPECT_DOUBLE_EQ(m.bad_valid[1], 1.0 / 3.0);
}

TEST(StereoMeasures, NothingGivesNoFigures) {
  const cv::Mat truth = row({1, 2});
  const auto nothing = measureDisparity(truth, everywhere(truth), row({kNone, kNone}), {});
  EXPECT_DOUBLE_EQ(nothing.density, 0.0);
  EXPECT_TRUE(std::isnan(nothing.bad_valid[0]));
  EXPECT_DOUBLE_EQ(nothing.bad_all[0], 1.0);
  EXPECT_TRUE(std::isnan(nothing.inlier_rms_px));
  EXPECT_TRUE(std::isnan(nothing.median_px));
  const auto empty = measureDisparity(truth, mask({0, 0}), truth, {});
  EXPECT_TRUE(std::isnan(empty.density));
}

TEST(StereoMeasures, MapsThatDoNotFitAreRefused) {
  const cv::Mat truth = row({1, 2});
  EXPECT_THROW(measureDisparity(truth, everywhere(truth), row({1, 2, 3}), {}),
               std::invalid_argument);
  EXPECT_THROW(measureDisparity(truth, truth, truth, {}), std::invalid_argument);
  EXPECT_THROW(badShareOfBest(truth, everywhere(truth), truth, {}, 1, 1.0), std::invalid_argument);
}

TEST(StereoMeasures, MeanLeavesUnknownsOutAndWeighsScenesAlike) {
  RegionMeasures a, b;
  a.pixels = 10, a.valid = 5, a.density = 0.5, a.bad_valid[1] = 0.1;
  b.pixels = 1000, b.density = 0.0;
  b.bad_valid[1] = std::numeric_limits<double>::quiet_NaN();
  const auto mean = meanMeasures({a, b});
  EXPECT_EQ(mean.pixels, 1010U);
  EXPECT_DOUBLE_EQ(mean.density, 0.25);
  EXPECT_DOUBLE_EQ(mean.bad_valid[1], 0.1);
  EXPECT_TRUE(std::isnan(mean.median_px));
}

TEST(StereoMeasures, BestBySigmaTiesByPlace) {
  const cv::Mat truth = row({5, 5, 5, 5, 5});
  const cv::Mat disparity = row({9, 5, 9, 5, kNone});
  const cv::Mat sigma = row({0.1F, 0.2F, 0.2F, 0.1F, 0.0F});
  const auto share = [&](std::size_t count) {
    return badShareOfBest(truth, everywhere(truth), disparity, sigma, count, 1.0);
  };
  EXPECT_DOUBLE_EQ(share(1), 1.0);        // pixel 0
  EXPECT_DOUBLE_EQ(share(2), 0.5);        // and 3
  EXPECT_DOUBLE_EQ(share(3), 1.0 / 3.0);  // and 1
  EXPECT_DOUBLE_EQ(share(4), 0.5);        // and 2
  EXPECT_TRUE(std::isnan(share(5)));      // there are four only
  EXPECT_TRUE(std::isnan(share(0)));
}

TEST(StereoRegions, WhatIsBehindASquareIsHiddenBesideIt) {
  // Background 2 px, a square of 6 px from column 10 to 14. The right eye sees it at 4..8, and does
  // not see background that would lie there: left columns 6..9 (2 px further: 6 - 2 = 4 ... 8).
  cv::Mat truth(1, 24, CV_32FC1, cv::Scalar(2.0));
  truth.colRange(10, 15).setTo(6.0);
  const cv::Mat seen = nonOccluded(truth, {});
  for (int x = 0; x < truth.cols; ++x) {
    const bool hidden = x < 2 || (x >= 6 && x < 10);
    EXPECT_EQ(seen.at<std::uint8_t>(0, x), hidden ? 0 : 255) << x;
  }
}

TEST(StereoRegions, TheRightTruthConfirmsOrNot) {
  const cv::Mat truth = row({1, 1, 1.5F, 1, kNone, 1.5F});
  const cv::Mat right = row({1, 7, kNone, 9, 1, 2});
  const cv::Mat seen = nonOccluded(truth, right);
  EXPECT_EQ(seen.at<std::uint8_t>(0, 0), 0);    // outside
  EXPECT_EQ(seen.at<std::uint8_t>(0, 1), 255);  // right says 1 too
  EXPECT_EQ(seen.at<std::uint8_t>(0, 2), 255);  // one of the two columns beside 0.5 says so
  EXPECT_EQ(seen.at<std::uint8_t>(0, 3), 0);    // right does not know
  EXPECT_EQ(seen.at<std::uint8_t>(0, 4), 0);    // not known
  EXPECT_EQ(seen.at<std::uint8_t>(0, 5), 255);  // beside 3.5 something nearer, and 1
}

TEST(StereoRegions, BandRoundStepsAndOccludedPixels) {
  cv::Mat truth(20, 40, CV_32FC1, cv::Scalar(3.0));
  truth.colRange(20, 40).setTo(5.0);  // a step of exactly the gap, between columns 19 and 20
  const cv::Mat none = cv::Mat::zeros(truth.size(), CV_8UC1);
  const cv::Mat band = nearDepthSteps(truth, none, 2.0, 9);
  EXPECT_EQ(cv::countNonZero(band), 20 * 10);
  EXPECT_EQ(cv::countNonZero(band.colRange(15, 25)), 20 * 10);
  EXPECT_EQ(cv::countNonZero(nearDepthSteps(truth, none, 2.1, 9)), 0);
  cv::Mat occluded = none.clone();
  occluded.at<std::uint8_t>(10, 5) = 255;
  EXPECT_EQ(cv::countNonZero(nearDepthSteps(truth, occluded, 2.1, 9)), 81);
  truth.colRange(20, 40).setTo(kNone);  // the rim of the unknown is no step
  EXPECT_EQ(cv::countNonZero(nearDepthSteps(truth, none, 2.0, 9)), 0);
}

}  // namespace
}  // namespace scanner::evaluation
