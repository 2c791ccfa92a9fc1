#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "scanner/core/time.h"

namespace scanner::bumblebee {

/// Frames that lost packets. On the kernel's FireWire stack libdc1394 cannot tell: a buffer that
/// lacks packets of its frame is filled up with the beginning of the next one, so it completes late
/// by the pause between two frames. That is seen here, when the pause is long enough.
class LatenessCheck {
 public:
  void reset() { *this = LatenessCheck(); }
  /// `start`: of transmission; `watched`: the buffer was seen empty just before, so that `arrival`
  /// is the moment when the frame was complete.
  bool isDamaged(Duration start, Duration arrival, double transfer_s,
                 std::optional<std::uint32_t> counter, bool watched) {
    const double late_s = toSeconds(arrival - start) - transfer_s;
    const double pause_s = period_s_ - transfer_s;
    const bool damaged = watched && period_s_ > 0.0 && late_s > std::max(0.5 * pause_s, kSlack);
    if (counter && last_counter_ && !damaged) {
      const std::uint32_t frames = *counter - *last_counter_;
      if (frames >= 1 && frames < 1000) period_s_ = toSeconds(start - last_start_) / frames;
    }
    last_counter_ = counter;
    last_start_ = start;
    return damaged;
  }

 private:
  static constexpr double kSlack = 0.01;  // a busy host may wake us this late
  double period_s_ = 0.0;
  Duration last_start_{0};
  std::optional<std::uint32_t> last_counter_;
};

}  // namespace scanner::bumblebee
