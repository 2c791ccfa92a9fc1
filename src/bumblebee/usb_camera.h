#pragma once

#include <chrono>
#include <optional>

#include "scanner/core/time.h"

namespace scanner::bumblebee {

/// Unwraps the cycle time of frames (0..128 s). The host's clock tells how often it went round
/// between two frames that are far apart.
class CycleClock {
 public:
  using Steady = std::chrono::steady_clock;
  void reset() { last_.reset(); }
  Duration unwrap(Duration cycle_time, Steady::time_point arrival);

 private:
  struct Moment {
    Duration device{0};  ///< unwrapped
    Steady::time_point host;
  };
  std::optional<Moment> last_;
};

}  // namespace scanner::bumblebee
