#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "mti/device.h"
#include "scanner/mti/mt_data.h"
#include "scanner/mti/mt_data2.h"

namespace scanner::mti {
namespace {

constexpr double kFastestOrientationHz = 120.0;  ///< of legacy devices (MT0100P)
constexpr double kFastestHz = 512.0;
constexpr double kFastestMtData2Hz = 400.0;
constexpr double kFullLine = 0.95;  ///< of the line's bytes, at most
constexpr std::size_t kFrameBytes = 5;
constexpr std::uint16_t kCountMissed = 1;  ///< SetErrorMode

std::string hertz(double rate) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g Hz", rate);
  return text.data();
}

std::uint32_t orientationBits(OrientationFormat format) {
  switch (format) {
    case OrientationFormat::kQuaternion:
      return output_settings::kQuaternion;
    case OrientationFormat::kMatrix:
      return output_settings::kMatrix;
    case OrientationFormat::kEuler:
      return output_settings::kEuler;
  }
  return output_settings::kMatrix;
}

std::uint16_t orientationPacket(OrientationFormat format) {
  switch (format) {
    case OrientationFormat::kQuaternion:
      return xdi::kQuaternion;
    case OrientationFormat::kMatrix:
      return xdi::kRotationMatrix;
    case OrientationFormat::kEuler:
      return xdi::kEulerAngles;
  }
  return xdi::kRotationMatrix;
}

/// Bytes of a packet in single precision, its head of three included.
std::size_t packetBytes(std::uint16_t identifier) {
  switch (identifier) {
    case xdi::kPacketCounter:
      return 5;
    case xdi::kTemperature:
      return 7;
    case xdi::kQuaternion:
      return 19;
    case xdi::kRotationMatrix:
      return 39;
    default:
      return 15;
  }
}

}  // namespace

Status Device::configure() {
  const bool want = options_.configure;
  if (output_.mt_data2) {
    const Status status = want ? configureMtData2() : readMtData2();
    // Set to legacy output by its owner: understood as well.
    if (status || want) return status;
    output_.mt_data2 = false;
  }
  if (want) {
    if (const Status status = configureLegacy(); !status) return status;
  }
  return readLegacy();
}

double Device::rateThatFits(double rate_hz, std::size_t frame_bytes) {
  const double most =
      kFullLine / (static_cast<double>(frame_bytes) * stream_.port().secondsPerByte());
  if (rate_hz <= most) return rate_hz;
  note("rate limited to " + hertz(most) + " instead of " + hertz(rate_hz) + ": " +
       std::to_string(frame_bytes) + " bytes a sample at " + std::to_string(baudRate()) + " baud");
  return most;
}

/// Asks first, so that the device's memory is only written when something changes.
Status Device::ensure(const Message& wanted) {
  const Result<Message> present = ask(request(static_cast<MessageId>(wanted.id)));
  if (present && present->data == wanted.data) return Status::ok();
  if (present.status().code() == StatusCode::kIoError) return present.status();
  const Result<Message> answer = ask(wanted);
  return answer ? Status::ok() : answer.status();
}

/// A device that finds the rate too high for its output says so; then the next lower one is tried.
Status Device::setRate(double rate_hz) {
  Status status;
  for (double rate = rate_hz; rate >= 1.8; rate /= 2.0) {
    // The next longer period: not above the rate that fits.
    const std::optional<std::uint16_t> nearest = periodOfRate(rate);
    if (!nearest) break;
    const bool above = rateOfPeriod(*nearest) > rate * 1.0001 && *nearest < 65535;
    status = ensure(setPeriod(static_cast<std::uint16_t>(*nearest + (above ? 1 : 0))));
    if (status) {
      if (rate < rate_hz) note("rate " + hertz(rate) + ": the device refuses higher ones");
      return status;
    }
    if (status.code() == StatusCode::kIoError) return status;
  }
  return status;
}

Status Device::configureLegacy() {
  namespace mode = output_mode;
  const auto wanted_mode = static_cast<std::uint16_t>(
      mode::kCalibrated | mode::kOrientation | (options_.temperature ? mode::kTemperature : 0));
  const std::uint32_t wanted_settings =
      output_settings::kSampleCounter | orientationBits(options_.orientation) |
      (options_.magnetic_field ? 0 : output_settings::kNoMagnetometer);
  double rate = std::min(options_.rate_hz, kFastestHz);
  if (rate > kFastestOrientationHz) {
    rate = kFastestOrientationHz;
    note("rate limited to " + hertz(rate) + ": the device computes no more orientations");
  }
  rate = rateThatFits(rate, kFrameBytes + mtDataSize(wanted_mode, wanted_settings));
  const Status status = [&] {
    Status s = ensure(setOutputMode(wanted_mode));
    if (s) s = ensure(setOutputSettings(wanted_settings));
    if (s) s = setRate(rate);
    if (s) s = ensure(setOutputSkipFactor(0));
    return s;
  }();
  if (!status) return status;
  const Status error_mode = ensure(setErrorMode(kCountMissed));
  if (error_mode.code() == StatusCode::kIoError) return error_mode;
  return configureFilter();
}

/// Later devices have scenarios instead; theirs is left as it is.
Status Device::configureFilter() {
  const std::array<std::pair<FilterParameter, double>, 2> wanted = {
      {{FilterParameter::kGain, options_.filter_gain_hz},
       {FilterParameter::kWeighting, options_.filter_weighting}}};
  for (const auto& [parameter, value] : wanted) {
    const Result<Message> present = ask(requestFilterParameter(parameter));
    if (present.status().code() == StatusCode::kIoError) return present.status();
    if (!present) {
      note("filter of the device left as it is: it knows no gain and weighting");
      return Status::ok();
    }
    const Result<double> is = parseFilterParameter(*present, parameter);
    if (is && std::abs(*is - value) <= 1e-6 * std::max(1.0, std::abs(value))) continue;
    const Result<Message> answer = ask(setFilterParameter(parameter, value, true));
    if (answer.status().code() == StatusCode::kIoError) return answer.status();
    if (!answer) note("filter setting refused: " + answer.status().message());
  }
  return Status::ok();
}

Status Device::readLegacy() {
  const Result<Message> answer = ask(MessageId::kReqConfiguration);
  if (!answer) return answer.status();
  const Result<DeviceConfiguration> is = parseConfiguration(*answer);
  if (!is) return is.status();
  const DeviceConfiguration::Device& device = is->devices.front();
  output_.mode = device.output_mode;
  output_.settings = device.output_settings;
  output_.rate_hz = is->rateHz();
  output_.counter = (device.output_settings & output_settings::kSampleCounter) != 0;
  if (mtDataSize(output_.mode, output_.settings) == 0) {
    return {StatusCode::kUnsupported, "the device is set to an output that cannot be read (mode " +
                                          std::to_string(output_.mode) + ")"};
  }
  if (!(output_.rate_hz > 0.0)) {
    return {StatusCode::kUnsupported, "the device is set to send data on request only"};
  }
  return Status::ok();
}

Status Device::configureMtData2() {
  std::vector<std::uint16_t> packets = {
      xdi::kPacketCounter,
      static_cast<std::uint16_t>(orientationPacket(options_.orientation) | xdi::kEastNorthUp),
      xdi::kAcceleration, xdi::kRateOfTurn};
  if (options_.magnetic_field) packets.push_back(xdi::kMagneticField);
  if (options_.temperature) packets.push_back(xdi::kTemperature);
  std::size_t bytes = kFrameBytes;
  for (const std::uint16_t packet : packets) bytes += packetBytes(packet);
  const double rate =
      std::max(1.0, std::floor(rateThatFits(std::min(options_.rate_hz, kFastestMtData2Hz), bytes)));
  std::vector<OutputSelection> wanted;
  for (const std::uint16_t packet : packets) {
    const bool every = packet == xdi::kPacketCounter || packet == xdi::kTemperature;
    wanted.push_back({packet, every ? kEveryMessage : static_cast<std::uint16_t>(rate)});
  }
  const Result<Message> answer = ask(setOutputConfiguration(wanted));
  if (!answer) return answer.status();
  return readMtData2();
}

/// What it sends; rates are those it made of the wish.
Status Device::readMtData2() {
  const Result<Message> answer = ask(MessageId::kSetOutputConfiguration);
  if (!answer) return answer.status();
  const Result<std::vector<OutputSelection>> is = parseOutputConfiguration(*answer);
  if (!is) return is.status();
  std::uint16_t rate = 0;
  output_.counter = false;
  for (const OutputSelection& selection : *is) {
    if (selection.rate_hz != kEveryMessage) rate = std::max(rate, selection.rate_hz);
    if (selection.identifier == xdi::kPacketCounter) output_.counter = true;
  }
  output_.rate_hz = rate;
  if (rate == 0) {
    return {StatusCode::kUnsupported, "the device is set to send no MTData2 at a fixed rate"};
  }
  if (options_.configure && std::abs(rate - options_.rate_hz) > 0.5 && notes_.empty()) {
    note("rate " + hertz(rate) + " instead of " + hertz(options_.rate_hz) +
         ": what the device can do");
  }
  return Status::ok();
}

}  // namespace scanner::mti
