#include "simulation/ray_table.h"

#include <opencv2/calib3d.hpp>
#include <string>

namespace scanner::simulation {
namespace {

/// Forward distortion by OpenCV, so that there is one definition of the model in the project; its
/// inverse by Newton's method with numeric slopes, to 1e-6 px.
class Distortion {
 public:
  explicit Distortion(const CameraModel& camera) : D_(camera.D) {
    if (camera.distortion_model != "plumb_bob" &&
        camera.distortion_model != "rational_polynomial") {
      throw ConfigurationError("the renderer does not know the distortion model '" +
                               camera.distortion_model + "'");
    }
    fx_ = camera.K(0, 0);
    fy_ = camera.K(1, 1);
    cx_ = camera.K(0, 2);
    cy_ = camera.K(1, 2);
  }

  /// Undistorted normalized coordinates of pixels.
  std::vector<cv::Point2d> undo(const std::vector<cv::Point2d>& pixels) const {
    constexpr int kIterations = 20;
    constexpr double kGoodEnough = 1e-9;
    std::vector<cv::Point2d> wanted, points;
    for (const cv::Point2d& p : pixels) wanted.emplace_back((p.x - cx_) / fx_, (p.y - cy_) / fy_);
    points = wanted;
    for (int i = 0; i < kIterations; ++i) {
      const std::vector<cv::Point2d> now = apply(points);
      double worst = 0.0;
      for (std::size_t k = 0; k < points.size(); ++k) {
        const cv::Point2d error = wanted[k] - now[k];
        worst = std::max({worst, std::abs(error.x), std::abs(error.y)});
        points[k] += error;  // the slope of a lens' distortion is near one
      }
      if (worst < kGoodEnough) return points;
    }
    throw ConfigurationError("the lens distortion folds the picture: it cannot be rendered");
  }

 private:
  std::vector<cv::Point2d> apply(const std::vector<cv::Point2d>& points) const {
    std::vector<cv::Point3d> rays;
    rays.reserve(points.size());
    for (const cv::Point2d& p : points) rays.emplace_back(p.x, p.y, 1.0);
    std::vector<cv::Point2d> out;
    cv::projectPoints(rays, cv::Vec3d(), cv::Vec3d(), cv::Matx33d::eye(), D_, out);
    return out;
  }

  std::vector<double> D_;
  double fx_, fy_, cx_, cy_;
};

}  // namespace

RayTable::RayTable(const CameraModel& camera) : width_(camera.width), height_(camera.height) {
  const Distortion distortion(camera);
  centres_.reserve(static_cast<std::size_t>(width_ + 2) * static_cast<std::size_t>(height_ + 2));
  for (int row = -1; row <= height_; ++row) {
    std::vector<cv::Point2d> pixels;
    for (int col = -1; col <= width_; ++col) pixels.emplace_back(col, row);
    for (const cv::Point2d& p : distortion.undo(pixels)) {
      centres_.emplace_back(static_cast<float>(p.x), static_cast<float>(p.y));
    }
  }
}

Eigen::Vector2f RayTable::at(int col, int row) const {
  return centres_[static_cast<std::size_t>(row + 1) * static_cast<std::size_t>(width_ + 2) +
                  static_cast<std::size_t>(col + 1)];
}

Eigen::Vector3f RayTable::direction(int col, int row, float du, float dv) const {
  const Eigen::Vector2f along = 0.5F * (at(col + 1, row) - at(col - 1, row));
  const Eigen::Vector2f down = 0.5F * (at(col, row + 1) - at(col, row - 1));
  const Eigen::Vector2f place = at(col, row) + du * along + dv * down;
  return {place.x(), place.y(), 1.0F};
}

}  // namespace scanner::simulation
