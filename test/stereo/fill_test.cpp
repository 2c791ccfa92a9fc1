#include "scanner/stereo/fill.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <opencv2/core.hpp>
#include <stdexcept>

namespace scanner::stereo {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

cv::Mat flatGuide(cv::Size size) { return cv::Mat(size, CV_8UC1, cv::Scalar(90)); }

/// Background at 10 px, foreground at 30 px from column 40 on.
cv::Mat step(cv::Size size) {
  cv::Mat disparity(size, CV_32FC1, cv::Scalar(10.0));
  disparity.colRange(40, size.width).setTo(30.0);
  return disparity;
}

int differing(const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(~(a == b)); }

TEST(Fill, HolesOfAFlatSurfaceTakeItsDisparity) {
  cv::Mat disparity(40, 60, CV_32FC1, cv::Scalar(12.5));
  const cv::Mat whole = disparity.clone();
  disparity(cv::Rect(20, 10, 15, 12)).setTo(kNan);
  disparity(cv::Rect(0, 0, 9, 40)).setTo(kNan);
  EXPECT_EQ(differing(fill(disparity, flatGuide(disparity.size()), 1), whole), 0);
}

TEST(Fill, WhatOneEyeAloneSeesLiesBehind) {
  const cv::Mat truth = step({80, 40});
  cv::Mat disparity = truth.clone();
  disparity.colRange(20, 40).setTo(kNan);  // as wide as the step
  cv::Mat guide = flatGuide(truth.size());
  guide.colRange(40, 80).setTo(200);
  EXPECT_EQ(differing(fill(disparity, guide, 1), truth), 0);
}

TEST(Fill, SlantedSurfacesGoOnIntoHoles) {
  cv::Mat truth(50, 120, CV_32FC1);
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      truth.at<float>(y, x) = 20.0F + 0.1F * static_cast<float>(x) + 0.03F * static_cast<float>(y);
    }
  }
  cv::Mat disparity = truth.clone();
  disparity.colRange(0, 20).setTo(kNan);
  disparity(cv::Rect(60, 10, 15, 30)).setTo(kNan);
  const cv::Mat filled = fill(disparity, flatGuide(truth.size()), 2);
  // The value at the end of the hole alone would be up to 2 px off.
  EXPECT_LT(cv::norm(filled, truth, cv::NORM_INF), 1.2);
  EXPECT_LT(cv::norm(filled.colRange(60, 75), truth.colRange(60, 75), cv::NORM_INF), 0.7);
}

/// Guesses do not outvote what was matched.
TEST(Fill, MatchedPixelsHaveMoreSay) {
  cv::Mat disparity(60, 80, CV_32FC1, cv::Scalar(10.0));
  disparity.colRange(40, 80).setTo(30.0);
  disparity.colRange(34, 40).setTo(kNan);  // filled with 10, though it looks like the right side
  cv::Mat guide = flatGuide(disparity.size());
  guide.colRange(34, 80).setTo(200);
  cv::Mat expected = disparity.clone();
  expected.colRange(34, 40).setTo(30.0);
  EXPECT_EQ(differing(fill(disparity, guide, 1), expected), 0);
}

TEST(Fill, AStepMovesToTheEdgeOfThePicture) {
  const cv::Mat truth = step({80, 40});
  cv::Mat disparity = truth.clone();
  disparity.colRange(36, 40).setTo(30.0);  // fattened by 4 px
  cv::Mat guide(truth.size(), CV_8UC3, cv::Scalar(40, 90, 60));
  guide.colRange(40, 80).setTo(cv::Scalar(200, 80, 30));
  EXPECT_GT(differing(disparity, truth), 100);
  EXPECT_EQ(differing(fill(disparity, guide, 1), truth), 0);
}

TEST(Fill, AnEmptyRowTakesTheNearestThatIsNot) {
  cv::Mat disparity(30, 20, CV_32FC1, cv::Scalar(kNan));
  disparity.row(10).setTo(7.0);
  const cv::Mat filled = fill(disparity, flatGuide(disparity.size()), 1);
  EXPECT_EQ(cv::countNonZero(filled == 7.0), 600);
}

TEST(Fill, OnePixelFillsThePicture) {
  cv::Mat disparity(12, 17, CV_32FC1, cv::Scalar(kNan));
  disparity.at<float>(5, 3) = 4.0F;
  EXPECT_EQ(cv::countNonZero(fill(disparity, flatGuide(disparity.size()), 1) == 4.0), 12 * 17);
}

TEST(Fill, NothingStaysNothing) {
  const cv::Mat disparity(12, 17, CV_32FC1, cv::Scalar(kNan));
  const cv::Mat filled = fill(disparity, flatGuide(disparity.size()), 1);
  EXPECT_EQ(cv::countNonZero(filled == filled), 0);
}

TEST(Fill, PixelsFarFromHolesAndStepsStay) {
  cv::Mat disparity(60, 90, CV_32FC1);
  for (int y = 0; y < disparity.rows; ++y) {
    for (int x = 0; x < disparity.cols; ++x) {
      disparity.at<float>(y, x) = 20.0F + 0.03F * static_cast<float>(x);
    }
  }
  EXPECT_EQ(differing(fill(disparity, flatGuide(disparity.size()), 1), disparity), 0);
}

TEST(Fill, SameBytesForEveryThreadCount) {
  cv::Mat disparity(70, 90, CV_32FC1), guide(70, 90, CV_8UC3);
  cv::RNG random(7);
  random.fill(disparity, cv::RNG::UNIFORM, 5.0, 40.0);
  random.fill(guide, cv::RNG::UNIFORM, 0, 255);
  disparity.setTo(kNan, disparity < 15.0);
  EXPECT_EQ(differing(fill(disparity, guide, 1), fill(disparity, guide, 3)), 0);
}

/// Guesses reach as far as is asked for, with a sigma that grows on the way; matches stay.
TEST(Interpolate, FillsWithinReachOnly) {
  cv::Mat disparity(40, 90, CV_32FC1, cv::Scalar(12.0));
  disparity.colRange(30, 60).setTo(kNan);
  cv::Mat sigma(disparity.size(), CV_32FC1, cv::Scalar(0.1));
  sigma.setTo(kNan, ~(disparity == disparity));
  InterpolationOptions options;
  options.reach_px = 10.0;
  options.sigma_px = 0.5;
  const std::size_t filled = interpolate(flatGuide(disparity.size()), options, 2, disparity, sigma);
  EXPECT_EQ(filled, 40U * 20U);
  for (int x = 0; x < 90; ++x) {
    const float d = disparity.at<float>(20, x), s = sigma.at<float>(20, x);
    if (x >= 40 && x < 50) {
      EXPECT_TRUE(std::isnan(d) && std::isnan(s)) << x;
      continue;
    }
    const int distance = x < 30 || x >= 60 ? 0 : std::min(x - 29, 60 - x);
    EXPECT_EQ(d, 12.0F) << x;
    EXPECT_NEAR(s, distance == 0 ? 0.1 : 0.5 * distance, 1e-4) << x;
  }
}

TEST(Interpolate, NothingStaysNothing) {
  cv::Mat disparity(20, 30, CV_32FC1, cv::Scalar(kNan)), sigma = disparity.clone();
  InterpolationOptions options;
  options.reach_px = 100.0;
  EXPECT_EQ(interpolate(flatGuide(disparity.size()), options, 1, disparity, sigma), 0U);
}

TEST(Fill, RefusesPicturesThatDoNotSuit) {
  const cv::Mat disparity(10, 10, CV_32FC1, cv::Scalar(1.0));
  EXPECT_THROW(fill(disparity, cv::Mat(9, 10, CV_8UC1), 1), std::invalid_argument);
  EXPECT_THROW(fill(cv::Mat(10, 10, CV_8UC1), flatGuide({10, 10}), 1), std::invalid_argument);
  EXPECT_THROW(fill(disparity, cv::Mat(10, 10, CV_32FC1), 1), std::invalid_argument);
}

}  // namespace
}  // namespace scanner::stereo
