#pragma once

#include <string>

#include "scanner/core/camera.h"
#include "scanner/core/status.h"
#include "scanner/stereo/options.h"
#include "scanner/stereo/rectify.h"
#include "scanner/stereo/trouble.h"

/// Does a configuration suit a rig and a recording?
namespace scanner::stereo {

/// Standard deviation of the depth, metres: Z^2 sigma_d / (f B). f and sigma_d in pixels, B metres.
double depthSigma(double depth_m, double focal_px, double baseline_m, double sigma_px);
/// Largest depth at which depthSigma stays within `sigma_m`.
double depthForSigma(double sigma_m, double focal_px, double baseline_m, double sigma_px);

struct DepthRange {
  double min_depth_m = 0.0;
  double max_depth_m = 0.0;
};
struct DisparityRange {
  double min_px = 0.0;
  double max_px = 0.0;
};

/// Depths that the disparity range and the depth bounds of `options` let through. max_depth_m is
/// `options.depth.max_depth_m` when the range includes disparity 0; min > max when nothing passes.
DepthRange workingRange(const StereoCalibration& calibration, const StereoOptions& options);

/// The disparities (as matched, offset included) that cover a depth range, rounded outwards.
DisparityRange disparityRange(const StereoCalibration& calibration, const DepthRange& depths);

/// Disparities that a rectified pair really shows: the 2nd and 98th percentile over a search from 0
/// to half the width at reduced size, good to a few pixels. kNotEnoughData when less than 3 %
/// of the image can be matched.
Result<DisparityRange> measureDisparities(const RectifiedPair& pair, int threads);

/// One line when `options` do not suit what the pair shows ("the recording shows disparities ...,
/// the configuration searches ..."), or "".
std::string describeMismatch(const RectifiedPair& pair, const StereoCalibration& calibration,
                             const StereoOptions& options, int threads);

}  // namespace scanner::stereo
