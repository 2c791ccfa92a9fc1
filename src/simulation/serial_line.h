#pragma once

#include <cstdint>
#include <deque>
#include <vector>

namespace scanner::simulation {

/// When bytes arrive that are sent over a serial line (8N1: ten bits a byte) and through an
/// adapter. Bytes come in the portions of a receiver's FIFO (16 bytes), complete with their last
/// bit; with `burst_s` > 0 the adapter hands them over at multiples of that period only. Times are
/// seconds on the caller's clock. Knows no threads; pure bookkeeping.
class SerialLine {
 public:
  /// Bytes that arrive together, sent at one rate.
  struct Portion {
    double arrival_s = 0.0;
    int baud = 0;
    std::vector<std::uint8_t> bytes;
  };

  explicit SerialLine(double burst_s) : burst_s_(burst_s) {}

  /// Bytes that are ready at `ready_s` follow what is on the line already.
  void send(const std::vector<std::uint8_t>& bytes, double ready_s, int baud);
  /// When everything sent so far is through.
  double freeAt() const { return free_at_s_; }
  /// All that has arrived by now, once, in order.
  std::vector<Portion> arrived(double now_s);
  /// When the next bytes arrive; infinity when nothing is under way.
  double nextArrival() const;
  /// Loses what is under way.
  void clear();

 private:
  double burst_s_;
  double free_at_s_ = 0.0;
  std::deque<Portion> portions_;
};

}  // namespace scanner::simulation
