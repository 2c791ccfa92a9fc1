#pragma once

#include <opencv2/core.hpp>

#include "scanner/stereo/options.h"

namespace scanner::stereo {

/// Best disparity of each left pixel, CV_32FC1, NaN where the method finds none (texture and
/// uniqueness validation included). Steps of 1/16 px. Values may point outside the right image.
/// Both images CV_8UC1.
cv::Mat searchLeft(const cv::Mat& left, const cv::Mat& right, const MatcherOptions& options);

/// Best disparity of each *right* pixel in the left image, without texture and uniqueness tests.
/// Empty when the method checks both directions by itself (semi_global does).
cv::Mat searchRight(const cv::Mat& left, const cv::Mat& right, const MatcherOptions& options);

}  // namespace scanner::stereo
