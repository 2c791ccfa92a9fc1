#include "mti/device.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

namespace scanner::mti {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kKnockS = 0.15;   ///< for an answer to GoToConfig
constexpr double kListenS = 0.15;  ///< before a word is said, to tell whether it measures
constexpr double kWakeUpS = 1.5;   ///< from a Reset to WakeUp
constexpr int kKnocks = 2;
constexpr std::uint64_t kNoiseBytes = 8;

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

Status stoppedStatus() { return {StatusCode::kIoError, "stopped"}; }

std::string hexadecimal(std::uint8_t value) {
  static const char* const digits = "0123456789ABCDEF";
  return {'0', 'x', digits[value >> 4U], digits[value & 0xFU]};
}

}  // namespace

Device::Device(SerialPort port, const DriverOptions& options, const WakeUpCall& stop)
    : options_(options), stream_(std::move(port), stop) {}

Result<Message> Device::ask(const Message& request, int attempts) {
  const auto id = static_cast<MessageId>(request.id);
  for (int attempt = 0; attempt < attempts; ++attempt) {
    if (const Status status = stream_.send(request); !status) return status;
    const Clock::time_point start = Clock::now();
    while (since(start) < options_.answer_timeout_s) {
      const auto incoming = stream_.next(options_.answer_timeout_s - since(start));
      if (!incoming) return incoming.status();
      if (stream_.stopped()) return stoppedStatus();
      if (!*incoming) break;
      const Message& message = (**incoming).message;
      switch (answerKind(message, id)) {
        case AnswerKind::kAcknowledgement:
          return message;
        case AnswerKind::kError: {
          const Result<ErrorCode> code = parseError(message);
          return Status(StatusCode::kUnsupported, "the MTi refuses request " +
                                                      hexadecimal(request.id) + ": " +
                                                      (code ? describe(*code) : "unknown error"));
        }
        case AnswerKind::kOther:
          break;
      }
      if (message.is(MessageId::kWakeUp)) {
        if (const Status sent = stream_.send(mti::request(MessageId::kWakeUpAck)); !sent) {
          return sent;
        }
      }
    }
  }
  return Status(StatusCode::kIoError, "no answer to request " + hexadecimal(request.id));
}

Status Device::goToConfig() {
  const Result<Message> answer = ask(MessageId::kGoToConfig);
  return answer ? Status::ok() : answer.status();
}

Status Device::goToMeasurement() {
  const Result<Message> answer = ask(MessageId::kGoToMeasurement);
  return answer ? Status::ok() : answer.status();
}

Status Device::reset(OrientationReset reset) {
  const Result<Message> answer = ask(resetOrientation(reset));
  return answer ? Status::ok() : answer.status();
}

/// What comes in answer to GoToConfig. Data and WakeUp show that the rate is right, too: then it is
/// asked again.
Result<Device::Seen> Device::listenForAnswer(double seconds) {
  const Clock::time_point start = Clock::now();
  const std::uint64_t skipped = stream_.statistics().skipped_bytes;
  bool alive = false;
  while (since(start) < seconds) {
    const auto incoming = stream_.next(seconds - since(start));
    if (!incoming) return incoming.status();
    if (stream_.stopped()) return stoppedStatus();
    if (!*incoming) break;
    const Message& message = (**incoming).message;
    const AnswerKind kind = answerKind(message, MessageId::kGoToConfig);
    if (kind == AnswerKind::kAcknowledgement) return Seen::kDevice;
    if (kind == AnswerKind::kError) {
      const Result<ErrorCode> code = parseError(message);
      refusal_ = code ? describe(*code) : "unknown error";
      return Seen::kErrors;
    }
    alive = true;
    if (message.is(MessageId::kWakeUp)) {
      if (const Status s = stream_.send(request(MessageId::kWakeUpAck)); !s) return s;
    }
    if (message.is(MessageId::kMtData) || message.is(MessageId::kMtData2)) was_measuring_ = true;
  }
  if (alive) return Seen::kErrors;
  const bool noise = stream_.statistics().skipped_bytes >= skipped + kNoiseBytes;
  return noise ? Seen::kNoise : Seen::kNothing;
}

Result<Device::Seen> Device::knock(int baud_rate, int attempts) {
  const Status rate = stream_.port().setBaudRate(baud_rate);
  if (rate.code() == StatusCode::kUnsupported) return Seen::kNothing;
  if (!rate) return rate;
  stream_.discardInput();
  if (listen_first_) {
    const Result<Seen> heard = listenForAnswer(kListenS);
    if (!heard) return heard;
  }
  Seen best = Seen::kNothing;
  for (int i = 0; i < attempts; ++i) {
    if (const Status sent = stream_.send(request(MessageId::kGoToConfig)); !sent) return sent;
    // One that sends messages at this rate is there, even if it does not listen yet.
    refusal_.clear();
    const Result<Seen> seen = listenForAnswer(kKnockS);
    if (!seen) return seen;
    if (*seen == Seen::kErrors && refusal_.empty()) attempts = std::max(attempts, kAttempts);
    best = std::max(best, *seen);
    if (best == Seen::kDevice) break;
  }
  return best;
}

Status Device::find(int first_baud_rate) {
  std::vector<int> rates = baudRates();
  const auto known = std::find(rates.begin(), rates.end(), first_baud_rate);
  if (known != rates.end()) std::rotate(rates.begin(), known, known + 1);
  Seen best = Seen::kNothing;
  for (const int rate : rates) {
    const Result<Seen> seen = knock(rate, rate == rates.front() ? kKnocks + 1 : kKnocks);
    if (!seen) return seen.status();
    if (*seen == Seen::kDevice) return Status::ok();
    if (*seen == Seen::kErrors) {
      const std::string at = " at " + std::to_string(rate) + " baud";
      if (refusal_.empty()) {
        return {StatusCode::kIoError, "messages come" + at + ", but no request is answered"};
      }
      return {StatusCode::kIoError, "the device answers errors only" + at + ": " + refusal_};
    }
    best = std::max(best, *seen);
  }
  if (best == Seen::kNoise) {
    return {StatusCode::kIoError,
            "bytes come, but no MT message at any baud rate: another device, or the wrong cable"};
  }
  return {StatusCode::kIoError, "no answer at any baud rate: no MTi, or no power"};
}

Status Device::identify() {
  const Result<Message> id_answer = ask(MessageId::kReqDid);
  if (!id_answer) return id_answer.status();
  const Result<std::uint64_t> id = parseDeviceId(*id_answer);
  if (!id) return id.status();
  device_id_ = deviceIdText(*id);
  const Result<Message> firmware_answer = ask(MessageId::kReqFirmwareRevision);
  if (firmware_answer.status().code() == StatusCode::kIoError) return firmware_answer.status();
  if (firmware_answer) {
    const Result<FirmwareRevision> firmware = parseFirmwareRevision(*firmware_answer);
    if (firmware) firmware_ = toString(*firmware);
  }
  // Only generations that speak MTData2 know this request.
  const Result<Message> outputs = ask(request(MessageId::kSetOutputConfiguration), 2);
  if (!outputs && stream_.stopped()) return outputs.status();
  output_.mt_data2 = outputs && parseOutputConfiguration(*outputs).isOk();
  return Status::ok();
}

bool Device::answersAt(int baud_rate, int attempts) {
  const Result<Seen> seen = knock(baud_rate, attempts);
  return seen && *seen == Seen::kDevice;
}

/// After a Reset: WakeUp is answered, so that it stays in configuration; a device that went on to
/// measure comes back by GoToConfig.
bool Device::awaitWakeUp(int baud_rate) {
  if (!stream_.port().setBaudRate(baud_rate)) return false;
  const Clock::time_point start = Clock::now();
  while (since(start) < kWakeUpS && !stream_.stopped()) {
    const auto incoming = stream_.next(kKnockS);
    if (!incoming) return false;
    if (*incoming && (**incoming).message.is(MessageId::kWakeUp)) {
      stream_.send(request(MessageId::kWakeUpAck));
      break;
    }
    if (*incoming) break;  // it speaks
  }
  return answersAt(baud_rate, kAttempts);
}

Status Device::negotiateBaudRate() {
  const int wanted = options_.baud_rate;
  const int before = baudRate();
  if (before == wanted || !baudRateIdentifier(wanted)) return Status::ok();
  const std::string stays = "the line stays at " + std::to_string(before) + " baud: ";
  const Status port_can = stream_.port().setBaudRate(wanted);
  const Status back = stream_.port().setBaudRate(before);
  if (!back) return back;
  if (!port_can) {
    baud_rate_refused_ = true;
    note(stays + port_can.message());
    return Status::ok();
  }
  const Result<Message> answer = ask(setBaudRate(wanted), 1);
  if (answer.status().code() == StatusCode::kUnsupported) {
    baud_rate_refused_ = true;
    note(stays + answer.status().message());
    return Status::ok();
  }
  // Most devices change with the next Reset, some at once (and their answer may be lost by that).
  if (answersAt(before, 2)) {
    ask(request(MessageId::kReset), 1);
    if (awaitWakeUp(wanted)) return Status::ok();
  } else if (answersAt(wanted, kAttempts)) {
    return Status::ok();
  }
  if (stream_.stopped()) return stoppedStatus();
  baud_rate_refused_ = true;
  note(stays + "the device does not answer at " + std::to_string(wanted));
  callBack(wanted, before);
  return answersAt(before, kAttempts) ? Status::ok() : find(before);
}

/// A line that does not carry the new rate may still carry a request without its answer.
void Device::callBack(int from_baud_rate, int to_baud_rate) {
  if (!stream_.port().setBaudRate(from_baud_rate)) return;
  for (int i = 0; i < kAttempts; ++i) {
    for (const Message& message :
         {request(MessageId::kGoToConfig), setBaudRate(to_baud_rate), request(MessageId::kReset)}) {
      if (!stream_.send(message)) return;
      stream_.next(kListenS);
    }
  }
}

}  // namespace scanner::mti
