#pragma once

#include <Eigen/Core>

#include "scanner/simulation/random.h"

namespace scanner::simulation {

using Vector6 = Eigen::Matrix<double, 6, 1>;

Eigen::Vector3d normalVector(Random& random);

/// First-order Gauss-Markov process of unit variance on three axes: exact at its samples.
class GaussMarkov {
 public:
  GaussMarkov(double correlation_time_s, double interval_s, Random& random);
  const Eigen::Vector3d& value() const { return value_; }
  /// The value now; steps on.
  Eigen::Vector3d next(Random& random);

 private:
  double keep_;
  double fresh_;
  Eigen::Vector3d value_;
};

/// Two Gauss-Markov stages one behind the other, unit variance: correlated over the same time, but
/// without the jitter of the first-order process from sample to sample, as behind a filter.
class SmoothDrift {
 public:
  SmoothDrift(double correlation_time_s, double interval_s, Random& random);
  Eigen::Vector3d next(Random& random);

 private:
  GaussMarkov drive_;
  double keep_;
  double scale_;
  Eigen::Vector3d value_;
};

/// Second-order Butterworth low-pass of six channels (bilinear transform, edge kept in place).
class LowPass {
 public:
  /// `edge_hz` below half the rate. Starts in the steady state of `first`.
  LowPass(double edge_hz, double rate_hz, const Vector6& first);
  const Vector6& add(const Vector6& input);

 private:
  double b0_, b1_, b2_, a1_, a2_;
  Vector6 in1_, in2_, out1_, out2_;
};

}  // namespace scanner::simulation
