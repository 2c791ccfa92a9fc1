#include <gtest/gtest.h>

#include <hwy/highway.h>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "scanner/core/parallel.h"
#include "stereo/matcher.h"
#include "stereo/semi_global_reference.h"
#include "stereo/semi_global_strip.h"
#include "stereo/synthetic.h"

namespace scanner::stereo {
namespace {

bool sameBytes(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != b.type()) return false;
  for (int y = 0; y < a.rows; ++y) {
    if (std::memcmp(a.ptr(y), b.ptr(y), a.elemSize() * static_cast<std::size_t>(a.cols)) != 0) {
      return false;
    }
  }
  return true;
}

bool isNan(float value) { return value != value; }

/// Without the tests that drop pixels.
MatcherOptions plainOptions() {
  MatcherOptions o;
  o.validation.texture = false;
  o.validation.uniqueness = false;
  return o;
}

/// A pair with regions of few grey levels, where many costs tie, and of noise.
void roughPair(int width, int height, unsigned seed, cv::Mat& left, cv::Mat& right) {
  std::mt19937 generator(seed);
  left.create(height, width, CV_8UC1);
  right.create(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const unsigned levels = x / 16 % 2 == 0 ? 3U : 256U;
      left.at<std::uint8_t>(y, x) =
          static_cast<std::uint8_t>(static_cast<unsigned>(generator()) % levels * (256U / levels));
    }
  }
  const int shift = std::min(7, width / 4);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int from = std::min(width - 1, x + shift + y % 3);
      const int noise = static_cast<int>(generator() % 4U);
      right.at<std::uint8_t>(y, x) =
          static_cast<std::uint8_t>(std::min(255, left.at<std::uint8_t>(y, from) + noise));
    }
  }
}

struct Picture {
  int width, height;
  DisparitySearch search;
};

class SemiGlobalReference : public ::testing::TestWithParam<SemiGlobalPaths> {
 protected:
  void TearDown() override { hwy::SetSupportedTargetsForTest(0); }
};

/// Every instruction set and number of threads gives the bytes of the plain implementation.
TEST_P(SemiGlobalReference, SameBytesAsPlainImplementation) {
  const Picture pictures[] = {{67, 41, {0, 20}},   {131, 23, {5, 90}}, {33, 290, {0, 11}},
                              {200, 9, {64, 127}}, {29, 17, {28, 28}}, {130, 11, {1, 129}}};
  int window = 3;
  for (const Picture& p : pictures) {
    MatcherOptions options = plainOptions();
    options.semi_global.paths = GetParam();
    options.semi_global.window_px = window;
    window = window == 7 ? 3 : window + 2;
    options.validation.uniqueness = p.width % 2 == 1;
    cv::Mat left, right;
    roughPair(p.width, p.height, 5U, left, right);
    const Candidates expected = testing::plainSemiGlobal(left, right, p.search, options);
    const auto matcher = makeSemiGlobalMatcher(options);
    for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
      hwy::SetSupportedTargetsForTest(target);
      for (const int threads : {1, 3}) {
        const Candidates found = matcher->match(left, right, p.search, threads);
        const std::string what = std::string(hwy::TargetName(target)) + ", " +
                                 std::to_string(p.width) + "x" + std::to_string(p.height) + ", " +
                                 std::to_string(threads) + " threads";
        EXPECT_TRUE(sameBytes(found.left, expected.left)) << what;
        EXPECT_TRUE(sameBytes(found.right, expected.right)) << what;
        EXPECT_EQ(found.ambiguous, expected.ambiguous) << what;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Paths, SemiGlobalReference,
                         ::testing::Values(SemiGlobalPaths::kFive, SemiGlobalPaths::kEight));

/// Pixels at which the whole window has its counterpart.
cv::Rect inner(const cv::Mat& image, int max_disparity) {
  constexpr int kMargin = 6;
  return {max_disparity + kMargin, kMargin, image.cols - max_disparity - 2 * kMargin,
          image.rows - 2 * kMargin};
}

/// Share of inner pixels further than `tolerance` from the plane, or without disparity.
double wrongShare(const cv::Mat& disparity, const testing::DisparityPlane& plane, double tolerance,
                  int max_disparity) {
  const cv::Rect area = inner(disparity, max_disparity);
  int wrong = 0;
  for (int y = area.y; y < area.br().y; ++y) {
    for (int x = area.x; x < area.br().x; ++x) {
      const float d = disparity.at<float>(y, x);
      if (isNan(d) || std::abs(static_cast<double>(d) - plane.at(x, y)) > tolerance) ++wrong;
    }
  }
  return static_cast<double>(wrong) / area.area();
}

TEST(SemiGlobal, FindsAShiftedTexture) {
  const testing::DisparityPlane plane{17.0, 0.0, 0.0};
  const RectifiedPair pair = testing::makePair(180, 150, plane);
  for (const SemiGlobalPaths paths : {SemiGlobalPaths::kFive, SemiGlobalPaths::kEight}) {
    MatcherOptions options;
    options.semi_global.paths = paths;
    const Candidates found =
        makeSemiGlobalMatcher(options)->match(pair.left_gray, pair.right_gray, {3, 40}, 2);
    EXPECT_EQ(wrongShare(found.left, plane, 0.4, 40), 0.0);
    const cv::Rect area = inner(found.right, 40);
    for (int y = area.y; y < area.br().y; ++y) {
      for (int x = area.x - 40; x < area.br().x - 40; ++x) {
        ASSERT_EQ(found.right.at<short>(y, x), 17) << x << ", " << y;
      }
    }
  }
}

TEST(SemiGlobal, FollowsASlantedPlane) {
  const testing::DisparityPlane plane{20.0, 0.08, -0.05};
  const RectifiedPair pair = testing::makePair(220, 160, plane, {1.0, 1.0, 0.0});
  const Candidates found =
      makeSemiGlobalMatcher(plainOptions())->match(pair.left_gray, pair.right_gray, {0, 50}, 2);
  EXPECT_LT(wrongShare(found.left, plane, 1.0, 50), 0.002);
  double squares = 0.0;
  const cv::Rect area = inner(found.left, 50);
  for (int y = area.y; y < area.br().y; ++y) {
    for (int x = area.x; x < area.br().x; ++x) {
      const double error = static_cast<double>(found.left.at<float>(y, x)) - plane.at(x, y);
      squares += std::min(1.0, error * error);
    }
  }
  EXPECT_LT(std::sqrt(squares / area.area()), 0.2);
}

TEST(SemiGlobal, ToleratesExposureOfTheOtherEye) {
  const testing::DisparityPlane plane{12.0, 0.02, 0.01};
  for (const testing::PairNoise& noise :
       {testing::PairNoise{1.0, 0.8, 0.0}, testing::PairNoise{1.0, 1.0, 25.0},
        testing::PairNoise{1.0, 1.15, -20.0}}) {
    const RectifiedPair pair = testing::makePair(180, 100, plane, noise);
    const Candidates found =
        makeSemiGlobalMatcher(plainOptions())->match(pair.left_gray, pair.right_gray, {0, 40}, 2);
    EXPECT_LT(wrongShare(found.left, plane, 1.0, 40), 0.02) << noise.gain << " " << noise.offset;
  }
}

/// A square in front of a wall, with different textures.
struct StepScene {
  static constexpr int kWidth = 200, kHeight = 140, kNear = 24, kFar = 10;
  static constexpr int kLeft = 80, kRight = 140, kTop = 40, kBottom = 100;
  cv::Mat left, right;

  StepScene() {
    left.create(kHeight, kWidth, CV_8UC1);
    right.create(kHeight, kWidth, CV_8UC1);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool rows = y >= kTop && y < kBottom;
        const auto front = [&](int u) { return rows && u >= kLeft && u < kRight; };
        left.at<std::uint8_t>(y, x) = grey(x, y, front(x));
        const bool near = front(x + kNear);
        right.at<std::uint8_t>(y, x) = grey(near ? x + kNear : x + kFar, y, near);
      }
    }
  }
  static std::uint8_t grey(int x, int y, bool front) {
    return testing::toGray(front ? 40.0 + 0.6 * testing::texture(x + 1000, y)
                                 : 60.0 + 0.6 * testing::texture(x, y));
  }
};

TEST(SemiGlobal, DoesNotFattenEdges) {
  const StepScene scene;
  const Candidates found =
      makeSemiGlobalMatcher(plainOptions())->match(scene.left, scene.right, {0, 40}, 2);
  using S = StepScene;
  int fat = 0, thin = 0;
  for (int y = S::kTop + 5; y < S::kBottom - 5; ++y) {
    // The strip of kNear - kFar pixels left of the square is hidden from the right eye.
    for (int x = S::kRight + 3; x < S::kRight + 20; ++x) {
      fat += found.left.at<float>(y, x) > S::kFar + 1 ? 1 : 0;
    }
    for (int x = S::kLeft + 2; x < S::kRight - 2; ++x) {
      thin += std::abs(found.left.at<float>(y, x) - S::kNear) < 1 ? 0 : 1;
    }
  }
  EXPECT_LE(fat, 5);
  EXPECT_LE(thin, 5);
  int above = 0;
  for (int x = S::kLeft + 5; x < S::kRight - 5; ++x) {
    for (int y = S::kBottom + 3; y < S::kBottom + 20; ++y) {
      above += found.left.at<float>(y, x) > S::kFar + 1 ? 1 : 0;
    }
  }
  EXPECT_LE(above, 5);
}

TEST(SemiGlobal, DropsWhatHasNoTexture) {
  RectifiedPair pair = testing::makePair(160, 90, {12.0, 0.0, 0.0});
  for (cv::Mat* image : {&pair.left_gray, &pair.right_gray}) {
    (*image)(cv::Rect(60, 0, 60, 90)).setTo(90);
  }
  MatcherOptions options = plainOptions();
  options.validation.texture = true;
  const Candidates found =
      makeSemiGlobalMatcher(options)->match(pair.left_gray, pair.right_gray, {0, 30}, 1);
  for (int y = 0; y < 90; ++y) {
    for (int x = 66; x < 114; ++x) ASSERT_TRUE(isNan(found.left.at<float>(y, x)));
    for (int x = 130; x < 160; ++x) ASSERT_FALSE(isNan(found.left.at<float>(y, x)));
  }
  EXPECT_GE(found.untextured, 90U * 48U);
}

/// Two eyes that see different things: the best of many bad matches is hardly better than the next.
TEST(SemiGlobal, DropsWhatIsAmbiguous) {
  const RectifiedPair pair = testing::makePair(200, 90, {12.0, 0.0, 0.0});
  cv::Mat other;
  cv::flip(pair.right_gray, other, 0);
  MatcherOptions options = plainOptions();
  options.validation.uniqueness = true;
  const auto share = [&](const cv::Mat& right) {
    const Candidates found =
        makeSemiGlobalMatcher(options)->match(pair.left_gray, right, {0, 60}, 1);
    return static_cast<double>(found.ambiguous) / static_cast<double>(right.total());
  };
  EXPECT_GT(share(other), 0.1);
  EXPECT_LT(share(pair.right_gray), 0.02);
}

/// Columns near the left border keep the part of the range that is inside, and those that have no
/// match in it have no disparity rather than an accidental one.
TEST(SemiGlobal, NothingPointsOutside) {
  const testing::DisparityPlane plane{12.0, 0.0, 0.0};
  const RectifiedPair pair = testing::makePair(150, 60, plane);
  const Candidates found =
      makeSemiGlobalMatcher(plainOptions())->match(pair.left_gray, pair.right_gray, {8, 60}, 2);
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 8; ++x) ASSERT_TRUE(isNan(found.left.at<float>(y, x)));
    for (int x = 8; x < 150; ++x) {
      const float d = found.left.at<float>(y, x);
      if (isNan(d)) continue;
      ASSERT_GE(d, 7.5F);
      ASSERT_LT(std::lround(d), x + 1);
    }
    for (int x = 20; x < 140; ++x) ASSERT_NEAR(found.left.at<float>(y, x), 12.0F, 0.5F);
    for (int x = 150 - 8; x < 150; ++x) ASSERT_EQ(found.right.at<short>(y, x), kNoDisparity);
  }
}

/// Where the wall goes on past what the right eye sees, its disparity does as well: no match, and
/// not whichever small disparity still points into the image.
TEST(SemiGlobal, TheBandThatOneEyeAloneSeesHasNoMatch) {
  const RectifiedPair pair = testing::makePair(180, 80, {30.0, 0.0, 0.0}, {2.0, 1.0, 0.0});
  const Candidates found =
      makeSemiGlobalMatcher(plainOptions())->match(pair.left_gray, pair.right_gray, {0, 50}, 2);
  int accidental = 0;
  for (int y = 5; y < 75; ++y) {
    for (int x = 0; x < 28; ++x) accidental += isNan(found.left.at<float>(y, x)) ? 0 : 1;
    for (int x = 36; x < 170; ++x) ASSERT_NEAR(found.left.at<float>(y, x), 30.0F, 1.0F);
  }
  EXPECT_LE(accidental, 70 * 28 / 10);  // were they impossible, it would be nearly all
}

TEST(SemiGlobal, MemoryIsBounded) {
  MatcherOptions options;
  for (const SemiGlobalPaths paths : {SemiGlobalPaths::kFive, SemiGlobalPaths::kEight}) {
    options.semi_global.paths = paths;
    const auto matcher = makeSemiGlobalMatcher(options);
    const auto megabytes = [&](cv::Size size, int threads) {
      return static_cast<double>(matcher->workingMemory(size, {100, 330}, threads)) / 1e6;
    };
    const double image = 1024 * 768 / 1e6;
    // Far below the 182 MB of all costs for five, and no more for one thread than the strip is.
    EXPECT_LT(megabytes({1024, 768}, 1), paths == SemiGlobalPaths::kFive ? 25 * image : 90.0);
    EXPECT_GT(megabytes({1024, 768}, 2), megabytes({1024, 768}, 1));
    EXPECT_LT(megabytes({2048, 1536}, 1), 150.0);
  }
}

TEST(SemiGlobal, RefusesWhatDoesNotFit) {
  const auto matcher = makeSemiGlobalMatcher({});
  const cv::Mat image(40, 60, CV_8UC1, cv::Scalar(0));
  EXPECT_THROW(matcher->match(image, image.colRange(0, 50), {0, 10}, 1), std::invalid_argument);
  EXPECT_THROW(matcher->match(image, image, {0, 60}, 1), std::invalid_argument);
  EXPECT_THROW(matcher->match(image, image, {-1, 10}, 1), std::invalid_argument);
}

}  // namespace
}  // namespace scanner::stereo
