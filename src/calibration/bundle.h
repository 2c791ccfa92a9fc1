#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "scanner/calibration/stereo_calibration.h"

/// Bundle adjustment of two cameras and the boards they see: Levenberg-Marquardt, the boards' poses
/// eliminated by the Schur complement. OpenCV's stereoCalibrate() minimises the same sum, but
/// through a LAPACK whose rounding depends on where matrices lie in memory, so that two runs
/// differ.
namespace scanner::calibration {

using Views = std::vector<const BoardObservation*>;

inline const std::vector<cv::Point2f>& corners(const BoardObservation& o, int eye) {
  return eye == 0 ? o.left : o.right;
}

/// Places in D (k1 k2 p1 p2 k3 k4 k5 k6) of the coefficients that a model estimates.
std::vector<int> coefficientsOf(Distortion distortion);

/// Board to left camera.
struct BoardPose {
  cv::Vec3d rotation, translation;
};

struct Bundle {
  std::array<cv::Mat, 2> K;         ///< 3x3 CV_64F
  std::array<cv::Mat, 2> D;         ///< 1x5 or 1x8 CV_64F; what the model does not estimate is zero
  cv::Vec3d rotation, translation;  ///< left camera to right camera
  std::vector<BoardPose> poses;     ///< one per view
};

std::vector<cv::Point3d> boardPoints(const Board& board);

/// Without distortion. Nothing when OpenCV finds no pose.
std::optional<Bundle> firstGuess(const Views& views, const Board& board, cv::Size size);

/// Minimises the residuals of all corners over cameras and poses. Returns the sum of squares, px^2.
double adjust(const Views& views, const Board& board, Distortion distortion, Bundle& bundle);

/// Likewise over the pose of one board; the cameras stay. `projected`: corners in both eyes.
double adjustPose(const BoardObservation& view, const Board& board, const Bundle& bundle,
                  BoardPose& pose, std::array<std::vector<cv::Point2d>, 2>& projected);

/// A pose from one eye alone.
BoardPose poseOf(const std::vector<cv::Point2f>& corners, const Board& board, const cv::Mat& K,
                 const cv::Mat& D);

}  // namespace scanner::calibration
