#pragma once

#include <opencv2/core.hpp>

#include "scanner/stereo/options.h"

namespace scanner::stereo {

/// The filter before block matching (thesis table 3.1, "edge enhancement"), CV_8UC1 to CV_8UC1.
///
///   band_pass  four times grey less its mean over edge_mask_px x edge_mask_px, cut at
///              +-edge_limit, plus edge_limit; free of differences of exposure that change over
///              more than the mask
///   sobel      horizontal Sobel gradient, cut and raised likewise
///   none       the grey itself
///
/// The image goes on with its border pixels outside. Same bytes for any `threads`.
cv::Mat enhanceEdges(const cv::Mat& gray, const BlockMatcherOptions& options, int threads);

}  // namespace scanner::stereo
