#pragma once

#include <opencv2/core.hpp>

#include "scanner/stereo/options.h"

namespace scanner::stereo {

/// Improves a disparity map (CV_32FC1, NaN = none) in place by least squares on the image gradient,
/// and gives the standard deviation of the result (CV_32FC1, pixels). Returns how many pixels it
/// had to give up (set to NaN).
///
/// Every pixel is compared with the right image at *its own* disparity, so that inside the window
///
///     L(x, y) - R(x - d(x, y), y)  =  g delta + gain R + offset + noise,    g = -(L_x + R_x) / 2
///
/// is free of the slope of the surface (Lucas and Kanade 1981 with the warp taken per pixel). The
/// correction delta of a pixel is the window's least-squares solution, gain and offset eliminated;
/// all sums are box filters. d is first averaged over pairs of pixels opposite each other round the
/// centre, which takes out the 1/16 px steps of the matcher and leaves planes as they are. Before
/// each step it is averaged again: a box filter passes some frequencies with the wrong sign, and
/// repeated steps would blow those up. The result is averaged once more over a smaller window.
///
/// A pixel whose window keeps more residual variance than noise plus `max_residual_share` of the
/// window's contrast is given up: that is the rim of wrong depth which a block matcher puts round
/// everything in front (infinity: keep).
///
/// sigma^2 = noise_correlation * max(residual variance, image_noise^2) / N + floor^2, where N is
/// the reduced normal matrix (the window's information on delta), `noise_correlation` accounts for
/// noise that neighbouring pixels share, and `floor` for the alignment of the cameras.
///
/// `left`, `right`: CV_32FC1, same size, low-passed. `right_valid`: CV_8UC1 or empty.
std::size_t refineByGradient(const cv::Mat& left, const cv::Mat& right, const cv::Mat& right_valid,
                             const RefinementOptions& options, double max_residual_share,
                             int threads, cv::Mat& disparity, cv::Mat& sigma);

}  // namespace scanner::stereo
