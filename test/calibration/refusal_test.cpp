#include <gtest/gtest.h>

#include <limits>

#include "calibration/boards.h"
#include "scanner/calibration/stereo_calibration.h"

namespace scanner::calibration {
namespace {

using boards::TrueRig;

/// One line, of the code, with all words; what it says else.
::testing::AssertionResult refused(const std::vector<BoardObservation>& views, const TrueRig& rig,
                                   StatusCode code, const std::vector<std::string>& words,
                                   const Board& board = boards::usualBoard()) {
  const auto report = calibrateStereo(views, board, rig.size, {}, 2);
  if (report) return ::testing::AssertionFailure() << "was calibrated";
  const std::string message = report.status().message();
  if (report.status().code() != code || message.find('\n') != std::string::npos) {
    return ::testing::AssertionFailure() << toString(report.status().code()) << ": " << message;
  }
  for (const std::string& word : words) {
    if (message.find(word) == std::string::npos) {
      return ::testing::AssertionFailure() << "no '" << word << "' in: " << message;
    }
  }
  return ::testing::AssertionSuccess() << message;
}

TEST(Refusal, TooFewViews) {
  const TrueRig rig = boards::usualRig();
  const auto views = boards::chanceViews(rig, boards::usualBoard(), 4, 0.1, 1);
  EXPECT_TRUE(refused(views, rig, StatusCode::kNotEnoughData,
                      {"too few views", "in 4", "at least 5", "tilted"}));
  EXPECT_TRUE(refused({}, rig, StatusCode::kNotEnoughData, {"too few views"}));
}

TEST(Refusal, BoardThatNeverMoved) {
  const TrueRig rig = boards::usualRig();
  const Board board = boards::usualBoard();
  const auto pose = boards::chancePoses(rig, board, 1, {}, 2)[0];
  std::vector<BoardObservation> views(20, boards::observe(rig, board, pose, "same"));
  boards::addNoise(views, 0.1, 2);
  EXPECT_TRUE(refused(views, rig, StatusCode::kNotEnoughData, {"too alike", "only 1 of them"}));
}

TEST(Refusal, BoardThatWasNeverTilted) {
  const TrueRig rig = boards::usualRig();
  boards::Spread flat;
  flat.tilt_deg = 3.0;
  flat.farthest_m = 1.2;
  const auto views = boards::chanceViews(rig, boards::usualBoard(), 12, 0.1, 3, flat);
  EXPECT_TRUE(refused(views, rig, StatusCode::kNotEnoughData, {"too alike", "tilted", "15 deg"}));
}

TEST(Refusal, BoardThatStayedSmallInTheMiddle) {
  const TrueRig rig = boards::usualRig();
  boards::Spread middle;
  middle.nearest_m = 1.8;
  middle.farthest_m = 2.4;
  middle.share = 0.34;
  const auto views = boards::chanceViews(rig, boards::usualBoard(), 12, 0.1, 4, middle);
  EXPECT_TRUE(refused(views, rig, StatusCode::kNotEnoughData, {"too alike", "cover", "15 %"}));
}

TEST(Refusal, SwappedEyes) {
  const TrueRig rig = boards::usualRig();
  auto views = boards::chanceViews(rig, boards::usualBoard(), 8, 0.1, 5);
  for (BoardObservation& view : views) std::swap(view.left, view.right);
  EXPECT_TRUE(refused(views, rig, StatusCode::kInvalidInput, {"swapped", "mm to the left"}));
}

TEST(Refusal, EyesAboveEachOther) {
  TrueRig rig = boards::usualRig();
  rig.translation = (cv::Mat_<double>(3, 1) << 0.001, -0.10, 0.002);
  const auto views = boards::chanceViews(rig, boards::usualBoard(), 8, 0.1, 6);
  EXPECT_TRUE(refused(views, rig, StatusCode::kInvalidInput, {"side by side"}));
}

TEST(Refusal, PairsOfDifferentMoments) {
  const TrueRig rig = boards::usualRig();
  auto views = boards::chanceViews(rig, boards::usualBoard(), 6, 0.1, 7);
  const auto others = boards::chanceViews(rig, boards::usualBoard(), 6, 0.1, 8);
  for (std::size_t i = 0; i < views.size(); ++i) views[i].right = others[i].right;
  const auto report = calibrateStereo(views, boards::usualBoard(), rig.size, {}, 2);
  ASSERT_FALSE(report);
  EXPECT_NE(report.status().code(), StatusCode::kOk);
  EXPECT_EQ(report.status().message().find('\n'), std::string::npos);
}

TEST(Refusal, CornersOfWrongNumberOrNotFinite) {
  const TrueRig rig = boards::usualRig();
  auto views = boards::chanceViews(rig, boards::usualBoard(), 6, 0.1, 9);
  views[2].right.pop_back();
  EXPECT_TRUE(refused(views, rig, StatusCode::kInvalidInput, {"view3", "54 and 53", "has 54"}));
  views[2].right.emplace_back(std::numeric_limits<float>::quiet_NaN(), 1.0f);
  EXPECT_TRUE(refused(views, rig, StatusCode::kInvalidInput, {"view3", "not finite"}));
}

TEST(Refusal, RequestsThatMakeNoSense) {
  const TrueRig rig = boards::usualRig();
  const auto views = boards::chanceViews(rig, boards::usualBoard(), 6, 0.1, 10);
  const auto with = [&](const Board& board, cv::Size size, int threads) {
    return calibrateStereo(views, board, size, {}, threads);
  };
  EXPECT_THROW(with({2, 6, 0.03}, rig.size, 1), ConfigurationError);
  EXPECT_THROW(with({9, 6, 0.0}, rig.size, 1), ConfigurationError);
  EXPECT_THROW(with({9, 6, std::nan("")}, rig.size, 1), ConfigurationError);
  EXPECT_THROW(with({9, 6, 0.03, -0.03}, rig.size, 1), ConfigurationError);
  EXPECT_THROW(with(boards::usualBoard(), {0, 480}, 1), ConfigurationError);
  EXPECT_THROW(with(boards::usualBoard(), rig.size, 0), ConfigurationError);
}

}  // namespace
}  // namespace scanner::calibration
