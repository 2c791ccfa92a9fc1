#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>

#include "scanner/core/imu.h"
#include "scanner/inertial/options.h"

namespace scanner::inertial {

/// Watches the latest samples for standing still, and estimates the gyro bias while it lasts.
class RestMonitor {
 public:
  explicit RestMonitor(const InertialOptions& options) : options_(options) {}

  /// First samples of a stretch of data: a first estimate of the bias, unless it is known or they
  /// are of a motion. Forgets the samples before.
  void start(const std::deque<ImuSample>& samples);
  /// The next sample. When the window that ends with it was still, the time that window began.
  std::optional<Time> add(const ImuSample& sample);

  const Eigen::Vector3d& gyroBias() const { return bias_; }
  bool biasKnown() const { return bias_updates_ > 0; }
  double stationarySeconds() const { return stationary_s_; }

 private:
  void updateBias(Time stamp);

  InertialOptions options_;
  std::deque<ImuSample> window_;
  Eigen::Vector3d bias_ = Eigen::Vector3d::Zero();
  int bias_updates_ = 0;
  Time last_bias_update_;
  std::optional<Time> still_until_;
  double stationary_s_ = 0.0;
};

}  // namespace scanner::inertial
