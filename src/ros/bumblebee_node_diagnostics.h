#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <string>

#include "ros/bumblebee_node_calibration.h"
#include "ros/diagnostics.h"
#include "scanner/bumblebee/driver.h"

namespace scanner::bridge {

/// What the diagnostics of a Bumblebee say, from what the driver counts. Remembers the counts of
/// the last seconds: a drop is a warning for a while, not for ever. Not thread-safe.
class BumblebeeReport {
 public:
  using Clock = std::chrono::steady_clock;

  /// Fills `status`; to be called about once a second. `wanted_rate_hz`: what was configured.
  void fill(const bumblebee::DriverStatistics& now, double wanted_rate_hz,
            const BumblebeeCalibration::Verdict& calibration, Clock::time_point time,
            DiagnosticStatus& status);

 private:
  struct Counts {
    Clock::time_point time;
    std::uint64_t dropped, lost_packets;
  };
  void remember(const bumblebee::DriverStatistics& now, Clock::time_point time);
  void warn(const bumblebee::DriverStatistics& now, double wanted_rate_hz, Clock::time_point time,
            DiagnosticStatus& status) const;

  std::deque<Counts> recent_;
  std::uint64_t connections_ = 0;
  Clock::time_point streaming_since_;
};

}  // namespace scanner::bridge
