#include "scanner/stereo/triangulate.h"

#include <cmath>
#include <limits>
#include <stdexcept>

namespace scanner::stereo {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

void requireImages(const DisparityImage& d, const cv::Mat& color) {
  const cv::Size size = d.disparity_px.size();
  const bool ok = d.disparity_px.type() == CV_32FC1 && d.sigma_px.type() == CV_32FC1 &&
                  d.sigma_px.size() == size &&
                  (color.empty() || (color.type() == CV_8UC3 && color.size() == size));
  if (!ok) {
    throw std::invalid_argument(
        "triangulate: needs CV_32FC1 disparity and sigma and a CV_8UC3 image of equal size");
  }
}

}  // namespace

OrganizedCloud triangulate(const DisparityImage& disparity, const cv::Mat& left_color,
                           const StereoCalibration& calibration, const DepthOptions& options) {
  requireImages(disparity, left_color);
  const Status status = scanner::validate(calibration);
  if (!status) throw ConfigurationError(status.message());
  validate(options);
  const double f = calibration.focalLength(), fy = calibration.left.P(1, 1);
  const double cx = calibration.left.P(0, 2), cy = calibration.left.P(1, 2);
  const double fb = f * calibration.baseline(), offset = calibration.disparityOffset();

  OrganizedCloud out;
  out.stamp = disparity.stamp;
  out.width = disparity.disparity_px.cols;
  out.height = disparity.disparity_px.rows;
  const std::size_t n = disparity.disparity_px.total();
  PointCloud& cloud = out.cloud;
  cloud.points.assign(n, Eigen::Vector3f::Constant(kNan));
  cloud.sigmas.assign(n, kNan);
  if (!left_color.empty()) cloud.colors.resize(n);
  std::size_t i = 0;
  for (int v = 0; v < out.height; ++v) {
    const float* d_row = disparity.disparity_px.ptr<float>(v);
    const float* sigma_row = disparity.sigma_px.ptr<float>(v);
    const cv::Vec3b* color_row = left_color.empty() ? nullptr : left_color.ptr<cv::Vec3b>(v);
    for (int u = 0; u < out.width; ++u, ++i) {
      if (color_row != nullptr)
        cloud.colors[i] = {color_row[u][2], color_row[u][1], color_row[u][0]};
      const double d = static_cast<double>(d_row[u]) - offset;
      if (!(d > 0.0)) continue;  // NaN too
      const double z = fb / d;
      if (z < options.min_depth_m || z > options.max_depth_m) continue;
      cloud.points[i] = Eigen::Vector3d((u - cx) * z / f, (v - cy) * z / fy, z).cast<float>();
      cloud.sigmas[i] = static_cast<float>(z * z * static_cast<double>(sigma_row[u]) / fb);
    }
  }
  return out;
}

}  // namespace scanner::stereo
