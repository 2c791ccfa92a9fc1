#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "mti/message_stream.h"
#include "scanner/mti/driver.h"
#include "scanner/mti/settings.h"

namespace scanner::mti {

/// How the data of a device are to be read.
struct Output {
  bool mt_data2 = false;
  std::uint16_t mode = 0;  ///< legacy: of output mode and settings
  std::uint32_t settings = 0;
  double rate_hz = 0.0;  ///< of the messages
  bool counter = false;
};

/// The answers of an MTi to a host, on an open port. Each request waits for its acknowledgement and
/// is repeated when none comes, in the midst of data. Where a device keeps its settings without
/// power, they are asked first and only written when they differ. Not thread-safe.
class Device {
 public:
  /// `stop` ends every wait when rung; requests then fail.
  Device(SerialPort port, const DriverOptions& options, const WakeUpCall& stop);

  /// Looks for a device at `first_baud_rate` (0: none), then at all others, and brings it to
  /// configuration. The status says what was seen instead: silence, noise, errors.
  Status find(int first_baud_rate);
  /// find() listens at every rate before it speaks: slower, but wasMeasuring() is known then.
  void listenFirst() { listen_first_ = true; }
  /// What it is, once found.
  Status identify();
  /// Moves device and port to options.baud_rate, when it is not there. A device that does not go
  /// there stays where it was, and the notes say so. Fails when the device is lost.
  Status negotiateBaudRate();
  /// Sets what the options want, or with options.configure = false asks what is set.
  Status configure();
  Status goToMeasurement();
  /// From configuration or measurement.
  Status goToConfig();
  Status reset(OrientationReset reset);  ///< as resetOrientation(), waits

  /// kIoError when it does not answer in time, kUnsupported when it refuses; the message says what
  /// was asked.
  Result<Message> ask(const Message& request, int attempts = kAttempts);
  Result<Message> ask(MessageId request_id) { return ask(request(request_id)); }

  MessageStream& stream() { return stream_; }
  const Output& output() const { return output_; }
  const std::string& deviceId() const { return device_id_; }
  const std::string& firmware() const { return firmware_; }
  bool isMtData2() const { return output_.mt_data2; }
  int baudRate() { return stream_.port().baudRate(); }
  /// Whether the device refused the wanted rate, or did not go there.
  bool baudRateRefused() const { return baud_rate_refused_; }
  /// What could not be had as wanted, one line each.
  const std::vector<std::string>& notes() const { return notes_; }
  /// While it was looked for, before it was told anything, it sent data.
  bool wasMeasuring() const { return was_measuring_; }

 private:
  static constexpr int kAttempts = 4;

  enum class Seen { kNothing, kNoise, kErrors, kDevice };
  Result<Seen> knock(int baud_rate, int attempts);
  Result<Seen> listenForAnswer(double seconds);
  bool answersAt(int baud_rate, int attempts);
  bool awaitWakeUp(int baud_rate);
  void callBack(int from_baud_rate, int to_baud_rate);

  Status configureLegacy();
  Status readLegacy();
  Status configureFilter();
  Status configureMtData2();
  Status readMtData2();
  double rateThatFits(double rate_hz, std::size_t frame_bytes);
  Status ensure(const Message& wanted);
  Status setRate(double rate_hz);
  void note(std::string text) { notes_.push_back(std::move(text)); }

  const DriverOptions options_;
  MessageStream stream_;
  Output output_;
  std::string device_id_;
  std::string firmware_;
  std::string refusal_;  ///< of a device that answers errors only
  bool baud_rate_refused_ = false;
  bool was_measuring_ = false;
  bool listen_first_ = false;
  std::vector<std::string> notes_;
};

}  // namespace scanner::mti
