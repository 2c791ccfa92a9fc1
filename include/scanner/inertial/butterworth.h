#pragma once

#include <Eigen/Core>
#include <vector>

#include "scanner/core/time.h"

namespace scanner::inertial {

/// Rate of a series of stamps in Hz, from the median interval: missing samples and jitter do not
/// move it. 0 for fewer than two stamps, or when the median interval is not positive.
double estimateSampleRate(const std::vector<Time>& stamps);

/// First-order digital Butterworth band-pass (thesis 4.4) by the bilinear transform with both edges
/// prewarped. With w = tan(pi f / 2), f being the frequency as a fraction of the Nyquist rate,
///
///     |H(f)| = 1 / sqrt(1 + Q^2),   Q = (w^2 - wl wh) / ((wh - wl) w):
///
/// 1/sqrt(2) at both edges, 0 at rest and at the Nyquist rate. The edges are fractions of the
/// Nyquist rate, so the coefficients hold at whatever rate the samples really come.
class ButterworthBandPass {
 public:
  /// 0 < low < high < 1. Throws ConfigurationError otherwise.
  ButterworthBandPass(double low, double high);

  /// The state that a constant input of `value` would have led to: the output then starts at zero
  /// instead of ringing.
  void resetToSteadyState(const Eigen::Vector3d& value);
  /// Filters the next sample; each axis on its own.
  Eigen::Vector3d filter(const Eigen::Vector3d& sample);

  /// Gain at a frequency given as a fraction of the Nyquist rate, from the digital coefficients.
  double gain(double frequency) const;

 private:
  // H(z) = b0 (1 - z^-2) / (1 + a1 z^-1 + a2 z^-2), transposed direct form II.
  double b0_ = 0.0, a1_ = 0.0, a2_ = 0.0;
  Eigen::Vector3d s1_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d s2_ = Eigen::Vector3d::Zero();
};

}  // namespace scanner::inertial
