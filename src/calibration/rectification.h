#pragma once

#include "calibration/stereo_fit.h"

namespace scanner::calibration {

struct Rectification {
  StereoCalibration calibration;
  double alpha = 0.0;
  std::array<double, 2> kept_share = {0.0, 0.0};
  double focal_change = 0.0;  ///< rectified by original - 1
};

/// See calibrateStereo(). May break down with cv::Exception, or give what scanner::validate()
/// refuses, when the cameras look in very different directions.
Rectification rectification(const StereoFit& fit, cv::Size size,
                            const StereoCalibrationOptions& options);

/// |y_left - y_right| of every corner after rectification.
std::vector<double> epipolarErrors(const Views& views, const StereoCalibration& calibration);

}  // namespace scanner::calibration
