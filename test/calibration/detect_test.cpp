#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "calibration/boards.h"
#include "scanner/calibration/calibration_files.h"
#include "support/temporary_folder.h"

namespace scanner::calibration {
namespace {

using boards::Pose;
using boards::TrueRig;

/// As calibrate_stereo does: many short loops of OpenCV's threads take long on a busy machine.
const bool kOneThread = (cv::setNumThreads(1), true);

/// The usual rig with half the pixels: quicker to render.
TrueRig smallRig() {
  TrueRig rig = boards::usualRig();
  rig.size = {320, 240};
  for (cv::Mat& K : rig.K) K.rowRange(0, 2) *= 0.5;
  return rig;
}

Pose tiltedPose(const Board& board) {
  return boards::poseAt(board, {0.35, -0.3, 0.15}, {0.06, 0.0, 0.55});
}

double furthest(const std::vector<cv::Point2f>& a, const std::vector<cv::Point2f>& b) {
  double largest = a.size() == b.size() ? 0.0 : 1e9;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    largest = std::max(largest, cv::norm(a[i] - b[i]));
  }
  return largest;
}

double rms(const std::vector<cv::Point2f>& a, const std::vector<cv::Point2f>& b) {
  double squares = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) squares += (a[i] - b[i]).ddot(a[i] - b[i]);
  return std::sqrt(squares / static_cast<double>(a.size()));
}

TEST(DetectBoard, CornersOfARenderedBoardAreSubPixel) {
  const TrueRig rig = smallRig();
  const Board board = boards::usualBoard();
  const Pose pose = tiltedPose(board);
  const auto found = detectBoards("view", boards::render(rig, 0, board, pose),
                                  boards::render(rig, 1, board, pose), board, {});
  ASSERT_TRUE(found) << found.status().message();
  const BoardObservation truth = boards::observe(rig, board, pose, "view");
  BoardObservation turned = truth;
  std::reverse(turned.left.begin(), turned.left.end());
  std::reverse(turned.right.begin(), turned.right.end());
  const bool same = furthest(found->left, truth.left) < furthest(found->left, turned.left);
  const BoardObservation& expected = same ? truth : turned;
  EXPECT_LT(furthest(found->left, expected.left), 0.2);
  EXPECT_LT(furthest(found->right, expected.right), 0.2);
  EXPECT_LT(rms(found->left, expected.left), 0.08);  // squares of 10 to 13 px
  EXPECT_LT(rms(found->right, expected.right), 0.08);
  // The first pixel's middle is 0, 0: half a pixel would stand out here.
  cv::Point2f mean(0, 0);
  for (std::size_t i = 0; i < found->left.size(); ++i) mean += found->left[i] - expected.left[i];
  EXPECT_LT(cv::norm(mean) / 54.0, 0.03);
}

TEST(DetectBoard, NoBoardIsNamedByItsEye) {
  const TrueRig rig = smallRig();
  const Board board = boards::usualBoard();
  const cv::Mat seen = boards::render(rig, 0, board, tiltedPose(board));
  const cv::Mat blank(seen.size(), CV_8UC1, cv::Scalar(120));
  const auto right = detectBoards("x", seen, blank, board, {});
  ASSERT_FALSE(right);
  EXPECT_EQ(right.status().code(), StatusCode::kNotEnoughData);
  EXPECT_NE(right.status().message().find("x: no whole board in the right"), std::string::npos);
  EXPECT_EQ(detectBoards("x", blank, blank, board, {}).status().message(),
            "x: no whole board in either picture");
  EXPECT_EQ(detectBoards("x", cv::Mat(), blank, board, {}).status().code(),
            StatusCode::kInvalidInput);
  EXPECT_EQ(detectBoards("x", blank, blank.rowRange(0, 100), board, {}).status().code(),
            StatusCode::kInvalidInput);
}

TEST(CornerOrder, TurnedAndMirroredOrdersAreUndone) {
  const TrueRig rig = boards::usualRig();
  for (const Board& board : {Board{9, 6, 0.03}, Board{7, 7, 0.03}}) {
    const BoardObservation truth =
        boards::observe(rig, board, boards::poseAt(board, {0.3, 0.2, 0.1}, {0.06, 0, 0.7}), "v");
    BoardObservation turned = truth;
    std::reverse(turned.right.begin(), turned.right.end());
    alignCornerOrder(board, turned);
    EXPECT_EQ(furthest(turned.right, truth.right), 0.0);
    BoardObservation mirrored = truth;  // both eyes row by row from the other side
    for (auto* points : {&mirrored.left, &mirrored.right}) {
      for (int r = 0; r < board.rows; ++r) {
        std::reverse(points->begin() + r * board.columns,
                     points->begin() + (r + 1) * board.columns);
      }
    }
    alignCornerOrder(board, mirrored);
    EXPECT_EQ(furthest(mirrored.left, truth.left), 0.0);
    EXPECT_EQ(furthest(mirrored.right, truth.right), 0.0);
  }
  // A square board may start at any of its four corners.
  const Board square{5, 5, 0.03};
  const BoardObservation truth =
      boards::observe(rig, square, boards::poseAt(square, {0.3, 0.2, 0.1}, {0.06, 0, 0.7}), "v");
  BoardObservation quarter = truth;
  for (int r = 0; r < 5; ++r) {
    for (int c = 0; c < 5; ++c) {
      quarter.right[static_cast<std::size_t>(5 * r + c)] =
          truth.right[static_cast<std::size_t>(5 * (4 - c) + r)];
    }
  }
  ASSERT_GT(furthest(quarter.right, truth.right), 50.0);
  alignCornerOrder(square, quarter);
  EXPECT_EQ(furthest(quarter.right, truth.right), 0.0);
}

class Pictures : public ::testing::Test {
 protected:
  PicturePair write(const std::string& name, const cv::Mat& left, const cv::Mat& right) {
    const PicturePair pair{name, folder_ / ("left" + name), folder_ / ("right" + name)};
    cv::imwrite(pair.left, left);
    cv::imwrite(pair.right, right);
    return pair;
  }
  test::TemporaryFolder folder_;
};

TEST_F(Pictures, PairsWithoutABoardAreSkippedAndNamed) {
  const TrueRig rig = smallRig();
  const Board board = boards::usualBoard();
  const cv::Mat left = boards::render(rig, 0, board, tiltedPose(board));
  const cv::Mat right = boards::render(rig, 1, board, tiltedPose(board));
  const cv::Mat blank(left.size(), CV_8UC1, cv::Scalar(120));
  const std::vector<PicturePair> pairs = {write("1.png", left, right), write("2.png", left, blank),
                                          write("3.png", left, right)};
  std::size_t calls = 0;
  const auto found = detectBoards(pairs, board, {}, 2, [&](auto, auto total, const auto&) {
    ++calls;
    EXPECT_EQ(total, 3U);
  });
  ASSERT_TRUE(found) << found.status().message();
  EXPECT_EQ(calls, 3U);
  EXPECT_EQ(found->image_size, rig.size);
  ASSERT_EQ(found->observations.size(), 2U);
  EXPECT_EQ(found->pairs[1].name, "3.png");
  ASSERT_EQ(found->skipped.size(), 1U);
  EXPECT_NE(found->skipped[0].find("2.png"), std::string::npos);
}

TEST_F(Pictures, SquaresCountedInsteadOfCornersAreTold) {
  const TrueRig rig = smallRig();
  const Board board = boards::usualBoard();
  const auto pair = write("1.png", boards::render(rig, 0, board, tiltedPose(board)),
                          boards::render(rig, 1, board, tiltedPose(board)));
  const auto found = detectBoards({pair}, Board{10, 7, 0.03}, {}, 1, nullptr);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.status().code(), StatusCode::kNotEnoughData);
  EXPECT_NE(found.status().message().find("--board 9x6"), std::string::npos)
      << found.status().message();
}

TEST_F(Pictures, UnlikeSizesAndUnreadableFilesAreNamed) {
  const TrueRig rig = smallRig();
  const Board board = boards::usualBoard();
  const cv::Mat left = boards::render(rig, 0, board, tiltedPose(board));
  const cv::Mat right = boards::render(rig, 1, board, tiltedPose(board));
  const cv::Rect part(0, 0, 300, 240);
  std::vector<PicturePair> pairs = {write("1.png", left, right),
                                    write("2.png", left(part), right(part))};
  const auto found = detectBoards(pairs, board, {}, 1, nullptr);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.status().code(), StatusCode::kInvalidInput);
  EXPECT_NE(found.status().message().find("300x240"), std::string::npos);
  pairs[1].right = folder_ / "absent.png";
  EXPECT_THROW(detectBoards(pairs, board, {}, 1, nullptr), ConfigurationError);
}

}  // namespace
}  // namespace scanner::calibration
