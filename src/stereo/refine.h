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
///     L(x, y) - R(x - d(x, y), y)  =  g delta + gain R + offset + noise,   g = -L_x / (1 - d_x)
///
/// is free of the slope of the surface (Lucas and Kanade 1981 with the warp taken per pixel). The
/// gradient is the left image's, not that of the resampled right one: the noise of what is
/// resampled goes along with its own gradient, and would draw the result to whole pixels. 1 - d_x
/// is how much longer a piece of surface is in the left image. The correction delta of a pixel is
/// the window's least-squares solution, gain and offset eliminated.
/// Before each step d is averaged over pairs of pixels opposite each other, along the row and then
/// along the column: that takes out the matcher's bias towards whole pixels and the frequencies
/// that a box filter passes with the wrong sign, and leaves planes as they are. Pairs that do not
/// lie on the centre's surface are left out. The result is averaged once more over a smaller
/// window.
///
/// A pixel whose window keeps more residual variance than noise plus `max_residual_share` of the
/// window's contrast is given up: that is the rim of wrong depth which a block matcher puts round
/// everything in front (infinity: keep). So is one that ends further than max_correction_px from
/// its start.
///
/// sigma^2 = s^2 (1 + s^2 / tail^2)
///     s^2 = noise_gain max(residual variance, image_noise^2) / N
///         + step_gain <step^2> + roughness_gain <change^2> + floor^2
///
/// with N the reduced normal matrix (the window's information on delta), <step^2> the mean square
/// over the window of what the last step moved, and <change^2> of what the last averaging took off.
/// The first term is the noise of the images; the other two measure, on the disparities themselves,
/// how much shape (steps, curvature) the window could not follow. Where these are large some pixels
/// are off altogether, which the factor allows for. The gains were fitted on views 5, 20, 33 and 44
/// of three simulated statues with and without noise (artwork, totem, venus_de_milo), so that every
/// decile of the prediction is right; bench/stereo_accuracy.cpp checks them on other views.
///
/// Single precision throughout: sums go over the window only and start anew in every row. Same
/// bytes for any `threads` (>= 1) and any instruction set.
///
/// `left`, `right`: CV_32FC1 grey levels, same size. `right_valid`: CV_8UC1 or empty.
std::size_t refineByGradient(const cv::Mat& left, const cv::Mat& right, const cv::Mat& right_valid,
                             const RefinementOptions& options, double max_residual_share,
                             int threads, cv::Mat& disparity, cv::Mat& sigma);

}  // namespace scanner::stereo
