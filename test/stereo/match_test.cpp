#include "scanner/stereo/match.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core/utility.hpp>
#include <vector>

#include "stereo/synthetic.h"
#include "stereo/validate.h"

namespace scanner::stereo {
namespace {

using testing::DisparityPlane;
using testing::makePair;
using testing::PairNoise;
using testing::sameBytes;

struct Errors {
  double median = NAN, rms = NAN, bias = NAN, worst = NAN, median_pull = NAN;
  double density = 0.0;  ///< of the pixels whose match is inside the right image
};

Errors compare(const DisparityImage& image, const DisparityPlane& truth, int margin = 12) {
  std::vector<double> errors, pulls;
  std::size_t possible = 0;
  Errors e;
  double squares = 0.0, sum = 0.0;
  e.worst = 0.0;
  for (int y = margin; y < image.disparity_px.rows - margin; ++y) {
    for (int x = margin; x < image.disparity_px.cols - margin; ++x) {
      const float d = image.disparity_px.at<float>(y, x);
      if (x - truth.at(x, y) > margin) ++possible;
      if (std::isnan(d)) continue;
      const double error = static_cast<double>(d) - truth.at(x, y);
      errors.push_back(std::abs(error));
      pulls.push_back(std::abs(error) / static_cast<double>(image.sigma_px.at<float>(y, x)));
      squares += error * error;
      sum += error;
      e.worst = std::max(e.worst, std::abs(error));
    }
  }
  if (errors.empty()) return e;
  const auto n = static_cast<double>(errors.size());
  const auto middle = static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::nth_element(errors.begin(), errors.begin() + middle, errors.end());
  std::nth_element(pulls.begin(), pulls.begin() + middle, pulls.end());
  e.median = errors[errors.size() / 2];
  e.median_pull = pulls[pulls.size() / 2];
  e.rms = std::sqrt(squares / n);
  e.bias = sum / n;
  e.density = n / static_cast<double>(possible);
  return e;
}

MatcherOptions optionsFor(int low, int high, MatchMethod method = MatchMethod::kBlock) {
  MatcherOptions o;
  o.method = method;
  o.min_disparity_px = low;
  o.max_disparity_px = high;
  return o;
}

class FractionalShift : public ::testing::TestWithParam<std::tuple<MatchMethod, double>> {};

TEST_P(FractionalShift, IsFoundToAFewHundredthsOfAPixel) {
  const auto [method, fraction] = GetParam();
  const DisparityPlane plane{20.0 + fraction, 0.0, 0.0};
  const Errors e =
      compare(match(makePair(200, 120, plane, {1.0}), optionsFor(10, 40, method), 2), plane);
  EXPECT_GT(e.density, 0.95);
  EXPECT_LT(e.median, 0.03);
  EXPECT_LT(e.rms, 0.05);
  EXPECT_LT(std::abs(e.bias), 0.01);  // no locking to whole pixels
}

INSTANTIATE_TEST_SUITE_P(AllFractions, FractionalShift,
                         ::testing::Combine(::testing::Values(MatchMethod::kBlock,
                                                              MatchMethod::kSemiGlobal),
                                            ::testing::Values(0.0, 0.125, 0.3, 0.5, 0.77)));

/// RMS error on a plane, by the way the fraction of a pixel is found.
double rmsWith(SubpixelRefinement refinement, const DisparityPlane& plane) {
  MatcherOptions o = optionsFor(5, 70);
  o.refinement.subpixel_refinement = refinement;
  return compare(match(makePair(240, 160, plane, {1.0}), o, 2), plane).rms;
}

TEST(Match, TheCostsFitBeatsWholePixels) {
  const DisparityPlane plane{24.0, 0.04, -0.03};
  const double whole = rmsWith(SubpixelRefinement::kNone, plane);
  EXPECT_LT(rmsWith(SubpixelRefinement::kCostFit, plane), 0.3 * whole);
  EXPECT_LT(rmsWith(SubpixelRefinement::kGradient, plane), 0.3 * whole);
  EXPECT_NEAR(whole, 1.0 / std::sqrt(12.0), 0.05);
}

TEST(Match, RefinementBeatsTheCostsFitOnSteepSurfaces) {
  const DisparityPlane plane{24.0, 0.12, -0.08};
  EXPECT_LT(rmsWith(SubpixelRefinement::kGradient, plane),
            0.5 * rmsWith(SubpixelRefinement::kCostFit, plane));
}

TEST(Match, SlantedPlaneIsNotBiased) {
  for (const double slope : {-0.15, 0.1, 0.2}) {
    const DisparityPlane plane{40.0, slope, 0.05};
    const Errors e = compare(match(makePair(260, 140, plane, {1.0}), optionsFor(2, 110), 2), plane);
    EXPECT_LT(e.median, 0.05) << slope;
    EXPECT_LT(std::abs(e.bias), 0.02) << slope;
    EXPECT_GT(e.density, 0.8) << slope;
  }
}

TEST(Match, LargeDisparitiesOfTheThesisRange) {
  const DisparityPlane plane{212.4, 0.02, 0.01};
  const Errors e = compare(match(makePair(640, 100, plane, {1.0}), MatcherOptions(), 2), plane);
  EXPECT_LT(e.median, 0.03);
  // Columns nearer to the left edge than max_disparity_px are matched as far as they can be.
  EXPECT_GT(e.density, 0.95);
}

TEST(Match, NothingWrongWhereTheMatchLiesOutsideTheRightImage) {
  const DisparityPlane plane{60.3, 0.0, 0.0};
  for (const MatchMethod method : {MatchMethod::kBlock, MatchMethod::kSemiGlobal}) {
    const DisparityImage image = match(makePair(240, 120, plane), optionsFor(10, 90, method), 1);
    int wrong = 0;
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 240; ++x) {
        const float d = image.disparity_px.at<float>(y, x);
        if (std::isnan(d)) continue;
        EXPECT_GE(static_cast<float>(x) - d, -0.5f);
        if (std::abs(static_cast<double>(d) - plane.d0) > 1.0) ++wrong;
      }
    }
    EXPECT_EQ(wrong, 0);
  }
}

TEST(Match, GainAndOffsetOfOneEyeDoNotShift) {
  const DisparityPlane plane{20.4, 0.02, 0.0};
  PairNoise noise{1.0, 0.85, 12.0};
  const Errors e = compare(match(makePair(200, 120, plane, noise), optionsFor(10, 40), 2), plane);
  EXPECT_LT(e.median, 0.03);
  EXPECT_LT(std::abs(e.bias), 0.01);
}

TEST(Match, SigmaFollowsTheNoise) {
  const DisparityPlane plane{20.4, 0.01, 0.0};
  MatcherOptions o = optionsFor(10, 40);
  o.refinement.floor_px = 0.0;
  o.validation.residual = false;
  const auto run = [&](double sigma) {
    return compare(match(makePair(260, 160, plane, {sigma}), o, 2), plane);
  };
  // A Gaussian's median is 0.67 sigma; the bounds leave a factor of three to either side.
  for (const double sigma : {2.0, 5.0, 10.0}) {
    const Errors e = run(sigma);
    EXPECT_GT(e.median_pull, 0.22) << sigma;
    EXPECT_LT(e.median_pull, 2.0) << sigma;
  }
}

TEST(Match, SameBytesForAnyThreadCount) {
  const RectifiedPair pair = makePair(240, 150, {30.2, 0.05, 0.02}, {3.0});
  const int before = cv::getNumThreads();
  for (const MatchMethod method : {MatchMethod::kBlock, MatchMethod::kSemiGlobal}) {
    const MatcherOptions o = optionsFor(10, 60, method);
    const DisparityImage two = match(pair, o, 2);
    EXPECT_TRUE(sameBytes(two.disparity_px, match(pair, o, 3).disparity_px));
    cv::setNumThreads(1);
    const DisparityImage one = match(pair, o, 1);
    cv::setNumThreads(before);
    EXPECT_TRUE(sameBytes(one.disparity_px, two.disparity_px));
    EXPECT_TRUE(sameBytes(one.sigma_px, two.sigma_px));
  }
  EXPECT_EQ(cv::getNumThreads(), before);
}

TEST(Match, UntexturedAndUnrelatedImagesGiveNothing) {
  RectifiedPair flat;
  flat.left_gray = cv::Mat(120, 200, CV_8UC1, cv::Scalar(90));
  flat.right_gray = flat.left_gray.clone();
  RectifiedPair unrelated = makePair(200, 120, {500.0, 0.0, 0.0});
  for (const MatchMethod method : {MatchMethod::kBlock, MatchMethod::kSemiGlobal}) {
    MatchStatistics statistics;
    match(flat, optionsFor(10, 40, method), 1, &statistics);
    EXPECT_EQ(statistics.valid, 0U);
    match(unrelated, optionsFor(10, 40, method), 1, &statistics);
    EXPECT_LT(statistics.valid, statistics.pixels / 100);
  }
}

TEST(Match, EveryValidationCanBeSwitchedOff) {
  // Half plane, half noise without a counterpart.
  RectifiedPair pair = makePair(240, 120, {20.0, 0.0, 0.0});
  const RectifiedPair other = makePair(240, 120, {531.0, 0.0, 0.0});
  other.right_gray.rowRange(60, 120).copyTo(pair.right_gray.rowRange(60, 120));
  const auto valid = [&](const MatcherOptions& o) {
    MatchStatistics s;
    match(pair, o, 1, &s);
    return s;
  };
  const MatcherOptions all = optionsFor(10, 40);
  const MatchStatistics strict = valid(all);
  MatcherOptions o = all;
  o.validation.uniqueness = false;
  EXPECT_GT(valid(o).matched, strict.matched);
  o.validation.back_and_forth = false;
  EXPECT_EQ(valid(o).back_and_forth, 0U);
  o.validation.residual = o.validation.precision = o.validation.surface = false;
  o.validation.texture = false;
  const MatchStatistics loose = valid(o);
  EXPECT_EQ(loose.surface, 0U);
  EXPECT_EQ(loose.precision, 0U);
  EXPECT_GT(loose.valid, strict.valid + 1000);
}

TEST(Match, MasksHideWhatIsNotInTheRawImage) {
  RectifiedPair pair = makePair(200, 120, {20.0, 0.0, 0.0});
  pair.left_valid = cv::Mat(120, 200, CV_8UC1, cv::Scalar(255));
  pair.left_valid.rowRange(0, 40).setTo(0);
  pair.right_valid = cv::Mat(120, 200, CV_8UC1, cv::Scalar(255));
  pair.right_valid.rowRange(80, 120).setTo(0);
  const DisparityImage image = match(pair, optionsFor(10, 40), 1);
  EXPECT_EQ(cv::countNonZero(image.disparity_px.rowRange(0, 40) > 0), 0);
  EXPECT_EQ(cv::countNonZero(image.disparity_px.rowRange(80, 120) > 0), 0);
  EXPECT_GT(cv::countNonZero(image.disparity_px.rowRange(44, 76) > 0), 4000);
}

/// Guesses fill what no test let through, but nothing that the raw image does not show.
TEST(Match, InterpolationFillsWhatIsLeft) {
  RectifiedPair pair = makePair(200, 120, {20.0, 0.0, 0.0});
  pair.left_valid = cv::Mat(120, 200, CV_8UC1, cv::Scalar(255));
  pair.left_valid.rowRange(0, 40).setTo(0);
  MatcherOptions options = optionsFor(10, 40);
  const DisparityImage plain = match(pair, options, 1);
  options.interpolation.reach_px = 1000.0;
  const DisparityImage dense = match(pair, options, 2);
  EXPECT_EQ(cv::countNonZero(dense.disparity_px.rowRange(0, 40) > 0), 0);
  EXPECT_EQ(cv::countNonZero(dense.disparity_px.rowRange(40, 120) > 0), 80 * 200);
  const cv::Mat matched = plain.disparity_px == plain.disparity_px;
  EXPECT_EQ(cv::countNonZero((dense.disparity_px == plain.disparity_px) & matched),
            cv::countNonZero(matched));
  EXPECT_EQ(cv::countNonZero((dense.sigma_px >= 1.0) & ~matched),
            80 * 200 - cv::countNonZero(matched));
}

TEST(Match, RefusesWhatCannotBeSearched) {
  const RectifiedPair pair = makePair(100, 60, {20.0, 0.0, 0.0});
  EXPECT_THROW(match(pair, optionsFor(10, 100), 1), ConfigurationError);
  EXPECT_THROW(match(pair, optionsFor(40, 40), 1), ConfigurationError);
  EXPECT_THROW(match(makePair(100, 9, {20.0, 0.0, 0.0}), optionsFor(10, 40), 1),
               ConfigurationError);
  RectifiedPair uneven = pair;
  uneven.right_gray = uneven.right_gray.colRange(0, 90).clone();
  EXPECT_THROW(match(uneven, optionsFor(10, 40), 1), std::invalid_argument);
}

TEST(Validation, SmallSurfacesGoLargeOnesStay) {
  cv::Mat d(40, 60, CV_32FC1, cv::Scalar(NAN));
  d(cv::Rect(2, 2, 20, 10)).setTo(10.0f);   // 200 px
  d(cv::Rect(30, 2, 10, 10)).setTo(10.0f);  // 100 px
  d(cv::Rect(2, 20, 20, 9)).setTo(10.0f);   // 180 px, and a step of 2 px below it
  d(cv::Rect(2, 29, 20, 9)).setTo(12.0f);
  EXPECT_EQ(removeSmallSurfaces(1.0, 200, d), 100U + 180U + 180U);
  EXPECT_EQ(cv::countNonZero(d > 0), 200);
  // A ramp of 1 px a column is one surface.
  cv::Mat ramp(10, 30, CV_32FC1);
  for (int x = 0; x < 30; ++x) ramp.col(x).setTo(static_cast<float>(x));
  EXPECT_EQ(removeSmallSurfaces(1.0, 200, ramp), 0U);
}

}  // namespace
}  // namespace scanner::stereo
