#pragma once

#include <opencv2/core.hpp>

#include "scanner/core/time.h"

namespace scanner {

/// Pixel layout of an 8-bit image. Colour images are stored in OpenCV's order (BGR).
enum class PixelFormat { kMono8, kBgr8, kBayerRggb8, kBayerBggr8, kBayerGbrg8, kBayerGrbg8 };

const char* toString(PixelFormat format);
inline bool isBayer(PixelFormat f) { return f != PixelFormat::kMono8 && f != PixelFormat::kBgr8; }

/// One picture: CV_8UC1 for mono and Bayer, CV_8UC3 for BGR. The pixels are shared and treated as
/// immutable; whoever wants to write clones.
struct Image {
  cv::Mat data;
  PixelFormat format = PixelFormat::kMono8;
};

/// The two raw pictures of one exposure. Both were taken at `stamp` (mid-exposure).
struct StereoFrame {
  Time stamp;
  Image left;
  Image right;
};

/// Disparity of the rectified left image.
struct DisparityImage {
  Time stamp;
  cv::Mat disparity_px;  ///< CV_32FC1, pixels, NaN where unknown; positive, x_left - x_right
  cv::Mat sigma_px;  ///< CV_32FC1, standard deviation of the disparity, pixels, NaN where unknown
  double min_disparity_px = 0.0;
  double max_disparity_px = 0.0;
};

}  // namespace scanner
