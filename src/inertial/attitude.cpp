#include "scanner/inertial/attitude.h"

#include <cmath>

#include "scanner/core/se3.h"

namespace scanner::inertial {

Eigen::Quaterniond levelFromGravity(const Eigen::Vector3d& f, double yaw) {
  // Rz(yaw) Ry(pitch) Rx(roll) f = |f| z.
  const double roll = std::atan2(f.y(), f.z());
  const double pitch = std::atan2(-f.x(), std::hypot(f.y(), f.z()));
  return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
}

void AttitudeFilter::propagate(const Eigen::Vector3d& rate, double dt) {
  q_ = (q_ * expSo3(rate * dt)).normalized();
}

void AttitudeFilter::correctByOrientation(const Eigen::Quaterniond& R_world_base, double dt) {
  const double constant = options_.orientation_time_constant_s;
  if (constant <= 0.0) {
    q_ = R_world_base.normalized();
    return;
  }
  const Eigen::Vector3d error = logSo3((R_world_base * q_.conjugate()).normalized());
  q_ = (expSo3(error * (1.0 - std::exp(-dt / constant))) * q_).normalized();
}

void AttitudeFilter::correctByGravity(const Eigen::Vector3d& specific_force, double dt) {
  const double norm = specific_force.norm();
  if (std::abs(norm - options_.gravity_mps2) > 0.1 * options_.gravity_mps2) return;
  const Eigen::Vector3d up = q_ * specific_force / norm;
  const Eigen::Vector3d error = up.cross(Eigen::Vector3d::UnitZ());
  const double gain = 1.0 - std::exp(-dt / options_.levelling_time_constant_s);
  q_ = (expSo3(error * gain) * q_).normalized();
}

}  // namespace scanner::inertial
