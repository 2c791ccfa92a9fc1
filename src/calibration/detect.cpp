#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "scanner/calibration/stereo_calibration.h"

namespace scanner::calibration {
namespace {

using Corners = std::vector<cv::Point2f>;

std::size_t at(const Board& board, int column, int row) {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(board.columns) +
         static_cast<std::size_t>(column);
}

/// Distance of the closest two neighbours, px: how small the squares are where they are smallest.
double smallestSquare(const Corners& corners, const Board& board) {
  double smallest = 1e9;
  for (int r = 0; r < board.rows; ++r) {
    for (int c = 0; c < board.columns; ++c) {
      const cv::Point2f p = corners[at(board, c, r)];
      if (c > 0) smallest = std::min(smallest, cv::norm(p - corners[at(board, c - 1, r)]));
      if (r > 0) smallest = std::min(smallest, cv::norm(p - corners[at(board, c, r - 1)]));
    }
  }
  return smallest;
}

/// x runs to the right of y as in a picture of the board's front.
bool rightHanded(const Corners& corners, const Board& board) {
  const cv::Point2f origin = corners.front();
  const cv::Point2f x = corners[at(board, board.columns - 1, 0)] - origin;
  const cv::Point2f y = corners[at(board, 0, board.rows - 1)] - origin;
  return x.cross(y) > 0.0f;
}

Corners mirrored(const Corners& corners, const Board& board) {
  Corners out;
  for (int r = 0; r < board.rows; ++r) {
    for (int c = board.columns - 1; c >= 0; --c) out.push_back(corners[at(board, c, r)]);
  }
  return out;
}

/// The same corners numbered from the next corner of a square board.
Corners turned(const Corners& corners, const Board& board) {
  Corners out;
  for (int r = 0; r < board.rows; ++r) {
    for (int c = 0; c < board.columns; ++c) {
      out.push_back(corners[at(board, r, board.columns - 1 - c)]);
    }
  }
  return out;
}

cv::Point2f mean(const Corners& corners) {
  cv::Point2f sum(0.0f, 0.0f);
  for (const cv::Point2f& p : corners) sum += p;
  return sum * (1.0f / static_cast<float>(corners.size()));
}

/// How well the two shapes agree, apart from their places: large is good.
double agreement(const Corners& a, const Corners& b) {
  const cv::Point2f mean_a = mean(a), mean_b = mean(b);
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - mean_a).dot(b[i] - mean_b);
  return sum;
}

}  // namespace

std::vector<cv::Point2f> detectBoard(const cv::Mat& gray, const Board& board,
                                     const StereoCalibrationOptions& options) {
  const cv::Size size(board.columns, board.rows);
  Corners corners;
  // In the sector-based finder a board too large for the picture is an error, not a miss.
  try {
    if (!cv::findChessboardCorners(gray, size, corners,
                                   cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE) &&
        !cv::findChessboardCornersSB(gray, size, corners,
                                     cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE)) {
      return {};
    }
  } catch (const cv::Exception&) {
    return {};
  }
  const double square = smallestSquare(corners, board);
  const int half =
      std::clamp(static_cast<int>(std::lround(options.corner_window_share * square)), 2, 20);
  const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-4);
  cv::cornerSubPix(gray, corners, cv::Size(half, half), cv::Size(-1, -1), stop);
  return corners;
}

void alignCornerOrder(const Board& board, BoardObservation& observation) {
  for (Corners* corners : {&observation.left, &observation.right}) {
    if (!rightHanded(*corners, board)) *corners = mirrored(*corners, board);
  }
  Corners candidate = observation.right, best = candidate;
  double best_agreement = agreement(observation.left, candidate);
  const bool square = board.columns == board.rows;
  for (int turn = 1; turn < (square ? 4 : 2); ++turn) {
    if (square) {
      candidate = turned(candidate, board);
    } else {
      std::reverse(candidate.begin(), candidate.end());
    }
    const double now = agreement(observation.left, candidate);
    if (now <= best_agreement) continue;
    best_agreement = now;
    best = candidate;
  }
  observation.right = best;
}

Result<BoardObservation> detectBoards(const std::string& name, const cv::Mat& left,
                                      const cv::Mat& right, const Board& board,
                                      const StereoCalibrationOptions& options) {
  validate(board);
  if (left.type() != CV_8UC1 || right.type() != CV_8UC1 || left.empty() || right.empty()) {
    return Status(StatusCode::kInvalidInput, name + ": pictures must be 8-bit grey");
  }
  if (left.size() != right.size()) {
    return Status(StatusCode::kInvalidInput, name + ": the two pictures differ in size");
  }
  BoardObservation observation;
  observation.name = name;
  observation.left = detectBoard(left, board, options);
  observation.right = detectBoard(right, board, options);
  if (observation.left.empty() || observation.right.empty()) {
    const bool both = observation.left.empty() && observation.right.empty();
    return Status(StatusCode::kNotEnoughData,
                  name + ": no whole board in " +
                      (both ? "either" : (observation.left.empty() ? "the left" : "the right")) +
                      " picture");
  }
  alignCornerOrder(board, observation);
  return observation;
}

}  // namespace scanner::calibration
