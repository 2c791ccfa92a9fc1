#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calibration/bundle.h"
#include "scanner/calibration/stereo_calibration.h"

/// One calibration with a given distortion model from given views: what the selection of models and
/// views repeats. Eye 0 is the left one.
namespace scanner::calibration {

struct StereoFit {
  Distortion distortion = Distortion::kK1;
  std::array<cv::Mat, 2> K;  ///< 3x3 CV_64F
  std::array<cv::Mat, 2> D;  ///< 1x5 (plumb_bob) or 1x8 (rational) CV_64F
  cv::Mat R, t;              ///< left camera to right camera, 3x3 and 3x1 CV_64F
  double rms_px = 0.0;       ///< length of the residual, over all corners of both eyes
};

/// A board under a fit.
struct BoardFit {
  BoardPose pose;
  std::array<std::vector<cv::Point2f>, 2> residual;  ///< measured minus projected
  std::array<double, 2> mean_square = {0.0, 0.0};    ///< px^2
  double meanSquare() const { return 0.5 * (mean_square[0] + mean_square[1]); }
};

/// Nothing when the optimisation breaks down. `start` (may be null, of the same model) saves the
/// search for a first guess.
std::optional<StereoFit> fitStereo(const Views& views, const Board& board, cv::Size size,
                                   Distortion distortion, const StereoFit* start);

/// The pose of the board that fits both eyes best; the cameras stay.
BoardFit fitBoard(const BoardObservation& view, const Board& board, const StereoFit& fit);

/// Whether the radial function grows all the way to the farthest corner of both pictures; else two
/// rays meet in one pixel, and rectification folds.
bool oneToOne(const StereoFit& fit, cv::Size size);

/// Rays of the four corners of both pictures relative to the ray of the middle, scaled by the focal
/// length: px.
std::vector<cv::Point2d> cornerRays(const StereoFit& fit, cv::Size size);

}  // namespace scanner::calibration
