#pragma once

#include <cstddef>
#include <opencv2/core.hpp>

#include "scanner/stereo/options.h"

namespace scanner::stereo {

/// Gives every pixel a disparity, for comparison with dense methods and for pictures. Filled
/// disparities are guesses: nothing that is measured or built uses them.
///
/// `disparity`: CV_32FC1, px, NaN where unknown. `guide`: left picture of the same size, CV_8UC3 or
/// CV_8UC1. Holes take the further one of the surfaces on both sides in their row, as what one eye
/// alone sees lies behind (Hirschmueller 2008, section 2.6), each continued as the plane that it is
/// beside the hole; rows without any disparity take the row above or below. Then filled pixels and
/// those near steps of depth become the median of their surroundings, weighted by likeness of
/// colour, which moves steps to the edges of the picture (Ma et al. 2013, "Constant time weighted
/// median filtering for stereo matching and beyond"); filled ones have less say in it.
///
/// Without any disparity at all the result is NaN everywhere. Same bytes for any `threads` >= 1.
/// Throws std::invalid_argument for sizes or types that do not suit. 10 to 20 microseconds for
/// each filled pixel and each near a step.
cv::Mat fill(const cv::Mat& disparity, const cv::Mat& guide, int threads);

/// Gives pixels without disparity that are no further than `options.reach_px` from one with a
/// disparity what fill() says, and a sigma of `options.sigma_px` for each pixel of that distance.
/// Where there was a disparity, it and its sigma stay. `sigma` has the size and type of
/// `disparity`. Returns how many were filled; errors and threads as fill().
std::size_t interpolate(const cv::Mat& guide, const InterpolationOptions& options, int threads,
                        cv::Mat& disparity, cv::Mat& sigma);

}  // namespace scanner::stereo
