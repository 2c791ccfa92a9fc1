#pragma once

#include <cstddef>
#include <limits>
#include <opencv2/core.hpp>

#include "scanner/stereo/rectify.h"

/// A quick look at a pair, at a fraction of its size: which disparities it shows, and whether it
/// shows any. Integers throughout, so that the same pair gives the same answer everywhere.
namespace scanner::stereo {

/// `CoarseMatch::disparity` where nothing was found.
constexpr short kNoCoarseDisparity = std::numeric_limits<short>::min();

/// A pair reduced by a whole factor: every pixel is the mean of factor x factor pixels.
struct CoarsePair {
  int factor = 1;
  cv::Mat left, right;              ///< CV_8UC1
  cv::Mat left_valid, right_valid;  ///< CV_8UC1, 255 where all pixels below are valid
};

struct CoarseMatch {
  cv::Mat disparity;  ///< CV_16SC1, whole coarse pixels, or kNoCoarseDisparity
  std::size_t pixels = 0;
  std::size_t found = 0;  ///< pixels with a disparity
};

/// Mean over factor x factor blocks, rounded; CV_8UC1. What is left over on the right and below is
/// cut off.
cv::Mat boxReduced(const cv::Mat& image, int factor);

CoarsePair coarsePair(const RectifiedPair& pair, int factor);

/// Pixels whose surroundings show enough texture to be matched at all.
std::size_t texturedPixels(const cv::Mat& gray);

/// The pair with its right picture taken `rows` coarse rows further down (up, when negative).
CoarsePair withRowsMoved(const CoarsePair& pair, int rows);

/// Disparities from min_px (may be negative) to max_px coarse pixels. A pixel counts when both
/// directions agree, the eyes look alike around it and it lies on a piece of at least `min_piece`
/// pixels.
CoarseMatch coarseMatch(const CoarsePair& pair, int min_px, int max_px, int min_piece, int threads);

}  // namespace scanner::stereo
