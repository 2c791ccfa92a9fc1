#include "inertial/rest_monitor.h"

#include <algorithm>
#include <cmath>

#include "scanner/core/se3.h"
#include "scanner/inertial/stationary.h"

namespace scanner::inertial {

namespace {

StationaryLimits stillLimits(const InertialOptions& o) {
  return {o.still_window_s,   o.still_gyro_std_radps, o.still_acceleration_std_mps2,
          o.still_rate_radps, o.gravity_mps2,         o.still_gravity_error_mps2};
}

StationaryLimits biasLimits(const InertialOptions& o) {
  return {o.still_window_s,   o.bias_gyro_std_radps, o.bias_acceleration_std_mps2,
          o.still_rate_radps, o.gravity_mps2,        o.still_gravity_error_mps2};
}

// Vibration on the spot leaves the means of both halves of the window alike; a motion does not.
bool halvesAgree(const std::deque<ImuSample>& samples) {
  const std::size_t middle = samples.size() / 2;
  const WindowStatistics a = windowStatistics(samples, 0, middle);
  const WindowStatistics b = windowStatistics(samples, middle, samples.size());
  return (a.gyro_mean - b.gyro_mean).norm() < 0.02 &&
         (a.acceleration_mean - b.acceleration_mean).norm() < 0.2;
}

// A steady rotation looks like a bias to the gyro, but not to a sensor that knows its orientation.
bool isTurning(const std::deque<ImuSample>& samples) {
  const ImuSample& first = samples.front();
  const ImuSample& last = samples.back();
  if (!first.orientation || !last.orientation) return false;
  return angleBetween(*first.orientation, *last.orientation) >
         0.05 * toSeconds(last.stamp - first.stamp);
}

}  // namespace

void RestMonitor::start(const std::deque<ImuSample>& samples) {
  window_.clear();
  if (biasKnown() || samples.empty() || isTurning(samples) || !halvesAgree(samples)) return;
  const WindowStatistics w = windowStatistics(samples, 0, samples.size());
  const double gravity_error = std::abs(w.acceleration_mean.norm() - options_.gravity_mps2);
  if (gravity_error > options_.still_gravity_error_mps2) return;
  if (w.gyro_mean.norm() > options_.max_gyro_bias_radps) return;
  bias_ = w.gyro_mean;
  bias_updates_ = 1;
  last_bias_update_ = samples.back().stamp;
}

std::optional<Time> RestMonitor::add(const ImuSample& sample) {
  window_.push_back(sample);
  const Duration length = fromSeconds(options_.still_window_s);
  while (sample.stamp - window_.front().stamp > length) window_.pop_front();
  updateBias(sample.stamp);
  const WindowStatistics window = windowStatistics(window_, 0, window_.size());
  if (!isStationary(window, bias_, stillLimits(options_))) return std::nullopt;
  const Time begin = window_.front().stamp;
  const Time counted = still_until_ ? std::max(begin, *still_until_) : begin;
  stationary_s_ += toSeconds(sample.stamp - counted);
  still_until_ = sample.stamp;
  return begin;
}

void RestMonitor::updateBias(Time stamp) {
  // One update per window. A bias not known yet may be anything up to its limit; a known one
  // changes slowly.
  StationaryLimits limits = biasLimits(options_);
  if (biasKnown() && stamp - last_bias_update_ < fromSeconds(options_.still_window_s)) return;
  if (!biasKnown()) limits.rate_radps = options_.max_gyro_bias_radps;
  const WindowStatistics window = windowStatistics(window_, 0, window_.size());
  if (!isStationary(window, bias_, limits)) return;
  if (!biasKnown() && (isTurning(window_) || !halvesAgree(window_))) return;
  ++bias_updates_;
  const double gain = std::max(0.05, 1.0 / static_cast<double>(bias_updates_));
  bias_ += gain * (window.gyro_mean - bias_);
  last_bias_update_ = stamp;
}

}  // namespace scanner::inertial
