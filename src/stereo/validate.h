#pragma once

#include <cstddef>
#include <opencv2/core.hpp>

/// Tests on a disparity map (CV_32FC1, NaN = none). Each removes what fails by setting it to NaN
/// and returns how many it removed. Same result for any `threads` (>= 1).
namespace scanner::stereo {

/// Disparities outside [min, max], on a pixel that is not valid in its image, or whose match is
/// closer than `margin` to the side edges of the right image. Masks (CV_8UC1) may be empty.
std::size_t removeOutside(double min_disparity, double max_disparity, int margin,
                          const cv::Mat& left_valid, const cv::Mat& right_valid, cv::Mat& disparity,
                          int threads = 1);

/// Pixels whose match does not lead back to within `tolerance` px. `right_disparity`: of each right
/// pixel, CV_32FC1 with NaN for none, or CV_16SC1 with kNoDisparity (matcher.h).
std::size_t removeInconsistent(const cv::Mat& right_disparity, double tolerance, cv::Mat& disparity,
                               int threads = 1);

/// Pixels whose sigma is above the limit, or NaN.
std::size_t removeImprecise(const cv::Mat& sigma, double max_sigma, cv::Mat& disparity,
                            int threads = 1);

/// Connected regions (4 neighbours that differ by no more than `max_step`) of fewer than `min_size`
/// pixels.
std::size_t removeSmallSurfaces(double max_step, int min_size, cv::Mat& disparity, int threads = 1);

}  // namespace scanner::stereo
