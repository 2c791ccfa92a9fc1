#include <gtest/gtest.h>

#include <hwy/highway.h>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

#include "stereo/edge_enhance.h"
#include "stereo/matcher.h"

namespace scanner::stereo {
namespace {

constexpr int kNoCost = 65535;

cv::Mat randomImage(int width, int height, unsigned seed) {
  std::mt19937 generator(seed);
  cv::Mat image(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image.at<uchar>(y, x) = static_cast<uchar>(generator() >> 24);
  }
  return image;
}

/// Smooth random texture at a position that need not be a whole pixel.
double texture(double x, int y, unsigned seed) {
  std::mt19937 generator(seed + static_cast<unsigned>(y) * 7919U);
  double value = 128.0;
  for (int i = 0; i < 6; ++i) {
    const double frequency = 0.15 + 0.9 * static_cast<double>(generator()) / 4294967296.0;
    const double phase = 6.2831853 * static_cast<double>(generator()) / 4294967296.0;
    value += 18.0 * std::sin(frequency * x + phase);
  }
  return value;
}

/// The left view of a plane at disparity a + b x, the right view being the texture itself.
void makePlane(int width, int height, double a, double b, cv::Mat& left, cv::Mat& right) {
  left.create(height, width, CV_8UC1);
  right.create(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      left.at<uchar>(y, x) = cv::saturate_cast<uchar>(texture(x - a - b * x, y, 5));
      right.at<uchar>(y, x) = cv::saturate_cast<uchar>(texture(x, y, 5));
    }
  }
}

/// Everything the matcher computes, written down plainly.
class Reference {
 public:
  Reference(const cv::Mat& left, const cv::Mat& right, DisparitySearch search,
            const MatcherOptions& o)
      : left_(enhanceEdges(left, o.block, 1)),
        right_(enhanceEdges(right, o.block, 1)),
        search_(search),
        radius_(o.block.window_px / 2),
        limit_(std::min(127, 65534 / (o.block.window_px * o.block.window_px))),
        shift_(o.block.shift_px) {}

  int windowSum(int x, int y, int d) const {
    int sum = 0;
    for (int v = std::max(0, y - radius_); v <= std::min(left_.rows - 1, y + radius_); ++v) {
      for (int u = std::max(0, x - radius_); u <= std::min(left_.cols - 1, x + radius_); ++u) {
        sum += std::min(limit_,
                        std::abs(left_.at<uchar>(v, u) - right_.at<uchar>(v, std::max(0, u - d))));
      }
    }
    return sum;
  }

  int cost(int x, int y, int d) const {
    if (d < search_.min_px || d > search_.max_px || d > x) return kNoCost;
    int least = windowSum(x, y, d);
    for (const int u : {x - shift_, x + shift_}) {
      if (u >= 0 && u < left_.cols) least = std::min(least, windowSum(u, y, d));
    }
    return least;
  }

  /// Best disparity, -1 for none.
  int leftBest(int x, int y) const {
    int best = -1, least = kNoCost;
    for (int d = search_.min_px; d <= search_.max_px; ++d) {
      if (cost(x, y, d) < least) least = cost(x, y, best = d);
    }
    return best;
  }

  int rightBest(int x, int y) const {
    int best = -1, least = kNoCost;
    for (int d = search_.min_px; d <= search_.max_px && x + d < left_.cols; ++d) {
      if (cost(x + d, y, d) < least) least = cost(x + d, y, best = d);
    }
    return best;
  }

  double fraction(int x, int y, int d) const {
    const int a = cost(x, y, d - 1), b = cost(x, y, d), c = cost(x, y, d + 1);
    if (a == kNoCost || c == kNoCost || std::max(a, c) == b) return 0.0;
    return 0.5 * (a - c) / (std::max(a, c) - b);
  }

  bool ambiguous(int x, int y, int d, double percent) const {
    const double bound = std::floor(cost(x, y, d) * (1.0 + percent / 100.0));
    for (int e = search_.min_px; e <= search_.max_px; ++e) {
      if (std::abs(e - d) > 1 && cost(x, y, e) != kNoCost && cost(x, y, e) <= bound) return true;
    }
    return false;
  }

 private:
  cv::Mat left_, right_;
  DisparitySearch search_;
  int radius_, limit_, shift_;
};

MatcherOptions plainOptions() {
  MatcherOptions o;
  o.validation.texture = false;
  o.validation.uniqueness = false;
  return o;
}

bool sameBytes(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != b.type()) return false;
  for (int y = 0; y < a.rows; ++y) {
    if (std::memcmp(a.ptr(y), b.ptr(y), a.elemSize() * static_cast<std::size_t>(a.cols)) != 0) {
      return false;
    }
  }
  return true;
}

void expectReference(const cv::Mat& left, const cv::Mat& right, DisparitySearch search,
                     const MatcherOptions& o) {
  const Candidates found = makeBlockMatcher(o)->match(left, right, search, 2);
  const Reference reference(left, right, search, o);
  std::size_t ambiguous = 0;
  for (int y = 0; y < left.rows; ++y) {
    for (int x = 0; x < left.cols; ++x) {
      ASSERT_EQ(found.right.at<short>(y, x), reference.rightBest(x, y)) << x << ", " << y;
      const int best = reference.leftBest(x, y);
      const bool dropped = best >= 0 && o.validation.uniqueness &&
                           reference.ambiguous(x, y, best, o.validation.uniqueness_percent);
      ambiguous += dropped ? 1 : 0;
      const float value = found.left.at<float>(y, x);
      if (best < 0 || dropped) {
        ASSERT_TRUE(std::isnan(value)) << x << ", " << y;
      } else {
        ASSERT_NEAR(value, best + reference.fraction(x, y, best), 1e-5) << x << ", " << y;
      }
    }
  }
  EXPECT_EQ(found.ambiguous, ambiguous);
}

TEST(BlockMatcher, EqualsTheDefinition) {
  const cv::Mat left = randomImage(67, 21, 1), right = randomImage(67, 21, 2);
  for (const DisparitySearch search : {DisparitySearch{0, 8}, {3, 40}, {20, 66}, {66, 66}}) {
    for (const int window : {5, 9, 51}) {
      for (const int shift : {0, 4}) {
        MatcherOptions o = plainOptions();
        o.block.window_px = window;
        o.block.shift_px = shift;
        if (window == 51 && shift != 0) continue;
        SCOPED_TRACE(::testing::Message() << search.min_px << ".." << search.max_px << ", window "
                                          << window << ", shift " << shift);
        if (window == 51 && search.max_px != 40) continue;
        expectReference(left, right, search, o);
      }
    }
  }
}

TEST(BlockMatcher, EveryEdgeEnhancementEqualsTheDefinition) {
  const cv::Mat left = randomImage(50, 12, 3), right = randomImage(50, 12, 4);
  for (const auto edges :
       {EdgeEnhancement::kBandPass, EdgeEnhancement::kSobel, EdgeEnhancement::kNone}) {
    MatcherOptions o = plainOptions();
    o.block.window_px = 7;
    o.block.edge_enhancement = edges;
    o.block.edge_limit = 63;
    o.validation.uniqueness = true;
    o.validation.uniqueness_percent = 12.5;
    expectReference(left, right, {0, 35}, o);
  }
}

TEST(BlockMatcher, SameBytesOnEveryInstructionSetAndThreadCount) {
  const cv::Mat left = randomImage(203, 150, 5), right = randomImage(203, 150, 6);
  MatcherOptions o;
  o.block.shift_px = 3;
  const auto matcher = makeBlockMatcher(o);
  const Candidates first = matcher->match(left, right, {7, 90}, 1);
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    for (const int threads : {1, 3}) {
      const Candidates other = matcher->match(left, right, {7, 90}, threads);
      EXPECT_TRUE(sameBytes(first.left, other.left)) << hwy::TargetName(target);
      EXPECT_TRUE(sameBytes(first.right, other.right)) << hwy::TargetName(target);
      EXPECT_EQ(first.ambiguous, other.ambiguous);
      EXPECT_EQ(first.untextured, other.untextured);
    }
  }
  hwy::SetSupportedTargetsForTest(0);
}

TEST(BlockMatcher, SlantedPlane) {
  cv::Mat left, right;
  makePlane(160, 60, 12.3, 0.06, left, right);
  const Candidates found = makeBlockMatcher(plainOptions())->match(left, right, {0, 40}, 2);
  double squares = 0.0;
  int n = 0, consistent = 0;
  for (int y = 8; y < 52; ++y) {
    for (int x = 40; x < 150; ++x) {
      const double error = found.left.at<float>(y, x) - (12.3 + 0.06 * x);
      ASSERT_LT(std::abs(error), 1.0) << x << ", " << y;
      squares += error * error;
      const int back = found.right.at<short>(y, x - cvRound(found.left.at<float>(y, x)));
      consistent += std::abs(static_cast<float>(back) - found.left.at<float>(y, x)) <= 1.5F ? 1 : 0;
      ++n;
    }
  }
  EXPECT_LT(std::sqrt(squares / n), 0.15);
  EXPECT_GT(consistent, 0.99 * n);
}

TEST(BlockMatcher, DifferentExposureHardlyMatters) {
  cv::Mat left, right, brighter;
  makePlane(120, 40, 9.0, 0.0, left, right);
  right.convertTo(brighter, -1, 1.0, 25.0);
  const Candidates found = makeBlockMatcher(plainOptions())->match(left, brighter, {0, 30}, 1);
  for (int y = 8; y < 32; ++y) {
    for (int x = 40; x < 110; ++x) ASSERT_NEAR(found.left.at<float>(y, x), 9.0, 0.5);
  }
}

TEST(BlockMatcher, CountsUntexturedAndAmbiguousPixels) {
  const cv::Mat flat(40, 90, CV_8UC1, cv::Scalar(90));
  MatcherOptions o;
  Candidates found = makeBlockMatcher(o)->match(flat, flat, {10, 40}, 2);
  EXPECT_EQ(found.untextured, 40U * 80U);
  EXPECT_EQ(found.ambiguous, 0U);
  EXPECT_EQ(cv::countNonZero(found.left == found.left), 0);

  cv::Mat stripes(40, 90, CV_8UC1);
  for (int x = 0; x < 90; ++x) stripes.col(x).setTo(x % 8 < 4 ? 60 : 160);
  found = makeBlockMatcher(o)->match(stripes, stripes, {0, 40}, 2);
  EXPECT_EQ(found.untextured, 0U);
  EXPECT_GT(found.ambiguous, 40U * 60U);
}

TEST(BlockMatcher, RefusesWhatItCannotMatch) {
  const auto matcher = makeBlockMatcher(MatcherOptions{});
  const cv::Mat image = randomImage(30, 20, 1);
  EXPECT_THROW(matcher->match(image, image.colRange(0, 20), {0, 8}, 1), std::invalid_argument);
  EXPECT_THROW(matcher->match(image, image, {0, 30}, 1), std::invalid_argument);
  EXPECT_THROW(matcher->match({}, {}, {0, 8}, 1), std::invalid_argument);
}

TEST(BlockMatcher, WorkingMemoryIsBounded) {
  const auto matcher = makeBlockMatcher(MatcherOptions{});
  const std::size_t two = matcher->workingMemory({1024, 768}, {100, 330}, 2);
  EXPECT_GT(two, 2U * 1024U * 231U * 2U);
  EXPECT_LT(two, 6U * 1024U * 1024U);
  EXPECT_GT(matcher->workingMemory({1024, 768}, {100, 330}, 4), two);
}

TEST(EdgeEnhancement, BandPassIsTheDifferenceFromTheMean) {
  const cv::Mat image = randomImage(41, 23, 9);
  BlockMatcherOptions o;
  const cv::Mat filtered = enhanceEdges(image, o, 2);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      int sum = 0;
      for (int v = y - 4; v <= y + 4; ++v) {
        for (int u = x - 4; u <= x + 4; ++u) {
          sum += image.at<uchar>(std::clamp(v, 0, 22), std::clamp(u, 0, 40));
        }
      }
      const int expected =
          static_cast<int>(std::floor(4.0 * (image.at<uchar>(y, x) - sum / 81.0) + 0.5));
      ASSERT_NEAR(filtered.at<uchar>(y, x), std::clamp(expected, -31, 31) + 31, 1e-9);
    }
  }
}

}  // namespace
}  // namespace scanner::stereo
