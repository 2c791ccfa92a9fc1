#pragma once

#include <chrono>
#include <cstdint>

namespace scanner {

/// Time of the sensors: integer nanoseconds since the Unix epoch. A tag type, so that a sensor
/// stamp is never compared with a wall clock by accident.
struct SensorClock {
  using duration = std::chrono::nanoseconds;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<SensorClock, duration>;
  static constexpr bool is_steady = false;
};

using Duration = SensorClock::duration;
using Time = SensorClock::time_point;

inline constexpr Time fromNanoseconds(std::int64_t nanoseconds) {
  return Time(Duration(nanoseconds));
}
inline constexpr std::int64_t toNanoseconds(Time time) { return time.time_since_epoch().count(); }
inline constexpr double toSeconds(Duration duration) {
  return static_cast<double>(duration.count()) * 1e-9;
}
/// Rounds to the nearest nanosecond.
inline constexpr Duration fromSeconds(double seconds) {
  return Duration(static_cast<std::int64_t>(seconds * 1e9 + (seconds < 0.0 ? -0.5 : 0.5)));
}

}  // namespace scanner
