#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "scanner/core/status.h"
#include "scanner/core/time.h"

namespace scanner::mti {

/// Lets a thread out of poll(): rung by another one, and stays rung until it is answered.
class WakeUpCall {
 public:
  WakeUpCall();  ///< throws ConfigurationError when there are no descriptors left
  ~WakeUpCall();
  WakeUpCall(const WakeUpCall&) = delete;
  WakeUpCall& operator=(const WakeUpCall&) = delete;

  int descriptor() const { return descriptor_; }
  void ring() const;
  void answer() const;
  /// Until it is rung or the time is up; true when rung. Does not answer.
  bool wait(double seconds) const;

 private:
  int descriptor_;
};

/// A serial port (or pseudo-terminal) of its own: raw, eight bits, no parity, one or two stop bits.
/// Not thread-safe; a WakeUpCall may be rung from any thread.
class SerialPort {
 public:
  struct Options {
    int baud_rate = 115200;  ///< any; the driver of the port decides
    bool two_stop_bits = false;
    bool low_latency = true;  ///< ask the port's driver not to collect bytes, where it knows how
  };
  /// What read() found, and the host's time right before and after reading: the bytes were there at
  /// `after`, and what follows them was not there at `before`.
  struct Chunk {
    std::vector<std::uint8_t> bytes;  ///< empty: nothing came in time, or the call was rung
    Time before;
    Time after;
  };

  /// `wake_up` must outlive the port. Opens exclusively: kIoError says when it is in use, missing,
  /// not permitted (with the remedy) or no serial port; kUnsupported for a baud rate that it
  /// refuses.
  static Result<SerialPort> open(const std::string& path, const Options& options,
                                 const WakeUpCall* wake_up = nullptr);
  ~SerialPort();
  SerialPort(SerialPort&& other) noexcept;
  SerialPort& operator=(SerialPort&&) = delete;

  /// kUnsupported when the port does not do this rate. Bytes under way are sent before.
  Status setBaudRate(int baud_rate);
  /// Waits for bytes for at most `seconds`. kIoError when the port is gone (cable pulled).
  Result<Chunk> read(double seconds);
  /// All bytes, within `seconds`; kIoError when they cannot be sent by then, or the port is gone.
  Status write(const std::vector<std::uint8_t>& bytes, double seconds);
  /// Forgets what has come and was not read.
  void discardInput();

  const std::string& path() const { return path_; }
  int baudRate() const { return options_.baud_rate; }
  double secondsPerByte() const;
  /// Whether the driver of the port promised not to collect bytes.
  bool lowLatency() const { return low_latency_; }

 private:
  SerialPort(int descriptor, std::string path, const Options& options, const WakeUpCall* wake_up);
  Status configure(int baud_rate);

  int descriptor_ = -1;
  std::string path_;
  Options options_;
  const WakeUpCall* wake_up_ = nullptr;
  bool low_latency_ = false;
};

}  // namespace scanner::mti
