#pragma once

#include <Eigen/Core>
#include <deque>

#include "scanner/core/imu.h"

namespace scanner::inertial {

/// Limits of the stationary detection; standard deviations are per axis.
struct StationaryLimits {
  double window_s = 0.5;
  double gyro_std_radps = 0.02;
  double acceleration_std_mps2 = 0.12;
  double rate_radps = 0.015;
  double gravity_mps2 = 9.82;
  double gravity_error_mps2 = 0.5;
};

/// Means and spreads of the samples of one window.
struct WindowStatistics {
  double duration_s = 0.0;
  Eigen::Vector3d gyro_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d acceleration_mean = Eigen::Vector3d::Zero();
  double gyro_std = 0.0;          ///< largest of the three axes, rad/s
  double acceleration_std = 0.0;  ///< largest of the three axes, m/s^2
};

/// Statistics of samples [first, last). An empty range gives zeros.
WindowStatistics windowStatistics(const std::deque<ImuSample>& samples, std::size_t first,
                                  std::size_t last);

/// True when the window is as long as asked for and quiet. `gyro_bias` is taken off the mean rate.
/// A steady rotation or translation without vibration has the same spread as standing still: the
/// mean rate tells the rotation, the translation cannot be told (method.md section 5).
bool isStationary(const WindowStatistics& window, const Eigen::Vector3d& gyro_bias,
                  const StationaryLimits& limits);

}  // namespace scanner::inertial
