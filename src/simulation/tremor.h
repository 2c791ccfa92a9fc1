#pragma once

#include <array>
#include <cstdint>

#include "simulation/step_curve.h"

namespace scanner::simulation {

/// The tremor of a hand: for each of six signals a sum of sines between 1 and 8 Hz, weaker the
/// faster; smaller, but never gone, while the person stands still.
class Tremor {
 public:
  /// `rms[i]`: of signal i, in its unit, when in full swing between `begin_s` and `end_s`.
  Tremor(const std::array<double, 6>& rms, double begin_s, double end_s, std::uint64_t seed);

  Signals at(double time_s) const;

 private:
  struct Sine {
    double amplitude;
    double angular_frequency;  ///< rad/s
    double phase;
  };
  static constexpr int kSines = 12;

  std::array<std::array<Sine, kSines>, 6> sines_;
  double begin_s_;
  double end_s_;
};

}  // namespace scanner::simulation
