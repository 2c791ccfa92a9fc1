#include "tools/reference_matchers.h"

#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace scanner::tools {
namespace {

// What OpenCV's own stereo sample and documentation use, or the middle of what they recommend.
constexpr int kFilterCap = 31;
constexpr int kTexture = 10;
constexpr int kUniqueness = 10;
constexpr int kLeftRight = 1;
constexpr int kSpeckleSize = 100;
constexpr int kSpeckleRange = 2;

int window(Reference method, const ReferenceOptions& options) {
  if (options.window_px > 0) return options.window_px;
  return method == Reference::kBlock ? kReferenceBlockWindow : kReferenceSemiGlobalWindow;
}

cv::Ptr<cv::StereoMatcher> make(Reference method, const ReferenceOptions& options) {
  const int size = window(method, options);
  const int count = referenceDisparities(options);
  const int speckle_size = options.remove_speckles ? kSpeckleSize : 0;
  if (method == Reference::kBlock) {
    const auto matcher = cv::StereoBM::create(count, size);
    matcher->setMinDisparity(options.min_disparity_px);
    matcher->setPreFilterType(cv::StereoBM::PREFILTER_XSOBEL);
    matcher->setPreFilterSize(9);
    matcher->setPreFilterCap(kFilterCap);
    matcher->setTextureThreshold(kTexture);
    matcher->setUniquenessRatio(kUniqueness);
    matcher->setDisp12MaxDiff(kLeftRight);
    matcher->setSpeckleWindowSize(speckle_size);
    // In sixteenths here, in whole pixels for StereoSGBM.
    matcher->setSpeckleRange(kSpeckleRange * cv::StereoMatcher::DISP_SCALE);
    return matcher;
  }
  const int area = size * size;
  return cv::StereoSGBM::create(options.min_disparity_px, count, size, 8 * area, 32 * area,
                                kLeftRight, kFilterCap, kUniqueness, speckle_size, kSpeckleRange,
                                method == Reference::kSemiGlobal ? cv::StereoSGBM::MODE_SGBM
                                                                 : cv::StereoSGBM::MODE_SGBM_3WAY);
}

cv::Mat prolonged(const cv::Mat& image, int columns) {
  if (columns == 0) return image;
  cv::Mat out;
  cv::copyMakeBorder(image, out, 0, 0, columns, 0, cv::BORDER_REPLICATE);
  return out;
}

}  // namespace

int referenceDisparities(const ReferenceOptions& options) {
  return (options.max_disparity_px - options.min_disparity_px) / 16 * 16 + 16;
}

cv::Mat matchReference(Reference method, const cv::Mat& left_gray, const cv::Mat& right_gray,
                       const ReferenceOptions& options) {
  const int border =
      options.all_columns
          ? options.min_disparity_px + referenceDisparities(options) + window(method, options) / 2
          : 0;
  cv::Mat fixed;
  make(method, options)
      ->compute(prolonged(left_gray, border), prolonged(right_gray, border), fixed);
  cv::Mat disparity(left_gray.size(), CV_32FC1);
  for (int y = 0; y < disparity.rows; ++y) {
    const short* from = fixed.ptr<short>(y) + border;
    float* to = disparity.ptr<float>(y);
    for (int x = 0; x < disparity.cols; ++x) {
      const float d = static_cast<float>(from[x]) / cv::StereoMatcher::DISP_SCALE;
      const bool found = d >= static_cast<float>(options.min_disparity_px) &&
                         d <= static_cast<float>(options.max_disparity_px) &&
                         d <= static_cast<float>(x);
      to[x] = found ? d : std::numeric_limits<float>::quiet_NaN();
    }
  }
  return disparity;
}

std::string describeReference(Reference method, const ReferenceOptions& options) {
  const int size = window(method, options);
  std::string text = method == Reference::kBlock ? "OpenCV " CV_VERSION " StereoBM"
                     : method == Reference::kSemiGlobal
                         ? "OpenCV " CV_VERSION " StereoSGBM MODE_SGBM (5 paths)"
                         : "OpenCV " CV_VERSION " StereoSGBM MODE_SGBM_3WAY";
  text += ", window " + std::to_string(size);
  if (method == Reference::kBlock) {
    text +=
        ", x-Sobel cut at " + std::to_string(kFilterCap) + ", texture " + std::to_string(kTexture);
  } else {
    text += ", P1 " + std::to_string(8 * size * size) + ", P2 " + std::to_string(32 * size * size) +
            ", cut at " + std::to_string(kFilterCap);
  }
  text += ", uniqueness " + std::to_string(kUniqueness) + " %, left-right " +
          std::to_string(kLeftRight) + " px, speckle " + std::to_string(kSpeckleSize) + " / " +
          std::to_string(kSpeckleRange) + " px";
  return text;
}

}  // namespace scanner::tools
