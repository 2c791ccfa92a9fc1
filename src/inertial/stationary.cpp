#include "scanner/inertial/stationary.h"

#include <cmath>

namespace scanner::inertial {

WindowStatistics windowStatistics(const std::deque<ImuSample>& samples, std::size_t first,
                                  std::size_t last) {
  WindowStatistics w;
  if (first >= last) return w;
  const double n = static_cast<double>(last - first);
  for (std::size_t i = first; i < last; ++i) {
    w.gyro_mean += samples[i].angular_velocity;
    w.acceleration_mean += samples[i].linear_acceleration;
  }
  w.gyro_mean /= n;
  w.acceleration_mean /= n;
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();
  for (std::size_t i = first; i < last; ++i) {
    gyro += (samples[i].angular_velocity - w.gyro_mean).cwiseAbs2();
    acceleration += (samples[i].linear_acceleration - w.acceleration_mean).cwiseAbs2();
  }
  w.gyro_std = std::sqrt(gyro.maxCoeff() / n);
  w.acceleration_std = std::sqrt(acceleration.maxCoeff() / n);
  w.duration_s = toSeconds(samples[last - 1].stamp - samples[first].stamp);
  return w;
}

bool isStationary(const WindowStatistics& window, const Eigen::Vector3d& gyro_bias,
                  const StationaryLimits& limits) {
  // A window of n samples spans n - 1 intervals; 0.9 lets it be one short, and jitter.
  return window.duration_s >= 0.9 * limits.window_s && window.gyro_std <= limits.gyro_std_radps &&
         window.acceleration_std <= limits.acceleration_std_mps2 &&
         (window.gyro_mean - gyro_bias).norm() <= limits.rate_radps &&
         std::abs(window.acceleration_mean.norm() - limits.gravity_mps2) <=
             limits.gravity_error_mps2;
}

}  // namespace scanner::inertial
