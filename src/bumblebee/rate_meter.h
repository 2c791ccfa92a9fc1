#pragma once

#include <chrono>
#include <cstdint>
#include <deque>

namespace scanner::bumblebee {

/// Frames and bytes per second over the last seconds, on a monotonic clock.
class RateMeter {
 public:
  using Moment = std::chrono::steady_clock::time_point;

  void add(Moment at, std::uint64_t bytes) {
    entries_.push_back({at, bytes});
    forget(at);
  }
  void clear() { entries_.clear(); }

  struct Rates {
    double frames_hz = 0.0;
    double bytes_hz = 0.0;
  };
  /// 0 when fewer than two frames came within the window before `now`.
  Rates rates(Moment now) const {
    auto first = entries_.begin();
    while (first != entries_.end() && now - first->at > kWindow) ++first;
    if (entries_.end() - first < 2) return {};
    const double span = std::chrono::duration<double>(entries_.back().at - first->at).count();
    if (span <= 0.0) return {};
    double bytes = 0.0;
    for (auto e = first + 1; e != entries_.end(); ++e) bytes += static_cast<double>(e->bytes);
    return {static_cast<double>(entries_.end() - first - 1) / span, bytes / span};
  }

 private:
  static constexpr std::chrono::seconds kWindow{5};
  struct Entry {
    Moment at;
    std::uint64_t bytes;
  };
  void forget(Moment now) {
    while (now - entries_.front().at > kWindow) entries_.pop_front();
  }
  std::deque<Entry> entries_;
};

}  // namespace scanner::bumblebee
