#include "support/synthetic_rig.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace scanner::test {
namespace {

constexpr double kBallRadius = 0.2;
constexpr double kOrbitRadius = 0.7;
constexpr double kBumpHeight = 0.015;
constexpr double kBumpFrequency = 22.0;  // rad/m
constexpr double kFocal = 350.0;
constexpr double kBaseline = 0.12;
constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr double kRampSeconds = 1.0;
constexpr double kOrbitRate = 0.15;  // rad/s once under way
constexpr double kGravity = 9.82;

/// Pseudo-random value in [0, 1) of a lattice point.
double lattice(std::int64_t x, std::int64_t y, std::int64_t z) {
  auto h = static_cast<std::uint64_t>(x) * 0x9E3779B97F4A7C15ULL ^
           static_cast<std::uint64_t>(y) * 0xC2B2AE3D27D4EB4FULL ^
           static_cast<std::uint64_t>(z) * 0x165667B19E3779F9ULL;
  h = (h ^ (h >> 31)) * 0xBF58476D1CE4E5B9ULL;
  h ^= h >> 29;
  return static_cast<double>(h >> 11) * 0x1.0p-53;
}

double valueNoise(const Eigen::Vector3d& p) {
  const Eigen::Vector3d cell = p.array().floor();
  const Eigen::Vector3d f = p - cell;
  double sum = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d o(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
    const Eigen::Array3d w = o.array() * f.array() + (1.0 - o.array()) * (1.0 - f.array());
    const Eigen::Vector3d c = cell + o;
    sum += w.prod() * lattice(static_cast<std::int64_t>(c.x()), static_cast<std::int64_t>(c.y()),
                              static_cast<std::int64_t>(c.z()));
  }
  return sum;
}

double texture(const Eigen::Vector3d& p) {
  return 0.5 * valueNoise(p * 150.0) + 0.3 * valueNoise(p * 320.0) + 0.2 * valueNoise(p * 60.0);
}

/// Orbit angle and its two derivatives: at rest, then a smooth ramp to a constant rate.
Eigen::Vector3d orbit(double t) {
  if (t <= 0.0) return Eigen::Vector3d::Zero();
  const double s = std::min(t / kRampSeconds, 1.0);
  const double ramp = s * s * (3.0 - 2.0 * s);
  const double slope = t < kRampSeconds ? 6.0 * s * (1.0 - s) / kRampSeconds : 0.0;
  const double ramped = kRampSeconds * (s * s * s - 0.5 * s * s * s * s);
  const double angle = kOrbitRate * (ramped + std::max(0.0, t - kRampSeconds));
  return {angle, kOrbitRate * ramp, kOrbitRate * slope};
}

}  // namespace

SyntheticRig::SyntheticRig() {
  for (CameraModel* camera : {&calibration_.left, &calibration_.right}) {
    camera->width = kWidth;
    camera->height = kHeight;
    camera->D.assign(5, 0.0);
    camera->K << kFocal, 0, 0.5 * (kWidth - 1), 0, kFocal, 0.5 * (kHeight - 1), 0, 0, 1;
    camera->P.leftCols<3>() = camera->K;
  }
  calibration_.right.P(0, 3) = -kFocal * kBaseline;
  // The published extrinsic (thesis eq. 5.1): the camera looks along the sensor's x axis.
  Eigen::Matrix3d R;
  R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  rig_.T_base_camera =
      makePose({0.05, 0.06, -0.06}, Eigen::Quaterniond(R) * expSo3({0.02, 0.03, 0}));
}

Time SyntheticRig::stamp(double seconds) {
  return fromNanoseconds(1700000000000000000) + fromSeconds(seconds);
}

Eigen::Isometry3d SyntheticRig::pose(double seconds) const {
  const double angle = orbit(seconds).x();
  Eigen::Matrix3d R;  // camera axes in the map: it looks at the origin, y points down
  R.col(2) = -Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
  R.col(1) = -Eigen::Vector3d::UnitZ();
  R.col(0) = R.col(1).cross(R.col(2));
  return makePose(-kOrbitRadius * R.col(2), Eigen::Quaterniond(R)) * rig_.T_base_camera.inverse();
}

ImuSample SyntheticRig::imu(double seconds) const {
  // Base turns rigidly about the map's z axis: v = w x p, a = w' x p + w x (w x p).
  const Eigen::Vector3d o = orbit(seconds);
  const Eigen::Isometry3d T = pose(seconds);
  const Eigen::Vector3d w(0, 0, o.y());
  const Eigen::Vector3d dw(0, 0, o.z());
  const Eigen::Vector3d p = T.translation();
  const Eigen::Vector3d a = dw.cross(p) + w.cross(w.cross(p)) + Eigen::Vector3d(0, 0, kGravity);
  ImuSample sample;
  sample.stamp = stamp(seconds);
  sample.angular_velocity = T.linear().transpose() * w;
  sample.linear_acceleration = T.linear().transpose() * a;
  sample.orientation = Eigen::Quaterniond(T.linear());
  return sample;
}

StereoFrame SyntheticRig::frame(double seconds) const {
  const Eigen::Isometry3d T_map_left = pose(seconds) * rig_.T_base_camera;
  const Eigen::Isometry3d T_left_right =
      makePose({kBaseline, 0, 0}, Eigen::Quaterniond::Identity());
  return {stamp(seconds),
          {render(T_map_left), PixelFormat::kMono8},
          {render(T_map_left * T_left_right), PixelFormat::kMono8}};
}

double SyntheticRig::surfaceDistance(const Eigen::Vector3d& p) {
  const Eigen::Vector3d q = kBumpFrequency * p;
  return p.norm() - kBallRadius - kBumpHeight * std::sin(q.x()) * std::sin(q.y()) * std::sin(q.z());
}

cv::Mat SyntheticRig::render(const Eigen::Isometry3d& T_map_camera) const {
  cv::Mat image(kHeight, kWidth, CV_8UC1, cv::Scalar(90));
  const Eigen::Matrix3d K_inverse = calibration_.left.K.inverse();
  for (int row = 0; row < kHeight; ++row) {
    for (int col = 0; col < kWidth; ++col) {
      const Eigen::Vector3d ray =
          T_map_camera.linear() * (K_inverse * Eigen::Vector3d(col, row, 1.0)).normalized();
      double s = kOrbitRadius - kBallRadius - 2.0 * kBumpHeight;
      for (int step = 0; step < 60 && s < kOrbitRadius + kBallRadius; ++step) {
        const Eigen::Vector3d p = T_map_camera.translation() + s * ray;
        const double distance = surfaceDistance(p);
        if (distance < 2e-5) {
          image.at<std::uint8_t>(row, col) = static_cast<std::uint8_t>(20.0 + 215.0 * texture(p));
          break;
        }
        s += 0.75 * distance;  // the bumps make the distance an upper bound only
      }
    }
  }
  return image;
}

}  // namespace scanner::test
