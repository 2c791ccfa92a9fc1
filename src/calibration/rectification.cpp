#include "calibration/rectification.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

namespace scanner::calibration {
namespace {

const cv::TermCriteria kExact(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-12);

std::vector<cv::Point2d> rectified(const std::vector<cv::Point2d>& raw, const CameraModel& camera) {
  cv::Mat K, R, P;
  cv::eigen2cv(camera.K, K);
  cv::eigen2cv(camera.R, R);
  cv::eigen2cv(camera.P, P);
  std::vector<cv::Point2d> out;
  cv::undistortPoints(raw, out, K, camera.D, R, P, kExact);
  return out;
}

/// Share of the raw picture that comes to lie inside the rectified one.
double keptShare(const CameraModel& camera) {
  constexpr int kSteps = 64;
  std::vector<cv::Point2d> raw;
  for (int j = 0; j < kSteps; ++j) {
    for (int i = 0; i < kSteps; ++i) {
      raw.emplace_back((i + 0.5) * camera.width / kSteps - 0.5,
                       (j + 0.5) * camera.height / kSteps - 0.5);
    }
  }
  std::size_t inside = 0;
  for (const cv::Point2d& p : rectified(raw, camera)) {
    const bool in =
        p.x >= -0.5 && p.y >= -0.5 && p.x <= camera.width - 0.5 && p.y <= camera.height - 0.5;
    inside += in ? 1U : 0U;
  }
  return static_cast<double>(inside) / static_cast<double>(raw.size());
}

CameraModel camera(const StereoFit& fit, std::size_t eye, cv::Size size, const cv::Mat& R,
                   const cv::Mat& P) {
  CameraModel model;
  model.width = size.width;
  model.height = size.height;
  model.distortion_model = fit.D[eye].cols == 8 ? "rational_polynomial" : "plumb_bob";
  model.D.assign(fit.D[eye].begin<double>(), fit.D[eye].end<double>());
  cv::cv2eigen(fit.K[eye], model.K);
  cv::cv2eigen(R, model.R);
  cv::cv2eigen(P, model.P);
  return model;
}

Rectification withAlpha(const StereoFit& fit, cv::Size size, double alpha) {
  cv::Mat R1, R2, P1, P2, Q;
  cv::stereoRectify(fit.K[0], fit.D[0], fit.K[1], fit.D[1], size, fit.R, fit.t, R1, R2, P1, P2, Q,
                    cv::CALIB_ZERO_DISPARITY, alpha, size);
  Rectification r;
  r.calibration = {camera(fit, 0, size, R1, P1), camera(fit, 1, size, R2, P2)};
  r.alpha = alpha;
  r.kept_share = {keptShare(r.calibration.left), keptShare(r.calibration.right)};
  const double original = 0.5 * (fit.K[0].at<double>(0, 0) + fit.K[1].at<double>(0, 0));
  r.focal_change = r.calibration.focalLength() / original - 1.0;
  return r;
}

}  // namespace

Rectification rectification(const StereoFit& fit, cv::Size size,
                            const StereoCalibrationOptions& options) {
  // With alpha the focal length falls from "no pixel without a picture" to "the whole picture".
  constexpr int kSteps = 20;
  Rectification best = withAlpha(fit, size, 0.0);
  for (int i = 1; i <= kSteps; ++i) {
    const bool enough = std::min(best.kept_share[0], best.kept_share[1]) >= options.kept_share;
    const bool close = best.focal_change <= options.max_focal_change;
    if (enough && close) break;
    Rectification next = withAlpha(fit, size, static_cast<double>(i) / kSteps);
    if (next.focal_change < -options.max_focal_change) break;
    best = std::move(next);
  }
  return best;
}

std::vector<double> epipolarErrors(const Views& views, const StereoCalibration& calibration) {
  std::vector<double> errors;
  for (const BoardObservation* view : views) {
    const auto left = rectified({view->left.begin(), view->left.end()}, calibration.left);
    const auto right = rectified({view->right.begin(), view->right.end()}, calibration.right);
    for (std::size_t i = 0; i < left.size(); ++i)
      errors.push_back(std::abs(left[i].y - right[i].y));
  }
  return errors;
}

}  // namespace scanner::calibration
