#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

/// Framing of the Xsens MT protocol (MT Low-Level Communication Documentation; hardware facts in
/// docs): FA FF MID LEN DATA CS, LEN = FF announces a 16-bit length, all bytes after FA sum to 0.
namespace scanner::mti {

/// Message identifiers; the acknowledgement of a request is its identifier + 1.
enum class MessageId : std::uint8_t {
  kReqDid = 0x00,
  kDeviceId = 0x01,
  kSetPeriod = 0x04,
  kReqConfiguration = 0x0C,
  kConfiguration = 0x0D,
  kRestoreFactoryDefaults = 0x0E,
  kGoToMeasurement = 0x10,
  kReqFirmwareRevision = 0x12,
  kSetBaudRate = 0x18,
  kReqProductCode = 0x1C,
  kReqHardwareVersion = 0x1E,
  kGoToConfig = 0x30,
  kMtData = 0x32,
  kReqData = 0x34,
  kMtData2 = 0x36,
  kWakeUp = 0x3E,
  kWakeUpAck = 0x3F,
  kReset = 0x40,
  kError = 0x42,
  kReqFilterScenarios = 0x62,
  kSetFilterScenario = 0x64,
  kSetHeading = 0x82,
  kFilterSettings = 0xA0,
  kResetOrientation = 0xA4,
  kSetOutputConfiguration = 0xC0,
  kSetOutputMode = 0xD0,
  kSetOutputSettings = 0xD2,
  kSetOutputSkipFactor = 0xD4,
  kSetSyncIn = 0xD6,
  kSetSyncOut = 0xD8,
  kSetErrorMode = 0xDA,
  kSetObjectAlignment = 0xE0,
};

/// The one data byte of an Error message.
enum class ErrorCode : std::uint8_t {
  kPeriod = 0x03,
  kMessage = 0x04,        ///< unknown, or not allowed in this state
  kTimerOverflow = 0x1E,  ///< the period is too short for what is to be sent
  kBaudRate = 0x20,
  kParameter = 0x21,
  kLineTooSlow = 0x29,  ///< more data than the baud rate carries
};

/// Data bytes of the longest message.
inline constexpr std::size_t kLongestData = 8192;

struct Message {
  std::uint8_t id = 0;
  std::vector<std::uint8_t> data;

  bool is(MessageId other) const { return id == static_cast<std::uint8_t>(other); }
};

/// The bytes on the wire. Throws ConfigurationError above 8192 data bytes.
std::vector<std::uint8_t> encode(const Message& message);

/// Finds whole messages in a stream of bytes that may start anywhere and be damaged: a frame whose
/// checksum is wrong is dropped, and the search goes on one byte after its start. Never reads
/// beyond what was given; between calls of next() that return nothing it holds less than one frame.
///
/// A damaged length makes the parser wait for the bytes it announces; what was swallowed meanwhile
/// is found again afterwards, but late. Where no long messages are expected, a small `longest`
/// keeps that wait short: announcements beyond it are no frames. Not thread-safe.
class MessageParser {
 public:
  struct Statistics {
    std::uint64_t messages = 0;
    std::uint64_t checksum_errors = 0;
    std::uint64_t skipped_bytes = 0;  ///< outside of any whole message
  };

  explicit MessageParser(std::size_t longest = kLongestData) : longest_(longest) {}

  void push(const std::uint8_t* bytes, std::size_t count);
  /// The next whole message, or nothing until more bytes come.
  std::optional<Message> next();
  const Statistics& statistics() const { return statistics_; }

 private:
  enum class Candidate { kIncomplete, kNoFrame, kWhole };

  Candidate inspect();
  void skipByte();

  std::size_t longest_;
  std::vector<std::uint8_t> buffer_;
  std::size_t begin_ = 0;        ///< of what is not yet consumed
  std::size_t data_offset_ = 0;  ///< of the candidate's data, from begin_
  std::size_t data_size_ = 0;
  Statistics statistics_;
};

}  // namespace scanner::mti
