#include "scanner/inertial/butterworth.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <string>

#include "scanner/core/status.h"

namespace scanner::inertial {

namespace {
constexpr double kPi = 3.14159265358979323846;
}  // namespace

double estimateSampleRate(const std::vector<Time>& stamps) {
  if (stamps.size() < 2) return 0.0;
  std::vector<double> intervals;
  intervals.reserve(stamps.size() - 1);
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    intervals.push_back(toSeconds(stamps[i] - stamps[i - 1]));
  }
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  return *middle > 0.0 ? 1.0 / *middle : 0.0;
}

ButterworthBandPass::ButterworthBandPass(double low, double high) {
  if (!(low > 0.0 && low < high && high < 1.0)) {
    throw ConfigurationError("band-pass edges must obey 0 < low < high < 1, got low " +
                             std::to_string(low) + ", high " + std::to_string(high));
  }
  // Analogue prototype 1/(s+1) with s -> (s^2 + w0^2) / (B s), then s = (1 - z^-1) / (1 + z^-1).
  const double wl = std::tan(kPi * low / 2.0);
  const double wh = std::tan(kPi * high / 2.0);
  const double bandwidth = wh - wl;
  const double w0_squared = wl * wh;
  const double a0 = 1.0 + bandwidth + w0_squared;
  b0_ = bandwidth / a0;
  a1_ = 2.0 * (w0_squared - 1.0) / a0;
  a2_ = (1.0 - bandwidth + w0_squared) / a0;
}

void ButterworthBandPass::resetToSteadyState(const Eigen::Vector3d& value) {
  // Constant input, zero output: s2 = -b0 x and s1 = s2, since b1 = 0.
  s1_ = -b0_ * value;
  s2_ = -b0_ * value;
}

Eigen::Vector3d ButterworthBandPass::filter(const Eigen::Vector3d& sample) {
  const Eigen::Vector3d out = b0_ * sample + s1_;
  s1_ = s2_ - a1_ * out;
  s2_ = -b0_ * sample - a2_ * out;
  return out;
}

double ButterworthBandPass::gain(double frequency) const {
  const std::complex<double> z = std::polar(1.0, -kPi * frequency);  // z^-1
  return std::abs(b0_ * (1.0 - z * z) / (1.0 + a1_ * z + a2_ * z * z));
}

}  // namespace scanner::inertial
