#include <Eigen/Core>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>

#include "scanner/calibration/calibration_files.h"

namespace scanner::calibration {
namespace {

const cv::Scalar kUsed(0, 150, 0), kLeftOut(0, 0, 220), kHull(200, 120, 0), kInk(60, 60, 60);

cv::Mat rectify(const cv::Mat& picture, const CameraModel& camera) {
  cv::Mat K, R, P, map_x, map_y, color, out;
  cv::eigen2cv(camera.K, K);
  cv::eigen2cv(camera.R, R);
  cv::eigen2cv(camera.P, P);
  cv::initUndistortRectifyMap(K, camera.D, R, P, picture.size(), CV_32FC1, map_x, map_y);
  color = picture;
  if (picture.channels() == 1) cv::cvtColor(picture, color, cv::COLOR_GRAY2BGR);
  cv::remap(color, out, map_x, map_y, cv::INTER_LINEAR);
  return out;
}

/// Corners and residual vectors of one eye on white.
cv::Mat residualsOf(const StereoCalibrationReport& report, bool left) {
  constexpr double kScale = 2.0;
  constexpr float kEnlarged = 100.0f;
  const CameraModel& camera = report.calibration.left;
  const auto place = [&](cv::Point2f p) {
    return cv::Point(cvRound(kScale * (static_cast<double>(p.x) + 0.5)),
                     cvRound(kScale * (static_cast<double>(p.y) + 0.5)));
  };
  cv::Mat picture(cvRound(kScale * camera.height), cvRound(kScale * camera.width), CV_8UC3,
                  cv::Scalar::all(255));
  std::vector<cv::Point> used;
  for (const ViewReport& view : report.views) {
    const auto& corners = left ? view.left : view.right;
    const auto& residual = left ? view.left_residual : view.right_residual;
    const cv::Scalar color = view.used ? kUsed : kLeftOut;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      cv::circle(picture, place(corners[i]), 3, color, cv::FILLED, cv::LINE_AA);
      cv::line(picture, place(corners[i]), place(corners[i] + residual[i] * kEnlarged), color, 1,
               cv::LINE_AA);
      if (view.used) used.push_back(place(corners[i]));
    }
  }
  std::vector<cv::Point> hull;
  cv::convexHull(used, hull);
  cv::polylines(picture, hull, true, kHull, 1, cv::LINE_AA);
  const cv::Point foot(12, picture.rows - 16);
  cv::line(picture, foot, foot + cv::Point(cvRound(kScale * 10.0), 0), kInk, 2);
  cv::putText(picture, std::string("0.1 px, ") + (left ? "left" : "right"), foot + cv::Point(30, 5),
              cv::FONT_HERSHEY_SIMPLEX, 0.5, kInk, 1, cv::LINE_AA);
  cv::rectangle(picture, cv::Rect({}, picture.size()), kInk, 1);
  return picture;
}

}  // namespace

cv::Mat rectifiedPicture(const cv::Mat& left, const cv::Mat& right,
                         const StereoCalibration& calibration) {
  constexpr int kLines = 20;
  cv::Mat both;
  cv::hconcat(rectify(left, calibration.left), rectify(right, calibration.right), both);
  for (int i = 1; i < kLines; ++i) {
    const int y = both.rows * i / kLines;
    const cv::Scalar color = i % 2 == 0 ? cv::Scalar(0, 200, 255) : cv::Scalar(60, 255, 60);
    cv::line(both, {0, y}, {both.cols - 1, y}, color, 1);
  }
  return both;
}

cv::Mat residualPicture(const StereoCalibrationReport& report) {
  cv::Mat both;
  cv::hconcat(residualsOf(report, true), residualsOf(report, false), both);
  return both;
}

}  // namespace scanner::calibration
