#include "stereo/refine.h"

#include <gtest/gtest.h>

#include <hwy/highway.h>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "stereo/refine_reference.h"
#include "stereo/synthetic.h"

namespace scanner::stereo {
namespace {

using testing::makeScene;
using testing::Reference;
using testing::sameBytes;
using testing::Scene;
using testing::texture;

constexpr double kKeepAll = std::numeric_limits<double>::infinity();
struct Refined {
  cv::Mat disparity, sigma;
  std::size_t given_up = 0;
};

Refined refine(const Scene& scene, const RefinementOptions& options = {},
               double max_residual_share = kKeepAll, int threads = 1) {
  Refined out;
  out.disparity = scene.start.clone();
  out.given_up = refineByGradient(scene.left, scene.right, {}, options, max_residual_share, threads,
                                  out.disparity, out.sigma);
  return out;
}

struct Errors {
  double rms = 0.0, bias = 0.0, predicted = 0.0;
  double density = 0.0;  ///< of the pixels whose match is inside
};

/// Where the match and the windows are inside the images.
Errors compare(const Scene& scene, const Refined& refined, int margin = 12) {
  Errors e;
  double n = 0.0, possible = 0.0;
  for (int y = margin; y < scene.truth.rows - margin; ++y) {
    for (int x = margin; x < scene.truth.cols - margin; ++x) {
      const double truth = static_cast<double>(scene.truth.at<float>(y, x));
      if (x - truth < margin) continue;
      possible += 1.0;
      if (std::isnan(refined.disparity.at<float>(y, x))) continue;
      const double error = static_cast<double>(refined.disparity.at<float>(y, x)) - truth;
      const double sigma = static_cast<double>(refined.sigma.at<float>(y, x));
      e.rms += error * error;
      e.bias += error;
      e.predicted += sigma * sigma;
      n += 1.0;
    }
  }
  e.density = n / possible;
  e.rms = std::sqrt(e.rms / n);
  e.predicted = std::sqrt(e.predicted / n);
  e.bias /= n;
  return e;
}

TEST(Refine, FollowsPlanesOfManySlants) {
  for (const double a : {-0.3, -0.1, 0.0, 0.15, 0.3}) {
    for (const double b : {-0.25, 0.0, 0.4}) {
      const Scene scene = makeScene(
          160, 80, [&](double x, double y) { return 30.3 + a * (x - 80) + b * (y - 40); });
      const Errors e = compare(scene, refine(scene));
      EXPECT_GT(e.density, 0.99) << a << " " << b;
      EXPECT_LT(e.rms, 0.015) << a << " " << b;
      EXPECT_LT(std::abs(e.bias), 0.006) << a << " " << b;
    }
  }
}

TEST(Refine, FollowsASphere) {
  // Radius 150 px, as deep as 75 px of disparity.
  const Scene scene = makeScene(240, 140, [](double x, double y) {
    const double r2 = (x - 130) * (x - 130) + (y - 70) * (y - 70);
    return 0.5 * std::sqrt(150.0 * 150.0 - r2) - 40.0;
  });
  const Errors e = compare(scene, refine(scene));
  EXPECT_GT(e.density, 0.99);
  EXPECT_LT(e.rms, 0.02);
  EXPECT_LT(std::abs(e.bias), 0.01);  // averages lie inside a curved surface
}

TEST(Refine, DoesNotLockToWholePixels) {
  const Scene scene = makeScene(
      420, 260, [](double x, double) { return 20.0 + 0.021 * x; }, 1.0);
  const Refined refined = refine(scene);
  std::array<double, 10> error{}, count{}, found{};
  for (int y = 10; y < 250; ++y) {
    for (int x = 45; x < 400; ++x) {
      const double truth = static_cast<double>(scene.truth.at<float>(y, x));
      const double d = static_cast<double>(refined.disparity.at<float>(y, x));
      const auto bin = static_cast<std::size_t>(10.0 * (truth - std::floor(truth)));
      error[bin] += d - truth;
      ++count[bin];
      ++found[static_cast<std::size_t>(10.0 * (d - std::floor(d))) % 10];
    }
  }
  for (std::size_t bin = 0; bin < 10; ++bin) {
    EXPECT_LT(std::abs(error[bin] / count[bin]), 0.015) << bin;  // the start: 0.08
    EXPECT_NEAR(found[bin] / count[bin], 1.0, 0.15) << bin;
  }
}

TEST(Refine, SigmaFollowsTheErrorThatImageNoiseMakes) {
  RefinementOptions options;
  options.floor_px = 0.0;
  std::vector<double> ratios;
  for (const double noise : {1.0, 2.0, 4.0}) {
    const Scene scene = makeScene(
        260, 160, [](double x, double y) { return 24.4 + 0.03 * x - 0.02 * y; }, noise);
    const Errors e = compare(scene, refine(scene, options));
    ratios.push_back(e.rms / e.predicted);
    // The gains are those of surfaces with some shape; on a plane they are on the safe side.
    EXPECT_GT(ratios.back(), 0.65) << noise;
    EXPECT_LT(ratios.back(), 0.95) << noise;
  }
  EXPECT_NEAR(ratios[2] / ratios[0], 1.0, 0.15);
}

TEST(Refine, GainAndOffsetOfOneEyeDoNotMatter) {
  Scene scene = makeScene(160, 80, [](double x, double y) { return 25.0 + 0.05 * x + 0.02 * y; });
  scene.right = 0.8f * scene.right + 15.0f;
  const Errors e = compare(scene, refine(scene));
  EXPECT_GT(e.density, 0.99);
  EXPECT_LT(e.rms, 0.02);
  EXPECT_LT(std::abs(e.bias), 0.006);
}

TEST(Refine, AgreesWithThePlainFormula) {
  Scene scene = makeScene(
      101, 53, [](double x, double y) { return 14.2 + 0.04 * x + 0.1 * y; }, 2.0);
  scene.start(cv::Rect(40, 10, 9, 14)).setTo(std::numeric_limits<float>::quiet_NaN());
  for (const int window : {5, 9}) {
    RefinementOptions options;
    options.window_px = window;
    options.max_correction_px = 5.0;
    cv::Mat disparity, sigma;
    Reference(scene, options).run(disparity, sigma);
    const Refined refined = refine(scene, options);
    int compared = 0;
    for (int y = 0; y < disparity.rows; ++y) {
      for (int x = 0; x < disparity.cols; ++x) {
        const double d = disparity.at<double>(y, x);
        ASSERT_EQ(std::isnan(refined.disparity.at<float>(y, x)), std::isnan(d)) << x << " " << y;
        if (std::isnan(d)) continue;
        EXPECT_NEAR(static_cast<double>(refined.disparity.at<float>(y, x)), d, 2e-3);
        EXPECT_NEAR(static_cast<double>(refined.sigma.at<float>(y, x)), sigma.at<double>(y, x),
                    2e-3);
        ++compared;
      }
    }
    EXPECT_GT(compared, 3000);
  }
}

TEST(Refine, SameBytesForEveryInstructionSetAndThreadCount) {
  // Odd width: no vector length divides it. More rows than a chunk has.
  Scene scene = makeScene(
      173, 131, [](double x, double y) { return 22.2 + 0.04 * x + 0.03 * y; }, 3.0);
  scene.start(cv::Rect(60, 40, 31, 22)).setTo(std::numeric_limits<float>::quiet_NaN());
  const Refined expected = refine(scene, {}, 0.1, 1);
  for (const int threads : {2, 3, 5}) {
    const Refined other = refine(scene, {}, 0.1, threads);
    EXPECT_TRUE(sameBytes(expected.disparity, other.disparity)) << threads;
    EXPECT_TRUE(sameBytes(expected.sigma, other.sigma)) << threads;
    EXPECT_EQ(expected.given_up, other.given_up);
  }
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    const Refined other = refine(scene, {}, 0.1, 2);
    EXPECT_TRUE(sameBytes(expected.disparity, other.disparity)) << hwy::TargetName(target);
    EXPECT_TRUE(sameBytes(expected.sigma, other.sigma)) << hwy::TargetName(target);
  }
  hwy::SetSupportedTargetsForTest(0);
}

TEST(Refine, GivesUpTheRimOfWrongDepthRoundASurfaceInFront) {
  // Two layers; the start carries the front one's depth 5 px beyond its edge, as a block does.
  const int width = 220, height = 120;
  const double back = 20.3, front = 35.7;
  const cv::Rect square(90, 30, 60, 60), fat(85, 25, 70, 70);
  Scene scene = makeScene(
      width, height, [&](double, double) { return back; }, 1.0);
  for (int y = square.y; y < square.br().y; ++y) {
    for (int x = square.x; x < square.br().x; ++x) {
      scene.left.at<float>(y, x) = static_cast<float>(texture(x, y + 500));
      scene.truth.at<float>(y, x) = static_cast<float>(front);
    }
    for (int x = 0; x < width; ++x) {
      const double left_x = x + front;
      if (left_x >= square.x - 0.5 && left_x < square.br().x - 0.5) {
        scene.right.at<float>(y, x) = static_cast<float>(texture(left_x, y + 500));
      }
    }
  }
  scene.start.setTo(static_cast<float>(back));
  scene.start(fat).setTo(static_cast<float>(front));
  const Refined kept = refine(scene), tested = refine(scene, {}, 0.05);
  const auto wrong = [&](const Refined& refined) {
    int count = 0;
    for (int y = fat.y; y < fat.br().y; ++y) {
      for (int x = fat.x; x < fat.br().x; ++x) {
        const float d = refined.disparity.at<float>(y, x);
        if (!std::isnan(d) && std::abs(d - scene.truth.at<float>(y, x)) > 1.0f) ++count;
      }
    }
    return count;
  };
  EXPECT_GT(wrong(kept), 1000);
  EXPECT_LT(wrong(tested), wrong(kept) / 5);
  // The inside of the square stays.
  const cv::Mat inside = tested.disparity(cv::Rect(96, 36, 48, 48));
  EXPECT_GT(cv::countNonZero(inside > 35), 48 * 48 * 95 / 100);
}

TEST(Refine, UsesNothingThatTheMaskHides) {
  const Scene scene = makeScene(160, 60, [](double, double) { return 20.3; });
  cv::Mat valid(60, 160, CV_8UC1, cv::Scalar(255));
  valid.rowRange(30, 60).setTo(0);
  cv::Mat disparity = scene.start.clone(), sigma;
  const std::size_t given_up =
      refineByGradient(scene.left, scene.right, valid, {}, kKeepAll, 1, disparity, sigma);
  EXPECT_EQ(cv::countNonZero(disparity.rowRange(33, 60) > 0), 0);
  EXPECT_GT(cv::countNonZero(disparity.rowRange(0, 28) > 0), 28 * 130);
  EXPECT_EQ(given_up + static_cast<std::size_t>(cv::countNonZero(disparity == disparity)),
            disparity.total());
}

TEST(Refine, NothingFromNothing) {
  Scene scene = makeScene(80, 40, [](double, double) { return 10.0; });
  scene.start.setTo(std::numeric_limits<float>::quiet_NaN());
  const Refined none = refine(scene);
  EXPECT_EQ(cv::countNonZero(none.disparity == none.disparity), 0);
  EXPECT_EQ(none.given_up, 0U);
  scene.start.setTo(10.0f);
  scene.left.setTo(90.0f);
  scene.right.setTo(90.0f);
  const Refined flat = refine(scene);
  EXPECT_EQ(cv::countNonZero(flat.disparity == flat.disparity), 0);
  EXPECT_EQ(flat.given_up, scene.start.total());
}

}  // namespace
}  // namespace scanner::stereo
