#pragma once

#include "calibration/stereo_fit.h"

/// Which views can be used, and whether they suffice.
namespace scanner::calibration {

/// What to do about views that are too few or too alike.
extern const char* const kTakeMore;

/// From a 3x3 rotation and a 3x1 translation, CV_64F.
Eigen::Isometry3d pose(const cv::Mat& rotation, const cv::Mat& translation);
Eigen::Isometry3d pose(const BoardPose& board);

ViewDiversity diversity(const Views& views, const Board& board, cv::Size size,
                        const StereoFit& fit);

/// kNotEnoughData when the views are too alike.
Status checkDiversity(const ViewDiversity& diversity, const StereoCalibrationOptions& options);

/// kInvalidInput when the right camera does not stand to the right of the left one.
Status checkEyes(const StereoFit& fit);

/// The views that agree, and the notes on those that do not.
struct Screening {
  Views used;
  std::vector<std::string> notes;  ///< one per observation
};

/// Leaves out one view after the other that the rest disagrees with.
Result<Screening> screen(const std::vector<BoardObservation>& observations, const Board& board,
                         cv::Size size, const StereoCalibrationOptions& options, int threads);

}  // namespace scanner::calibration
