#include "scanner/stereo/normals.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "scanner/core/parallel.h"

namespace scanner::stereo {
namespace {

constexpr std::size_t kRowsPerChunk = 16;
/// The second eigenvalue against the largest: below, the points are on a line.
constexpr double kMinSpread = 1e-4;

class NormalWindow {
 public:
  NormalWindow(const OrganizedCloud& cloud, const NormalOptions& options)
      : cloud_(cloud), options_(options), radius_(options.window_px / 2) {}

  /// The normal of a pixel, or NaN.
  Eigen::Vector3f at(int u, int v) const {
    Eigen::Vector3f undefined = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
    const std::size_t centre_index = index(u, v);
    const Eigen::Vector3f& centre = cloud_.cloud.points[centre_index];
    if (std::isnan(centre.z())) return undefined;
    const double tolerance =
        cloud_.cloud.hasSigmas()
            ? options_.max_step_sigmas * static_cast<double>(cloud_.cloud.sigmas[centre_index])
            : 0.0;
    const double per_pixel = options_.max_step_ratio * static_cast<double>(centre.z());

    // Relative to the centre point, so that float coordinates lose nothing in the differences.
    int n = 0;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
    for (int y = std::max(0, v - radius_); y <= std::min(cloud_.height - 1, v + radius_); ++y) {
      for (int x = std::max(0, u - radius_); x <= std::min(cloud_.width - 1, u + radius_); ++x) {
        const Eigen::Vector3f& p = cloud_.cloud.points[index(x, y)];
        if (std::isnan(p.z())) continue;
        const Eigen::Vector3d q = (p - centre).cast<double>();
        const int distance = std::max(std::abs(x - u), std::abs(y - v));
        if (std::abs(q.z()) > per_pixel * distance + tolerance) return undefined;
        ++n;
        sum += q;
        xx += q.x() * q.x(), xy += q.x() * q.y(), xz += q.x() * q.z();
        yy += q.y() * q.y(), yz += q.y() * q.z(), zz += q.z() * q.z();
      }
    }
    if (n < options_.min_points) return undefined;
    Eigen::Matrix3d scatter;
    scatter << xx, xy, xz, xy, yy, yz, xz, yz, zz;
    scatter -= sum * sum.transpose() / n;
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(scatter);
    if (!(solver.eigenvalues()[1] > kMinSpread * solver.eigenvalues()[2])) return undefined;
    Eigen::Vector3d normal = solver.eigenvectors().col(0);
    if (normal.dot(centre.cast<double>()) > 0.0) normal = -normal;
    return normal.normalized().cast<float>();
  }

  std::size_t index(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(cloud_.width) +
           static_cast<std::size_t>(u);
  }

 private:
  const OrganizedCloud& cloud_;
  const NormalOptions& options_;
  int radius_;
};

}  // namespace

void estimateNormals(OrganizedCloud& cloud, const NormalOptions& options, int threads) {
  validate(options);
  const auto width = static_cast<std::size_t>(cloud.width);
  const auto height = static_cast<std::size_t>(cloud.height);
  if (cloud.cloud.points.size() != width * height) {
    throw std::invalid_argument("estimateNormals: cloud is not organised");
  }
  std::vector<Eigen::Vector3f> normals(cloud.cloud.size());
  const NormalWindow window(cloud, options);
  parallelFor(height, kRowsPerChunk, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) {
      for (std::size_t u = 0; u < width; ++u) {
        normals[v * width + u] = window.at(static_cast<int>(u), static_cast<int>(v));
      }
    }
  });
  cloud.cloud.normals = std::move(normals);
}

}  // namespace scanner::stereo
