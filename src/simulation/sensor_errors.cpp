#include "simulation/sensor_errors.h"

#include <cmath>

namespace scanner::simulation {

Eigen::Vector3d normalVector(Random& random) {
  // One after the other: the order of evaluation of arguments is not fixed.
  Eigen::Vector3d v;
  for (int i = 0; i < 3; ++i) v[i] = random.normal();
  return v;
}

GaussMarkov::GaussMarkov(double correlation_time_s, double interval_s, Random& random)
    : keep_(std::exp(-interval_s / correlation_time_s)),
      fresh_(std::sqrt(1.0 - keep_ * keep_)),
      value_(normalVector(random)) {}

Eigen::Vector3d GaussMarkov::next(Random& random) {
  const Eigen::Vector3d now = value_;
  value_ = keep_ * value_ + fresh_ * normalVector(random);
  return now;
}

SmoothDrift::SmoothDrift(double correlation_time_s, double interval_s, Random& random)
    : drive_(0.5 * correlation_time_s, interval_s, random),
      keep_(std::exp(-2.0 * interval_s / correlation_time_s)) {
  // Stationary variance of the second stage, and its covariance with the first.
  const double sum = 1.0 + keep_;
  const double variance = (1.0 + keep_ * keep_) / (sum * sum);
  const double covariance = keep_ / sum;
  scale_ = 1.0 / std::sqrt(variance);
  value_ = covariance * drive_.value() +
           std::sqrt(variance - covariance * covariance) * normalVector(random);
}

Eigen::Vector3d SmoothDrift::next(Random& random) {
  const Eigen::Vector3d now = value_;
  value_ = keep_ * value_ + (1.0 - keep_) * drive_.next(random);
  return scale_ * now;
}

LowPass::LowPass(double edge_hz, double rate_hz, const Vector6& first)
    : in1_(first), in2_(first), out1_(first), out2_(first) {
  constexpr double kPi = 3.14159265358979323846;
  const double k = std::tan(kPi * edge_hz / rate_hz);
  const double norm = 1.0 / (1.0 + std::sqrt(2.0) * k + k * k);
  b0_ = k * k * norm;
  b1_ = 2.0 * b0_;
  b2_ = b0_;
  a1_ = 2.0 * (k * k - 1.0) * norm;
  a2_ = (1.0 - std::sqrt(2.0) * k + k * k) * norm;
}

const Vector6& LowPass::add(const Vector6& input) {
  const Vector6 out = b0_ * input + b1_ * in1_ + b2_ * in2_ - a1_ * out1_ - a2_ * out2_;
  in2_ = in1_;
  in1_ = input;
  out2_ = out1_;
  out1_ = out;
  return out1_;
}

}  // namespace scanner::simulation
