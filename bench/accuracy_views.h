#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "scanner/stereo/rectify.h"

/// Pairs whose true disparity is known, for stereo_accuracy.
namespace scanner::bench {

/// A rectified pair, the exact disparity of the object (CV_32FC1, NaN elsewhere) and what lies
/// close to a depth edge (CV_8UC1, 255).
struct AccuracyView {
  stereo::RectifiedPair pair;
  cv::Mat truth, near_step;
};

enum class Sensor {
  kIdeal,      ///< neither noise nor mosaic
  kNoiseFree,  ///< mosaic
  kReal,
};

/// Views (by number) of a simulated scene: artwork, totem, target or a mesh file. Throws what the
/// simulator throws.
std::vector<AccuracyView> simulatedViews(const std::string& scene, Sensor sensor,
                                         const std::vector<int>& views, int threads);

/// A recording whose object and motion are known.
struct Recording {
  std::string bag;
  std::string reference;  ///< mesh of the object in the map frame, PLY, metres
  std::string truth;      ///< poses of base_link in map, TUM
};

/// Pairs (by number, from 0) of a recording. Throws std::runtime_error for a file that cannot be
/// read.
std::vector<AccuracyView> recordedViews(const Recording& recording, const std::vector<int>& views,
                                        int threads);

}  // namespace scanner::bench
