#pragma once

#include <cstddef>
#include <opencv2/core.hpp>

/// Validation steps of the matcher (thesis table 3.1). Each sets failing pixels of a CV_32FC1
/// disparity map to NaN and returns how many it removed.
namespace scanner::stereo {

/// Disparities outside [min, max], on a pixel that is not valid in its image, or whose match is
/// closer than `margin` to the side edges of the right image. Masks may be empty.
std::size_t removeOutside(double min_disparity, double max_disparity, int margin,
                          const cv::Mat& left_valid, const cv::Mat& right_valid,
                          cv::Mat& disparity);

/// Pixels whose match does not lead back to within `tolerance` px.
std::size_t removeInconsistent(const cv::Mat& right_disparity, double tolerance,
                               cv::Mat& disparity);

/// Pixels with sigma above the limit.
std::size_t removeImprecise(const cv::Mat& sigma, double max_sigma, cv::Mat& disparity);

/// Connected regions (4 neighbours that differ by no more than `max_step`) of fewer than `min_size`
/// pixels.
std::size_t removeSmallSurfaces(double max_step, int min_size, cv::Mat& disparity);

}  // namespace scanner::stereo
