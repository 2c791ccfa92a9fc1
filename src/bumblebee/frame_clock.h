#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "scanner/bumblebee/driver.h"
#include "scanner/core/clock_model.h"

namespace scanner::bumblebee {

/// Mid-exposure stamps on the host's clock, strictly increasing, over all streams of a driver.
///
/// Clock models follow the least latency of arrivals, so they are fed a device time that the
/// latency does not depend on the exposure from: its end. After a change of exposure nobody knows
/// for some frames which one was used; the shortest of the last frames is taken for the model (an
/// arrival that seems late does no harm, one that seems early would pull the fit down for a whole
/// window), the one in force for the stamp.
class FrameClock {
 public:
  FrameClock();
  /// A stream begins: what was known of the camera's clock does not hold any more.
  void restart(double latency_s);

  struct Input {
    std::uint64_t advance = 1;  ///< frames since the call before, by the counter
    bool counted = false;       ///< the camera has a counter
    double period_s = 1.0;
    double exposure_s = 0.0;
  };
  Time stamp(const RawFrame& frame, const Input& input);

  StampSource source() const { return source_; }
  double driftPpm() const;
  double arrivalJitter() const;  ///< s; 0 for stamps by arrival

 private:
  static constexpr std::size_t kUnsettledFrames = 4;

  double shortestExposure(double exposure_s);
  const ClockModel& model() const;

  ClockModel device_, counter_;
  StampSource source_ = StampSource::kArrival;
  double latency_s_ = 0.0;
  Duration counted_{0};  ///< frames times period
  Time last_{Duration(0)};
  std::array<double, kUnsettledFrames> exposures_{};
  std::size_t frames_ = 0;
};

}  // namespace scanner::bumblebee
