#include "simulation/tremor.h"

#include <cmath>
#include <cstddef>

#include "scanner/simulation/random.h"

namespace scanner::simulation {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr double kLowest_hz = 1.0;
constexpr double kHighest_hz = 8.0;
constexpr double kStillShare = 0.1;  ///< of the amplitude while standing still
constexpr double kSwell_s = 1.0;     ///< from the one amplitude to the other

}  // namespace

Tremor::Tremor(const std::array<double, 6>& rms, double begin_s, double end_s, std::uint64_t seed)
    : begin_s_(begin_s), end_s_(end_s) {
  Random random(seed);
  for (std::size_t signal = 0; signal < sines_.size(); ++signal) {
    double power = 0.0;
    int index = 0;
    for (Sine& sine : sines_[signal]) {
      // One sine in each part of the band, so that every hand has the whole band.
      const double share = (index++ + random.uniform()) / kSines;
      const double frequency_hz = kLowest_hz * std::pow(kHighest_hz / kLowest_hz, share);
      sine = {std::pow(frequency_hz, -1.5), kTwoPi * frequency_hz, random.uniform(0.0, kTwoPi)};
      power += 0.5 * sine.amplitude * sine.amplitude;
    }
    for (Sine& sine : sines_[signal]) sine.amplitude *= rms[signal] / std::sqrt(power);
  }
}

Signals Tremor::at(double time_s) const {
  // Amplitude over time, with derivatives: rises from begin_s on, has fallen at end_s.
  constexpr double kRate = 2.0 / kSwell_s;
  const SmoothStep rise = smoothStep((time_s - begin_s_) * kRate - 1.0);
  const SmoothStep fall = smoothStep((time_s - end_s_) * kRate + 1.0);
  const double swing = kStillShare + (1.0 - kStillShare) * (rise.value - fall.value);
  const double swing_rate = (1.0 - kStillShare) * (rise.first - fall.first) * kRate;
  const double swing_bend = (1.0 - kStillShare) * (rise.second - fall.second) * kRate * kRate;

  Signals signals;
  for (std::size_t i = 0; i < sines_.size(); ++i) {
    double value = 0.0;
    double first = 0.0;
    double second = 0.0;
    for (const Sine& sine : sines_[i]) {
      const double angle = sine.angular_frequency * time_s + sine.phase;
      const double height = sine.amplitude * std::sin(angle);
      value += height;
      first += sine.amplitude * sine.angular_frequency * std::cos(angle);
      second -= sine.angular_frequency * sine.angular_frequency * height;
    }
    signals.row(static_cast<Eigen::Index>(i)) << swing * value, swing_rate * value + swing * first,
        swing_bend * value + 2.0 * swing_rate * first + swing * second;
  }
  return signals;
}

}  // namespace scanner::simulation
