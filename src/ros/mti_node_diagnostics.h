#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>

#include "ros/diagnostics.h"
#include "scanner/mti/driver.h"

namespace scanner::bridge {

/// What the diagnostics of an MTi say, from what the driver counts. Remembers the counts of the
/// last seconds: a lost sample is a warning for a while, not for ever. Not thread-safe.
class MtiReport {
 public:
  using Clock = std::chrono::steady_clock;

  /// Fills `status`; to be called about once a second. `wanted_rate_hz`: what was configured; 0
  /// when the device was left as it is.
  void fill(const mti::DriverStatistics& now, double wanted_rate_hz,
            const std::optional<double>& temperature_c, Clock::time_point time,
            DiagnosticStatus& status);

 private:
  struct Counts {
    Clock::time_point time;
    std::uint64_t lost, rejected, checksum_errors;
  };
  void remember(const mti::DriverStatistics& now, Clock::time_point time);
  void warn(const mti::DriverStatistics& now, double wanted_rate_hz, Clock::time_point time,
            DiagnosticStatus& status) const;

  std::deque<Counts> recent_;
  std::uint64_t connections_ = 0;
  Clock::time_point measuring_since_;
};

}  // namespace scanner::bridge
