#include "simulation/ray_table.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <string>

#include "scanner/core/parallel.h"

namespace scanner::simulation {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

/// The lens of OpenCV's models plumb_bob and rational_polynomial, with thin prism terms.
class Lens {
 public:
  explicit Lens(const CameraModel& camera) {
    const std::size_t n = camera.D.size();
    const bool known =
        camera.distortion_model == "plumb_bob"
            ? n == 0 || n == 4 || n == 5
            : camera.distortion_model == "rational_polynomial" && (n == 8 || n == 12);
    if (!known) {
      throw ConfigurationError("the renderer does not know the distortion model '" +
                               camera.distortion_model + "' with " + std::to_string(n) +
                               " coefficients");
    }
    std::copy(camera.D.begin(), camera.D.end(), d_.begin());
    focal_ = Vector2d(camera.K(0, 0), camera.K(1, 1));
    centre_ = Vector2d(camera.K(0, 2), camera.K(1, 2));
  }

  Vector2d normalized(int col, int row) const {
    return (Vector2d(col, row) - centre_).cwiseQuotient(focal_);
  }

  /// Undistorted coordinates of a distorted place, by Newton's method from `guess`.
  Vector2d undo(const Vector2d& distorted, const Vector2d& guess) const {
    constexpr int kIterations = 30;
    constexpr double kGoodEnough = 1e-6;  // the step from there leaves about its square
    Vector2d point = guess;
    for (int i = 0; i < kIterations; ++i) {
      Matrix2d slope;
      const Vector2d error = distorted - distort(point, &slope);
      const double det = slope.determinant();
      if (!(det > 0.0)) break;  // folded: several places of the scene share a pixel
      const Vector2d step(slope(1, 1) * error.x() - slope(0, 1) * error.y(),
                          slope(0, 0) * error.y() - slope(1, 0) * error.x());
      point += step / det;
      if (error.cwiseAbs().maxCoeff() < kGoodEnough) return point;
    }
    throw ConfigurationError("the lens distortion folds the picture: it cannot be rendered");
  }

 private:
  /// D = k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4.
  Vector2d distort(const Vector2d& p, Matrix2d* slope) const {
    const double x = p.x(), y = p.y(), r2 = x * x + y * y;
    const double above = 1.0 + r2 * (d_[0] + r2 * (d_[1] + r2 * d_[4]));
    const double below = 1.0 + r2 * (d_[5] + r2 * (d_[6] + r2 * d_[7]));
    const double radial = above / below;
    // Derivatives with respect to r2.
    const double above_r = d_[0] + r2 * (2.0 * d_[1] + 3.0 * r2 * d_[4]);
    const double below_r = d_[5] + r2 * (2.0 * d_[6] + 3.0 * r2 * d_[7]);
    const double radial_r = (above_r - radial * below_r) / below;
    const double prism_x_r = d_[8] + 2.0 * r2 * d_[9], prism_y_r = d_[10] + 2.0 * r2 * d_[11];
    const double p1 = d_[2], p2 = d_[3];
    (*slope)(0, 0) = radial + 2.0 * x * (x * radial_r + prism_x_r) + 2.0 * p1 * y + 6.0 * p2 * x;
    (*slope)(0, 1) = 2.0 * y * (x * radial_r + prism_x_r) + 2.0 * p1 * x + 2.0 * p2 * y;
    (*slope)(1, 0) = 2.0 * x * (y * radial_r + prism_y_r) + 2.0 * p1 * x + 2.0 * p2 * y;
    (*slope)(1, 1) = radial + 2.0 * y * (y * radial_r + prism_y_r) + 6.0 * p1 * y + 2.0 * p2 * x;
    return {x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + r2 * (d_[8] + r2 * d_[9]),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + r2 * (d_[10] + r2 * d_[11])};
  }

  std::array<double, 12> d_{};
  Vector2d focal_, centre_;
};

}  // namespace

RayTable::RayTable(const CameraModel& camera, int threads)
    : width_(camera.width), height_(camera.height) {
  constexpr std::size_t kRowsPerTask = 32;
  const Lens lens(camera);
  const std::size_t columns = static_cast<std::size_t>(width_) + 2;
  const std::size_t rows = static_cast<std::size_t>(height_) + 2;
  centres_.resize(columns * rows);
  parallelFor(rows, kRowsPerTask, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      // Going on as from the pixel before to this one is nearly right already.
      Vector2d guess = lens.normalized(-1, static_cast<int>(row) - 1);
      Vector2d before = guess;
      for (std::size_t col = 0; col < columns; ++col) {
        const Vector2d point =
            lens.undo(lens.normalized(static_cast<int>(col) - 1, static_cast<int>(row) - 1), guess);
        centres_[row * columns + col] = point.cast<float>();
        guess = col == 0 ? point : Vector2d(2.0 * point - before);
        before = point;
      }
    }
  });
}

const Eigen::Vector2f& RayTable::at(int col, int row) const {
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
