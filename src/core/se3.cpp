#include "scanner/core/se3.h"

#include <Eigen/SVD>
#include <cmath>

namespace scanner {
namespace {

// Below this angle (rad) the series of the Jacobian's coefficients are exact to double precision.
constexpr double kSmallAngle = 1e-4;

Eigen::Matrix3d leftJacobian(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  const Eigen::Matrix3d W = skew(w);
  double a = 0.5 - angle * angle / 24.0;
  double b = 1.0 / 6.0 - angle * angle / 120.0;
  if (angle > kSmallAngle) {
    a = (1.0 - std::cos(angle)) / (angle * angle);
    b = (angle - std::sin(angle)) / (angle * angle * angle);
  }
  return Eigen::Matrix3d::Identity() + a * W + b * W * W;
}

}  // namespace

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Eigen::Quaterniond expSo3(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  const double half = 0.5 * angle;
  const double k = angle > kSmallAngle ? std::sin(half) / angle : 0.5 - angle * angle / 48.0;
  Eigen::Quaterniond q(std::cos(half), k * w.x(), k * w.y(), k * w.z());
  q.normalize();
  return q;
}

Eigen::Vector3d logSo3(const Eigen::Quaterniond& q_in) {
  // Of q and -q, the one with w >= 0 has the shorter rotation vector.
  const double sign = q_in.w() < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * q_in.vec();
  const double w = sign * q_in.w();
  const double n = v.norm();
  if (n < kSmallAngle) return v * (2.0 / w) * (1.0 - n * n / (3.0 * w * w));
  return v * (2.0 * std::atan2(n, w) / n);
}

Eigen::Isometry3d expSe3(const Twist& xi) {
  const Eigen::Vector3d w = xi.tail<3>();
  return makePose(leftJacobian(w) * xi.head<3>(), expSo3(w));
}

Twist logSe3(const Eigen::Isometry3d& T) {
  Twist xi;
  const Eigen::Vector3d w = logSo3(Eigen::Quaterniond(T.linear()));
  xi.tail<3>() = w;
  xi.head<3>() = leftJacobian(w).partialPivLu().solve(T.translation());
  return xi;
}

double angleBetween(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  const Eigen::Quaterniond d = a.conjugate() * b;
  return 2.0 * std::atan2(d.vec().norm(), std::abs(d.w()));
}

double rotationAngle(const Eigen::Isometry3d& T) {
  return angleBetween(Eigen::Quaterniond(T.linear()), Eigen::Quaterniond::Identity());
}

Eigen::Isometry3d interpolate(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double s) {
  const Eigen::Quaterniond qa(a.linear());
  const Eigen::Quaterniond qb(b.linear());
  return makePose((1.0 - s) * a.translation() + s * b.translation(), qa.slerp(s, qb));
}

Eigen::Matrix3d nearestRotation(const Eigen::Matrix3d& m) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d& U = svd.matrixU();
  const Eigen::Matrix3d& V = svd.matrixV();
  const double sign = (U * V.transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return U * Eigen::Vector3d(1.0, 1.0, sign).asDiagonal() * V.transpose();
}

Eigen::Vector3d rollPitchYaw(const Eigen::Matrix3d& R) {
  const double pitch = std::atan2(-R(2, 0), std::hypot(R(0, 0), R(1, 0)));
  return {std::atan2(R(2, 1), R(2, 2)), pitch, std::atan2(R(1, 0), R(0, 0))};
}

bool isFinite(const Eigen::Isometry3d& T) { return T.matrix().allFinite(); }

Eigen::Isometry3d makePose(const Eigen::Vector3d& translation, const Eigen::Quaterniond& rotation) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = rotation.normalized().toRotationMatrix();
  T.translation() = translation;
  return T;
}

}  // namespace scanner
