#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "scanner/core/time.h"

namespace scanner {

/// Maps the clock of a device to the host's, from pairs of (device time, time of arrival). Arrivals
/// are late by a latency that varies (bursts of a USB adapter, scheduling) and never early, so the
/// line runs along the lower envelope of the arrivals (Zhang, Liu, Xia: Clock synchronization
/// algorithms for network measurements, INFOCOM 2002), with the drift bounded by what crystals do.
/// The smallest latency is part of the result; what of it is known beforehand (transmission,
/// computing) the caller subtracts.
///
/// Arrivals in bursts leave a doubt: with samples every 10 ms and bursts every 16 ms the smallest
/// latency is anything up to 2 ms and changes as slowly as the clocks drift apart. So a caller that
/// knows it also says before which time a sample cannot have been taken: what was not there when
/// the burst before was read came later. The line then keeps the largest distance to both kinds of
/// bounds. Old bounds are loosened by what a crystal may wander since, instead of being forgotten
/// at once.
///
/// Stamps that update() returns are strictly increasing as long as device times are: when the fit
/// moves, stamps are steered there instead of jumping, with at most a tenth of the interval (half
/// of it when more than a second has to be made up). A step of either clock (a host's clock that is
/// set, a device that starts anew) is seen as arrivals far from the line, and the fit begins again;
/// then one stamp may go forward by the step, and none goes back. Bounded memory; about 100 us of
/// computing per second of device time. Not thread-safe.
class ClockModel {
 public:
  struct Options {
    double window_s = 300.0;         ///< of pairs that the fit uses
    double max_drift_ppm = 300.0;    ///< of the device's clock against the host's
    double wander_ppm_per_s = 0.01;  ///< how fast that drift may change
    double step_s = 0.5;  ///< arrivals this far off (early; or late, for a second) are a step
  };
  /// What is known about the host's time at one device time besides the arrival.
  struct Evidence {
    Time latest = Time::max();    ///< not after this
    Time earliest = Time::min();  ///< not before this; may now and then be wrong by some delay
  };
  ClockModel();
  /// Throws ConfigurationError for options that are not positive (wander_ppm_per_s may be 0).
  explicit ClockModel(const Options& options);
  ~ClockModel();
  ClockModel(ClockModel&&) noexcept;
  ClockModel& operator=(ClockModel&&) noexcept;

  /// `device_time`: on the device's own clock, unwrapped, larger than at the call before (else the
  /// call changes nothing and returns the last stamp). `arrival`: on the host's clock. Returns the
  /// host's time at `device_time`, plus the smallest latency.
  Time update(Duration device_time, Time arrival);
  Time update(Duration device_time, Time arrival, const Evidence& evidence);
  /// Forgets everything but the last stamp and the drift, which is where the next fit starts: the
  /// stream begins anew. Later stamps stay above it.
  void restart();

  bool ready() const;  ///< enough seen for a drift to be estimated
  double driftPpm()
      const;  ///< device against host; positive: the device's is fast; 0 before ready()
  double arrivalJitter() const;    ///< s, standard deviation of the latest 512 latencies
  std::uint64_t restarts() const;  ///< steps seen

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner
