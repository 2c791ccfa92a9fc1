#include "scanner/stereo/triangulate.h"

#include <stdexcept>
#include <vector>

#include "scanner/core/parallel.h"
#include "stereo/triangulate_simd.h"

namespace scanner::stereo {
namespace {

constexpr std::size_t kRowsPerChunk = 32;
static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float) && sizeof(Rgb8) == 3,
              "the kernels write packed points and colours");

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
                           const StereoCalibration& calibration, const DepthOptions& options,
                           int threads) {
  requireImages(disparity, left_color);
  const Status status = scanner::validate(calibration);
  if (!status) throw ConfigurationError(status.message());
  validate(options);
  const double f = calibration.focalLength(), fy = calibration.left.P(1, 1);
  const double cx = calibration.left.P(0, 2), cy = calibration.left.P(1, 2);

  OrganizedCloud out;
  out.stamp = disparity.stamp;
  out.width = disparity.disparity_px.cols;
  out.height = disparity.disparity_px.rows;
  const std::size_t n = disparity.disparity_px.total();
  PointCloud& cloud = out.cloud;
  cloud.points.resize(n);
  cloud.sigmas.resize(n);
  if (!left_color.empty()) cloud.colors.resize(n);
  const auto width = static_cast<std::size_t>(out.width);
  std::vector<double> column(width);
  for (std::size_t u = 0; u < width; ++u) column[u] = (static_cast<double>(u) - cx) / f;

  const auto height = static_cast<std::size_t>(out.height);
  parallelFor(height, kRowsPerChunk, threads, [&](std::size_t begin, std::size_t end) {
    simd::TriangulateRow row;
    row.column = column.data();
    row.offset_px = calibration.disparityOffset();
    row.focal_baseline = f * calibration.baseline();
    row.min_depth_m = options.min_depth_m;
    row.max_depth_m = options.max_depth_m;
    for (std::size_t v = begin; v < end; ++v) {
      const int y = static_cast<int>(v);
      row.disparity_px = disparity.disparity_px.ptr<float>(y);
      row.sigma_px = disparity.sigma_px.ptr<float>(y);
      row.row = (static_cast<double>(v) - cy) / fy;
      row.points = cloud.points[v * width].data();
      row.sigmas = &cloud.sigmas[v * width];
      simd::triangulateRow(row, width);
      if (left_color.empty()) continue;
      simd::swapRedAndBlue(left_color.ptr<std::uint8_t>(y), width, &cloud.colors[v * width].r);
    }
  });
  return out;
}

}  // namespace scanner::stereo
