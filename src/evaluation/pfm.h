#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "scanner/core/status.h"

namespace scanner::evaluation {

/// Reads a portable float map of one channel ("Pf"): rows from the bottom up, little endian when
/// the scale is negative. CV_32FC1, values as they are in the file. kIoError when the file is
/// absent, kInvalidInput when it is something else or cut short.
Result<cv::Mat> readPfm(const std::string& path);

}  // namespace scanner::evaluation
