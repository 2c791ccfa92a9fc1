#include "scanner/mti/settings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "scanner/mti/bytes.h"

namespace scanner::mti {
namespace {

constexpr double kPeriodHz = 115200.0;
constexpr std::uint16_t kShortestPeriod = 225;  ///< 512 Hz
constexpr std::uint16_t kOnRequest = 0xFFFF;
constexpr std::size_t kBusBytes = 98;
constexpr std::size_t kDeviceBytes = 20;
constexpr std::size_t kScenarioBytes = 22;
constexpr std::size_t kMostSelections = 32;
constexpr double kPi = 3.14159265358979323846;

struct BaudRate {
  std::uint8_t identifier;
  int bits_per_second;
};
/// The first of several identifiers of a rate is the one that is sent.
constexpr std::array<BaudRate, 13> kBaudRateTable = {{{0x02, 115200},
                                                      {0x00, 460800},
                                                      {0x80, 921600},
                                                      {0x0A, 921600},
                                                      {0x01, 230400},
                                                      {0x04, 57600},
                                                      {0x05, 38400},
                                                      {0x07, 19200},
                                                      {0x09, 9600},
                                                      {0x03, 76800},
                                                      {0x06, 28800},
                                                      {0x08, 14400},
                                                      {0x0B, 4800}}};

std::string hexadecimal(unsigned value) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "0x%02X", value);
  return text.data();
}

Status wrongLength(const char* what, const Message& answer) {
  return {StatusCode::kInvalidInput,
          std::string(what) + " of " + std::to_string(answer.data.size()) + " bytes"};
}

/// Ok when `answer` is the acknowledgement of `request`.
Status checkAnswer(const Message& answer, MessageId request) {
  switch (answerKind(answer, request)) {
    case AnswerKind::kAcknowledgement:
      return Status::ok();
    case AnswerKind::kError: {
      const Result<ErrorCode> code = parseError(answer);
      return {StatusCode::kUnsupported, "the MTi refuses request " +
                                            hexadecimal(static_cast<std::uint8_t>(request)) + ": " +
                                            (code ? describe(*code) : code.status().message())};
    }
    case AnswerKind::kOther:
      break;
  }
  return {StatusCode::kInvalidInput, "message " + hexadecimal(answer.id) + " is no answer to " +
                                         hexadecimal(static_cast<std::uint8_t>(request))};
}

Message make(MessageId id, const ByteWriter& out) {
  return {static_cast<std::uint8_t>(id), out.bytes()};
}

Message makeNumber(MessageId id, std::uint16_t value) {
  ByteWriter out;
  out.u16(value);
  return make(id, out);
}

std::string trimmed(const std::vector<std::uint8_t>& bytes, std::size_t begin, std::size_t count) {
  std::string text;
  for (std::size_t i = begin; i < begin + count && bytes[i] != 0; ++i) {
    const bool printable = bytes[i] >= 0x20 && bytes[i] < 0x7F;
    text += printable ? static_cast<char>(bytes[i]) : '?';
  }
  const std::size_t last = text.find_last_not_of(' ');
  return last == std::string::npos ? std::string() : text.substr(0, last + 1);
}

}  // namespace

Message request(MessageId id) { return {static_cast<std::uint8_t>(id), {}}; }

AnswerKind answerKind(const Message& answer, MessageId request) {
  if (answer.is(MessageId::kError)) return AnswerKind::kError;
  const bool acknowledges = answer.id == static_cast<std::uint8_t>(request) + 1;
  return acknowledges ? AnswerKind::kAcknowledgement : AnswerKind::kOther;
}

Result<ErrorCode> parseError(const Message& answer) {
  if (!answer.is(MessageId::kError)) {
    return Status(StatusCode::kInvalidInput, "message " + hexadecimal(answer.id) + " is no Error");
  }
  // Later devices append details to the code.
  if (answer.data.empty()) return wrongLength("Error", answer);
  return static_cast<ErrorCode>(answer.data[0]);
}

std::string describe(ErrorCode code) {
  switch (code) {
    case ErrorCode::kPeriod:
      return "the period is not possible";
    case ErrorCode::kMessage:
      return "the message is not known, or not allowed now";
    case ErrorCode::kTimerOverflow:
      return "the period is too short for what is to be sent";
    case ErrorCode::kBaudRate:
      return "the baud rate is not possible";
    case ErrorCode::kParameter:
      return "a parameter is not possible";
    case ErrorCode::kLineTooSlow:
      return "the baud rate is too low for what is to be sent";
  }
  return "error " + hexadecimal(static_cast<std::uint8_t>(code));
}

const std::vector<int>& baudRates() {
  static const std::vector<int> rates = [] {
    std::vector<int> all;
    for (const BaudRate& rate : kBaudRateTable) {
      const bool known = std::find(all.begin(), all.end(), rate.bits_per_second) != all.end();
      if (!known) all.push_back(rate.bits_per_second);
    }
    return all;
  }();
  return rates;
}

std::optional<std::uint8_t> baudRateIdentifier(int bits_per_second) {
  for (const BaudRate& rate : kBaudRateTable) {
    if (rate.bits_per_second == bits_per_second) return rate.identifier;
  }
  return std::nullopt;
}

std::optional<int> baudRateOf(std::uint8_t identifier) {
  for (const BaudRate& rate : kBaudRateTable) {
    if (rate.identifier == identifier) return rate.bits_per_second;
  }
  return std::nullopt;
}

Message setBaudRate(int bits_per_second) {
  const std::optional<std::uint8_t> identifier = baudRateIdentifier(bits_per_second);
  if (!identifier) {
    throw ConfigurationError("an MTi has no baud rate of " + std::to_string(bits_per_second));
  }
  return {static_cast<std::uint8_t>(MessageId::kSetBaudRate), {*identifier}};
}

Result<int> parseBaudRate(const Message& answer) {
  const Result<std::uint32_t> identifier = parseNumber(answer, MessageId::kSetBaudRate, 1);
  if (!identifier) return identifier.status();
  const std::optional<int> rate = baudRateOf(static_cast<std::uint8_t>(*identifier));
  if (!rate) {
    return Status(StatusCode::kInvalidInput, "baud rate identifier " + hexadecimal(*identifier));
  }
  return *rate;
}

Result<std::uint64_t> parseDeviceId(const Message& answer) {
  if (const Status status = checkAnswer(answer, MessageId::kReqDid); !status) return status;
  if (answer.data.size() != 4 && answer.data.size() != 8) return wrongLength("DeviceID", answer);
  std::uint64_t id = 0;
  for (const std::uint8_t byte : answer.data) id = (id << 8U) | byte;
  return id;
}

std::string deviceIdText(std::uint64_t device_id) {
  std::array<char, 20> text{};
  const int digits = device_id > 0xFFFFFFFFU ? 16 : 8;
  std::snprintf(text.data(), text.size(), "%0*llX", digits,
                static_cast<unsigned long long>(device_id));
  return text.data();
}

Result<FirmwareRevision> parseFirmwareRevision(const Message& answer) {
  if (const Status status = checkAnswer(answer, MessageId::kReqFirmwareRevision); !status) {
    return status;
  }
  if (answer.data.size() != 3 && answer.data.size() != 11) {
    return wrongLength("FirmwareRev", answer);
  }
  ByteReader in(answer.data);
  FirmwareRevision firmware;
  firmware.major = in.u8();
  firmware.minor = in.u8();
  firmware.revision = in.u8();
  if (answer.data.size() == 11) firmware.build = in.u32();
  return firmware;
}

std::string toString(const FirmwareRevision& firmware) {
  std::string text = std::to_string(firmware.major) + '.' + std::to_string(firmware.minor) + '.' +
                     std::to_string(firmware.revision);
  if (firmware.build) text += " build " + std::to_string(*firmware.build);
  return text;
}

Result<std::string> parseProductCode(const Message& answer) {
  if (const Status status = checkAnswer(answer, MessageId::kReqProductCode); !status) return status;
  return trimmed(answer.data, 0, answer.data.size());
}

std::optional<std::uint16_t> periodOfRate(double rate_hz) {
  if (!(rate_hz > 0.0)) return std::nullopt;
  const double period = std::round(kPeriodHz / rate_hz);
  if (!(period >= kShortestPeriod && period <= 65535.0)) return std::nullopt;
  return static_cast<std::uint16_t>(period);
}

double rateOfPeriod(std::uint16_t period) { return period == 0 ? 0.0 : kPeriodHz / period; }

Message setPeriod(std::uint16_t period) {
  if (period < kShortestPeriod) {
    throw ConfigurationError("period of an MTi " + std::to_string(period) + ", at least " +
                             std::to_string(kShortestPeriod));
  }
  return makeNumber(MessageId::kSetPeriod, period);
}

Message setOutputMode(std::uint16_t mode) { return makeNumber(MessageId::kSetOutputMode, mode); }

Message setOutputSettings(std::uint32_t settings) {
  ByteWriter out;
  out.u32(settings);
  return make(MessageId::kSetOutputSettings, out);
}

Message setOutputSkipFactor(std::uint16_t skip) {
  return makeNumber(MessageId::kSetOutputSkipFactor, skip);
}

Message setErrorMode(std::uint16_t mode) {
  if (mode > 3) throw ConfigurationError("error mode " + std::to_string(mode) + ", at most 3");
  return makeNumber(MessageId::kSetErrorMode, mode);
}

Message setHeading(double heading_rad) {
  if (!(std::abs(heading_rad) <= kPi)) {
    throw ConfigurationError("heading " + std::to_string(heading_rad) + " rad, within -pi..pi");
  }
  ByteWriter out;
  out.f32(heading_rad);
  return make(MessageId::kSetHeading, out);
}

Message resetOrientation(OrientationReset reset) {
  return makeNumber(MessageId::kResetOrientation, static_cast<std::uint8_t>(reset));
}

Result<std::uint32_t> parseNumber(const Message& answer, MessageId request, std::size_t bytes) {
  if (const Status status = checkAnswer(answer, request); !status) return status;
  if (answer.data.size() != bytes || bytes > 4) return wrongLength("setting", answer);
  std::uint32_t value = 0;
  for (const std::uint8_t byte : answer.data) value = (value << 8U) | byte;
  return value;
}

double DeviceConfiguration::rateHz() const {
  return skip_factor == kOnRequest ? 0.0 : rateOfPeriod(period) / (skip_factor + 1.0);
}

Result<DeviceConfiguration> parseConfiguration(const Message& answer) {
  if (const Status status = checkAnswer(answer, MessageId::kReqConfiguration); !status) {
    return status;
  }
  if (answer.data.size() < kBusBytes) return wrongLength("Configuration", answer);
  ByteReader in(answer.data);
  const auto skip = [&in](std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; ++i) in.u8();
  };
  DeviceConfiguration configuration;
  configuration.master_id = in.u32();
  configuration.period = in.u16();
  configuration.skip_factor = in.u16();
  configuration.sync_in_mode = in.u16();
  configuration.sync_in_skip_factor = in.u16();
  configuration.sync_in_offset = in.u32();
  skip(8 + 8 + 32 + 32);  // date, time, reserved for the host, reserved for the client
  const std::uint16_t devices = in.u16();
  if (devices == 0 || answer.data.size() != kBusBytes + kDeviceBytes * devices) {
    return wrongLength("Configuration", answer);
  }
  for (std::uint16_t i = 0; i < devices; ++i) {
    DeviceConfiguration::Device device;
    device.id = in.u32();
    device.data_length = in.u16();
    device.output_mode = in.u16();
    device.output_settings = in.u32();
    skip(8);
    configuration.devices.push_back(device);
  }
  return configuration;
}

Message encodeConfiguration(const DeviceConfiguration& configuration) {
  if (configuration.devices.empty()) throw ConfigurationError("Configuration without a device");
  ByteWriter out;
  out.u32(configuration.master_id);
  out.u16(configuration.period);
  out.u16(configuration.skip_factor);
  out.u16(configuration.sync_in_mode);
  out.u16(configuration.sync_in_skip_factor);
  out.u32(configuration.sync_in_offset);
  out.zeros(8 + 8 + 32 + 32);
  out.u16(static_cast<std::uint16_t>(configuration.devices.size()));
  for (const DeviceConfiguration::Device& device : configuration.devices) {
    out.u32(device.id);
    out.u16(device.data_length);
    out.u16(device.output_mode);
    out.u32(device.output_settings);
    out.zeros(8);
  }
  return make(MessageId::kConfiguration, out);
}

Message setFilterParameter(FilterParameter parameter, double value, bool store) {
  const bool possible = parameter == FilterParameter::kGain ? value > 0.01 && value <= 50.0
                                                            : value >= 0.0 && value < 10.0;
  if (!possible) {
    throw ConfigurationError(parameter == FilterParameter::kGain
                                 ? "filter gain " + std::to_string(value) +
                                       " Hz, above 0.01, up to 50"
                                 : "filter weighting " + std::to_string(value) + ", 0 to below 10");
  }
  ByteWriter out;
  out.u8(static_cast<std::uint8_t>(parameter));
  out.f32(value);
  out.u8(store ? 1 : 0);
  return make(MessageId::kFilterSettings, out);
}

Message requestFilterParameter(FilterParameter parameter) {
  return {static_cast<std::uint8_t>(MessageId::kFilterSettings),
          {static_cast<std::uint8_t>(parameter)}};
}

Result<double> parseFilterParameter(const Message& answer, FilterParameter parameter) {
  if (const Status status = checkAnswer(answer, MessageId::kFilterSettings); !status) return status;
  if (answer.data.size() < 5 || answer.data.size() > 6)
    return wrongLength("filter setting", answer);
  ByteReader in(answer.data);
  if (in.u8() != static_cast<std::uint8_t>(parameter)) {
    return Status(StatusCode::kInvalidInput, "answer about another filter setting");
  }
  const double value = in.f32();
  if (!std::isfinite(value)) return Status(StatusCode::kInvalidInput, "filter setting not finite");
  return value;
}

Result<std::vector<FilterScenario>> parseFilterScenarios(const Message& answer) {
  if (const Status status = checkAnswer(answer, MessageId::kReqFilterScenarios); !status) {
    return status;
  }
  if (answer.data.size() % kScenarioBytes != 0) return wrongLength("AvailableScenarios", answer);
  std::vector<FilterScenario> scenarios;
  for (std::size_t i = 0; i < answer.data.size(); i += kScenarioBytes) {
    scenarios.push_back(
        {answer.data[i], answer.data[i + 1], trimmed(answer.data, i + 2, kScenarioBytes - 2)});
  }
  return scenarios;
}

Message setFilterScenario(std::uint8_t type) {
  return makeNumber(MessageId::kSetFilterScenario, type);  // the high byte is a version, ignored
}

Message setOutputConfiguration(const std::vector<OutputSelection>& selections) {
  if (selections.size() > kMostSelections) {
    throw ConfigurationError("output configuration of " + std::to_string(selections.size()) +
                             " entries, at most " + std::to_string(kMostSelections));
  }
  ByteWriter out;
  for (const OutputSelection& selection : selections) {
    out.u16(selection.identifier);
    out.u16(selection.rate_hz);
  }
  return make(MessageId::kSetOutputConfiguration, out);
}

Result<std::vector<OutputSelection>> parseOutputConfiguration(const Message& answer) {
  if (const Status status = checkAnswer(answer, MessageId::kSetOutputConfiguration); !status) {
    return status;
  }
  if (answer.data.size() % 4 != 0) return wrongLength("OutputConfiguration", answer);
  ByteReader in(answer.data);
  std::vector<OutputSelection> selections(answer.data.size() / 4);
  for (OutputSelection& selection : selections) {
    selection.identifier = in.u16();
    selection.rate_hz = in.u16();
  }
  return selections;
}

}  // namespace scanner::mti
