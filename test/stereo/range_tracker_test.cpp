#include "scanner/stereo/range_tracker.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <vector>

#include "scanner/core/options.h"
#include "stereo/synthetic.h"

namespace scanner::stereo {
namespace {

using testing::texture;

constexpr int kWidth = 640, kHeight = 240;
constexpr SearchRange kBounds{20, 250};
constexpr int kSurface = 200;

RangeOptions automatic() {
  RangeOptions options;
  options.mode = RangeMode::kAutomatic;
  return options;
}

/// A wall at `far_px`, and in front of it a square of `side` pixels at `near_px` (0: none).
RectifiedPair scene(double far_px, double near_px = 0.0, int side = 0) {
  RectifiedPair pair;
  pair.left_gray.create(kHeight, kWidth, CV_8UC1);
  pair.right_gray.create(kHeight, kWidth, CV_8UC1);
  const int x0 = 420, y0 = 100;
  const auto inside = [&](double x, int y) {
    return x >= x0 && x < x0 + side && y >= y0 && y < y0 + side;
  };
  const auto gray = [](double value) { return cv::saturate_cast<std::uint8_t>(value); };
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool near_left = inside(x, y), near_right = inside(x + near_px, y);
      pair.left_gray.at<std::uint8_t>(y, x) = gray(texture(x + (near_left ? 5000 : 0), y));
      pair.right_gray.at<std::uint8_t>(y, x) =
          gray(texture(near_right ? x + near_px + 5000 : x + far_px, y));
    }
  }
  return pair;
}

cv::Mat constantDisparity(float value) { return cv::Mat(kHeight, kWidth, CV_32FC1, value); }

TEST(RangeTracker, FixedModeIsTheBounds) {
  RangeTracker tracker({}, kBounds, kSurface);
  const SearchRange range = tracker.choose(scene(60.0), 1);
  EXPECT_EQ(range.min_px, kBounds.min_px);
  EXPECT_EQ(range.max_px, kBounds.max_px);
  EXPECT_EQ(tracker.state(), RangeState::kFixed);
}

TEST(RangeTracker, NarrowsToWhatThePairShows) {
  RangeTracker tracker(automatic(), kBounds, kSurface);
  const SearchRange range = tracker.choose(scene(100.0), 1);
  EXPECT_EQ(tracker.state(), RangeState::kTracking);
  EXPECT_LE(range.min_px, 92);
  EXPECT_GE(range.max_px, 108);
  EXPECT_LE(range.count(), 56);
}

TEST(RangeTracker, ANearObjectWidensTheRangeInItsFirstFrame) {
  RangeTracker tracker(automatic(), kBounds, kSurface);
  for (int i = 0; i < 3; ++i) {
    tracker.choose(scene(60.0), 1);
    tracker.update(constantDisparity(60.0F));
  }
  ASSERT_LE(tracker.range().max_px, 100);
  const SearchRange range = tracker.choose(scene(60.0, 200.0, 40), 1);
  EXPECT_LE(range.min_px, 52);
  EXPECT_GE(range.max_px, 208);
}

TEST(RangeTracker, WhatTheLastFramesHadStaysForAsLongAsMemorySays) {
  RangeOptions options = automatic();
  options.memory_frames = 2;
  RangeTracker tracker(options, kBounds, kSurface);
  const RectifiedPair pair = scene(60.0);
  tracker.choose(scene(60.0, 200.0, 40), 1);
  cv::Mat had = constantDisparity(60.0F);
  had(cv::Rect(420, 100, 40, 40)) = 200.0F;
  tracker.update(had);
  for (const int remembered : {1, 1, 0}) {
    EXPECT_EQ(tracker.choose(pair, 1).max_px >= 208, remembered == 1);
    tracker.update(constantDisparity(60.0F));
  }
}

TEST(RangeTracker, WithoutMemoryEveryFrameIsForItself) {
  RangeOptions options = automatic();
  options.memory_frames = 0;
  RangeTracker used(options, kBounds, kSurface), fresh(options, kBounds, kSurface);
  used.choose(scene(60.0, 200.0, 40), 1);
  used.update(constantDisparity(200.0F));
  const RectifiedPair pair = scene(100.0);
  const SearchRange a = used.choose(pair, 1), b = fresh.choose(pair, 1);
  EXPECT_EQ(a.min_px, b.min_px);
  EXPECT_EQ(a.max_px, b.max_px);
}

TEST(RangeTracker, AnEndWhereDisparitiesPileUpOpensAtOnce) {
  RangeTracker tracker(automatic(), kBounds, kSurface);
  const RectifiedPair pair = scene(100.0);
  const SearchRange narrow = tracker.choose(pair, 1);
  ASSERT_GT(narrow.min_px, kBounds.min_px);
  cv::Mat piled = constantDisparity(100.0F);
  piled(cv::Rect(0, 0, 40, 40)) = static_cast<float>(narrow.max_px) - 0.6F;
  tracker.update(piled);
  EXPECT_EQ(tracker.choose(pair, 1).max_px, kBounds.max_px);
  EXPECT_GT(tracker.range().min_px, kBounds.min_px);
  tracker.update(constantDisparity(100.0F));
  tracker.choose(pair, 1);
  piled = constantDisparity(100.0F);
  piled(cv::Rect(0, 0, 40, 40)) = static_cast<float>(tracker.range().min_px) + 0.6F;
  tracker.update(piled);
  EXPECT_EQ(tracker.choose(pair, 1).min_px, kBounds.min_px);
}

TEST(RangeTracker, LostGivesTheBounds) {
  RangeTracker tracker(automatic(), kBounds, kSurface);
  tracker.choose(scene(100.0), 1);
  tracker.update(constantDisparity(100.0F));
  RectifiedPair black;
  black.left_gray = cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(2));
  black.right_gray = black.left_gray;
  const SearchRange range = tracker.choose(black, 1);
  EXPECT_EQ(tracker.state(), RangeState::kLost);
  EXPECT_EQ(range.min_px, kBounds.min_px);
  EXPECT_EQ(range.max_px, kBounds.max_px);
  // All NaN says nothing.
  tracker.update(constantDisparity(std::numeric_limits<float>::quiet_NaN()));
  tracker.choose(scene(100.0), 1);
  EXPECT_EQ(tracker.state(), RangeState::kTracking);
}

TEST(RangeTracker, SameRangesOnAnyNumberOfThreads) {
  std::vector<int> ends[2];
  for (const int threads : {1, 3}) {
    RangeTracker tracker(automatic(), kBounds, kSurface);
    for (const double d : {60.0, 63.5, 70.25, 120.0}) {
      const SearchRange range = tracker.choose(scene(d, d + 60.0, 50), threads);
      tracker.update(constantDisparity(static_cast<float>(d)));
      ends[threads == 1 ? 0 : 1].insert(ends[threads == 1 ? 0 : 1].end(),
                                        {range.min_px, range.max_px});
    }
  }
  EXPECT_EQ(ends[0], ends[1]);
}

TEST(RangeTracker, ResetForgets) {
  RangeTracker tracker(automatic(), kBounds, kSurface);
  const RectifiedPair pair = scene(100.0);
  const SearchRange first = tracker.choose(pair, 1);
  tracker.update(constantDisparity(static_cast<float>(first.max_px)));
  tracker.reset();
  const SearchRange again = tracker.choose(pair, 1);
  EXPECT_EQ(again.min_px, first.min_px);
  EXPECT_EQ(again.max_px, first.max_px);
}

TEST(RangeTracker, BadArgumentsAreRefused) {
  EXPECT_THROW(RangeTracker(automatic(), {50, 50}, kSurface), ConfigurationError);
  EXPECT_THROW(RangeTracker(automatic(), {-1, 50}, kSurface), ConfigurationError);
  RangeTracker tracker(automatic(), {0, 700}, kSurface);
  EXPECT_THROW(tracker.choose(scene(60.0), 1), std::invalid_argument);
  EXPECT_THROW(tracker.choose({}, 1), std::invalid_argument);
}

}  // namespace
}  // namespace scanner::stereo
