#pragma once

#include <opencv2/core.hpp>

/// A pair of pictures to measure speed on: textured surfaces at several depths, slanted and flat,
/// with steps, occlusions and a little noise. The time of a matcher depends on them but little.
namespace scanner::bench {

struct BenchPair {
  cv::Mat left;   ///< CV_8UC1
  cv::Mat right;  ///< CV_8UC1
};

/// Disparities from 15 % to 90 % of the range. The same pictures every time.
BenchPair makeBenchPair(cv::Size size, int min_disparity_px, int max_disparity_px);

}  // namespace scanner::bench
