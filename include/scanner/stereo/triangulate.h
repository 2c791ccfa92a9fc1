#pragma once

#include <opencv2/core.hpp>

#include "scanner/core/camera.h"
#include "scanner/core/cloud.h"
#include "scanner/core/image.h"
#include "scanner/stereo/options.h"

namespace scanner::stereo {

/// Depth from disparity (thesis eq. 2.15) with d = disparity - calibration.disparityOffset():
///
///     Z = f B / d,   X = (u - cx) Z / f,   Y = (v - cy) Z / fy,   sigma_Z = Z^2 sigma_d / (f B)
///
/// Frame: rectified left optical (x right, y down, z forward), metres. Row-major, one point per
/// pixel; points and sigmas are NaN where the disparity is NaN, d <= 0, or Z is outside the depth
/// bounds. Colours are the pixels of `left_color` (CV_8UC3 BGR, or empty for no colours). Throws
/// std::invalid_argument when sizes or types disagree, ConfigurationError for a bad calibration.
/// Same bytes for any `threads` (>= 1).
OrganizedCloud triangulate(const DisparityImage& disparity, const cv::Mat& left_color,
                           const StereoCalibration& calibration, const DepthOptions& options,
                           int threads = 1);

}  // namespace scanner::stereo
