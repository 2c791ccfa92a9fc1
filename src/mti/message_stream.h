#pragma once

#include <deque>
#include <optional>
#include <string>

#include "scanner/core/clock_model.h"
#include "scanner/core/status.h"
#include "scanner/mti/message.h"
#include "scanner/mti/serial_port.h"

namespace scanner::mti {

/// One whole message and what is known about when it was sent.
struct Incoming {
  Message message;
  Time arrival;                          ///< of its last byte
  double length_s = 0.0;                 ///< of its bytes on the line
  ClockModel::Evidence first_bit;        ///< when its transmission began
  MessageParser::Statistics statistics;  ///< of the line up to it
};

/// Bytes of a port to messages and back. It notes when which bytes were read: where a burst ends
/// within a message, the bytes on both sides of the cut tell when the message was sent, much closer
/// than the burst's own time.
class MessageStream {
 public:
  /// `stop` ends waiting when it is rung.
  MessageStream(SerialPort port, const WakeUpCall& stop);

  /// The next message; nothing when none came within `seconds` or stop was rung. kIoError when the
  /// port is gone.
  Result<std::optional<Incoming>> next(double seconds);
  Status send(const Message& message);
  /// Forgets what has come so far.
  void discardInput();

  bool stopped() const { return stop_.wait(0.0); }
  SerialPort& port() { return port_; }
  const MessageParser::Statistics& statistics() const { return parser_.statistics(); }

 private:
  struct Read {
    std::uint64_t end = 0;  ///< bytes read so far, this one's included
    Time before, after;
  };

  Status readMore(double seconds);
  Incoming annotate(Message message);

  SerialPort port_;
  const WakeUpCall& stop_;
  MessageParser parser_;
  std::deque<Read> reads_;
  std::uint64_t received_ = 0;
  std::uint64_t in_messages_ = 0;  ///< bytes of whole messages so far
};

}  // namespace scanner::mti
