#pragma once

#include <deque>
#include <optional>

#include "mti/device.h"
#include "mti/message_stream.h"
#include "scanner/core/clock_model.h"
#include "scanner/mti/driver.h"
#include "scanner/mti/plausibility.h"

namespace scanner::mti {

/// Messages to samples: decoding, plausibility, counter, stamps, earth frame. Lives as long as the
/// driver, so that stamps and numbers go on across connections. Not thread-safe.
class Measurement {
 public:
  struct Statistics {
    std::uint64_t samples = 0;
    std::uint64_t lost = 0;
    std::uint64_t rejected = 0;
    double rate_hz = 0.0;
    double drift_ppm = 0.0;
    double arrival_jitter_s = 0.0;
  };

  explicit Measurement(double extra_latency_s) : extra_latency_s_(extra_latency_s) {}

  /// The device begins to measure: its counter starts anew.
  void begin(const Output& output);
  /// The sensor's frames change: values jump, and the filter must not hold that for damage. What is
  /// ready and was not taken is lost.
  void expectJump();
  /// Every message of the stream, in order.
  void push(const Incoming& incoming);
  /// The stream ended: no more messages come to judge what is held.
  void flush();
  /// What is ready to be given away, in order of stamps.
  std::optional<Sample> next();
  /// When the latest good data came; nothing since begin().
  std::optional<Time> lastArrival() const { return last_arrival_; }
  Statistics statistics() const;

 private:
  /// When a message was sent; the filter gives readings back later, and leaves some out.
  struct Sent {
    Time arrival;
    std::optional<std::uint16_t> counter;
    double length_s = 0.0;
    ClockModel::Evidence first_bit;
  };

  std::optional<Reading> decode(const Incoming& incoming);
  std::optional<Sent> takeSent(const Reading& reading);
  std::optional<Sample> sample(const Reading& reading, const Sent& sent);
  bool count(const Reading& reading);
  Time stamp(const Sent& sent);
  void beginEpoch();
  void measureRate(Time arrival);

  const double extra_latency_s_;
  Output output_;
  PlausibilityFilter filter_;
  std::deque<Sent> sent_;
  ClockModel clock_;
  bool epoch_began_ = false;
  std::uint64_t number_ = 0;        ///< of the latest sample
  std::uint64_t epoch_number_ = 0;  ///< at which the clock model began
  std::uint16_t counter_ = 0;
  std::optional<Time> last_arrival_;
  Time last_stamp_ = Time::min();
  std::uint64_t undecodable_ = 0;
  std::uint64_t duplicates_ = 0;
  std::uint64_t window_samples_ = 0;
  std::optional<Time> window_begin_;
  Statistics statistics_;
};

}  // namespace scanner::mti
