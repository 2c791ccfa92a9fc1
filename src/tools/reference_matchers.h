#pragma once

#include <opencv2/core.hpp>
#include <string>

/// OpenCV's matchers, for comparison only.
namespace scanner::tools {

enum class Reference {
  kBlock,            ///< cv::StereoBM
  kSemiGlobal,       ///< cv::StereoSGBM, MODE_SGBM: five paths
  kSemiGlobalThree,  ///< cv::StereoSGBM, MODE_SGBM_3WAY
};

struct ReferenceOptions {
  int min_disparity_px = 0;
  int max_disparity_px = 0;
  /// Window, px; 0: the default of the method (kReferenceBlockWindow, kReferenceSemiGlobalWindow).
  int window_px = 0;
  /// Both pictures are prolonged on the left, so that every column is searched and not only those
  /// whose whole range is in the right image. Costs time; a match in what was added is none.
  bool all_columns = true;
  bool remove_speckles = true;
};
constexpr int kReferenceBlockWindow = 9;
constexpr int kReferenceSemiGlobalWindow = 5;

/// Disparity of the left image, CV_32FC1 px, NaN = none. OpenCV searches a multiple of 16
/// disparities; what lies beyond max_disparity_px is no match. Settings: describeReference().
cv::Mat matchReference(Reference method, const cv::Mat& left_gray, const cv::Mat& right_gray,
                       const ReferenceOptions& options);

/// Disparities that matchReference() really searches.
int referenceDisparities(const ReferenceOptions& options);

/// One line: name, mode and settings.
std::string describeReference(Reference method, const ReferenceOptions& options);

}  // namespace scanner::tools
