#include "stereo/search.h"

#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace scanner::stereo {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

/// OpenCV searches a multiple of 16 disparities.
int disparityCount(const MatcherOptions& o) {
  return (o.max_disparity_px - o.min_disparity_px) / 16 * 16 + 16;
}

/// OpenCV skips every column whose range leaves the image even in part. With this border on the
/// left, all columns are searched; matches that lie in the border are thrown away afterwards.
int borderWidth(const MatcherOptions& o) {
  const int radius = o.method == MatchMethod::kBlock ? o.block.window_px / 2 : 0;
  return o.min_disparity_px + disparityCount(o) + radius;
}

cv::Mat withBorder(const cv::Mat& image, int width) {
  cv::Mat out;
  cv::copyMakeBorder(image, out, 0, 0, width, 0, cv::BORDER_REPLICATE);
  return out;
}

cv::Mat fromFixedPoint(const cv::Mat& fixed, int border, int min_disparity) {
  const cv::Mat inner = fixed.colRange(border, fixed.cols);
  cv::Mat out(inner.size(), CV_32FC1);
  const int lowest = min_disparity * cv::StereoMatcher::DISP_SCALE;
  for (int y = 0; y < inner.rows; ++y) {
    const short* from = inner.ptr<short>(y);
    float* to = out.ptr<float>(y);
    for (int x = 0; x < inner.cols; ++x) {
      to[x] = from[x] < lowest ? kNan : static_cast<float>(from[x]) / cv::StereoMatcher::DISP_SCALE;
    }
  }
  return out;
}

cv::Mat searchBlock(const cv::Mat& left, const cv::Mat& right, const MatcherOptions& o,
                    bool validate) {
  const BlockMatcherOptions& block = o.block;
  const auto matcher = cv::StereoBM::create(disparityCount(o), block.window_px);
  matcher->setMinDisparity(o.min_disparity_px);
  matcher->setPreFilterType(block.edge_enhancement == EdgeEnhancement::kBandPass
                                ? cv::StereoBM::PREFILTER_NORMALIZED_RESPONSE
                                : cv::StereoBM::PREFILTER_XSOBEL);
  matcher->setPreFilterSize(block.edge_mask_px);
  matcher->setPreFilterCap(block.edge_limit);
  const double area = static_cast<double>(block.window_px) * block.window_px;
  matcher->setTextureThreshold(
      validate && o.validation.texture ? cvRound(o.validation.texture_threshold * area) : 0);
  matcher->setUniquenessRatio(
      validate && o.validation.uniqueness ? cvRound(o.validation.uniqueness_percent) : 0);
  matcher->setDisp12MaxDiff(-1);
  matcher->setSpeckleWindowSize(0);
  const int border = borderWidth(o);
  cv::Mat fixed;
  matcher->compute(withBorder(left, border), withBorder(right, border), fixed);
  return fromFixedPoint(fixed, border, o.min_disparity_px);
}

/// Removes pixels whose window holds less of the Sobel-filtered image, which semi-global matching
/// works on, than the texture threshold. The block matcher has this test inside.
void removeUntextured(const cv::Mat& left, const MatcherOptions& o, cv::Mat& disparity) {
  cv::Mat gradient, mean;
  cv::Sobel(left, gradient, CV_16S, 1, 0);
  cv::boxFilter(cv::abs(gradient), mean, CV_32F, cv::Size(o.block.window_px, o.block.window_px));
  disparity.setTo(kNan, mean < o.validation.texture_threshold);
}

cv::Mat searchSemiGlobal(const cv::Mat& left, const cv::Mat& right, const MatcherOptions& o) {
  const SemiGlobalOptions& sg = o.semi_global;
  const ValidationOptions& v = o.validation;
  int mode = cv::StereoSGBM::MODE_SGBM_3WAY;
  if (sg.paths == SemiGlobalPaths::kFive) mode = cv::StereoSGBM::MODE_SGBM;
  if (sg.paths == SemiGlobalPaths::kEight) mode = cv::StereoSGBM::MODE_HH;
  const int area = sg.window_px * sg.window_px;
  const auto matcher = cv::StereoSGBM::create(
      o.min_disparity_px, disparityCount(o), sg.window_px, sg.small_step_penalty * area,
      sg.large_step_penalty * area, v.back_and_forth ? cvRound(v.back_and_forth_tolerance_px) : -1,
      sg.edge_limit, v.uniqueness ? cvRound(v.uniqueness_percent) : 0, 0, 0, mode);
  const int border = borderWidth(o);
  cv::Mat fixed;
  matcher->compute(withBorder(left, border), withBorder(right, border), fixed);
  cv::Mat disparity = fromFixedPoint(fixed, border, o.min_disparity_px);
  if (v.texture) removeUntextured(left, o, disparity);
  return disparity;
}

cv::Mat mirrored(const cv::Mat& image) {
  cv::Mat out;
  cv::flip(image, out, 1);
  return out;
}

}  // namespace

cv::Mat searchLeft(const cv::Mat& left, const cv::Mat& right, const MatcherOptions& options) {
  return options.method == MatchMethod::kBlock ? searchBlock(left, right, options, true)
                                               : searchSemiGlobal(left, right, options);
}

cv::Mat searchRight(const cv::Mat& left, const cv::Mat& right, const MatcherOptions& options) {
  if (options.method != MatchMethod::kBlock) return {};
  // In the mirrored pair the right eye is the left one.
  return mirrored(searchBlock(mirrored(right), mirrored(left), options, false));
}

}  // namespace scanner::stereo
