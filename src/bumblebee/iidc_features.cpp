#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <string>

#include "bumblebee/iidc.h"
#include "bumblebee/iidc_registers.h"

// Exposure, gain, frame rate, white balance and temperature of IIDC cameras.

namespace scanner::bumblebee {
namespace {

using iidc::Feature;
using iidc::kAbsoluteCsr;
using iidc::kFeatureElementInquiry;
using iidc::kFeatureInquiry;
using iidc::kFeatureValue;
using iidc::kFrameInfo;
using iidc::kPresent;
using iidc::read;
using iidc::readPointer;
using iidc::readSensor;
using iidc::write;

// Inquiry 0x500 + 4 n
constexpr std::uint32_t kAbsoluteInquiry = 1U << 30, kManualInquiry = 1U << 24;
// Value 0x800 + 4 n
constexpr std::uint32_t kAbsolute = 1U << 30, kOnePush = 1U << 26, kSwitchedOn = 1U << 25,
                        kAutomatic = 1U << 24;
// Absolute-value registers
constexpr std::uint64_t kMinimum = 0, kMaximum = 4, kValue = 8;

std::uint64_t valueRegister(Feature feature) {
  return kFeatureValue + 4 * static_cast<std::uint64_t>(feature);
}

float toFloat(std::uint32_t bits) {
  float value = 0.0F;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

std::uint32_t toBits(float value) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}

/// Its inquiry register; 0 when the camera does not have the feature.
Result<std::uint32_t> inquire(const RegisterBus& bus, Feature feature) {
  const auto features = read(bus, kFeatureInquiry);
  if (!features) return features.status();
  if ((*features & (kPresent >> static_cast<unsigned>(feature))) == 0) return 0U;
  const auto element = read(bus, kFeatureElementInquiry + 4 * static_cast<std::uint64_t>(feature));
  if (!element) return element.status();
  return (*element & kPresent) != 0 ? *element : 0U;
}

/// A feature with absolute values.
struct AbsoluteFeature {
  std::uint64_t csr = 0;
  ControlRange range;
};

Result<std::optional<AbsoluteFeature>> absoluteFeature(const RegisterBus& bus, Feature feature) {
  const std::optional<AbsoluteFeature> absent;
  const auto inquiry = inquire(bus, feature);
  if (!inquiry) return inquiry.status();
  if ((*inquiry & kAbsoluteInquiry) == 0 || (*inquiry & kManualInquiry) == 0) return absent;
  const auto csr = readPointer(bus, kAbsoluteCsr + 4 * static_cast<std::uint64_t>(feature));
  if (!csr) {
    if (csr.status().code() == StatusCode::kUnsupported) return absent;
    return csr.status();
  }
  const auto low = read(bus, *csr + kMinimum);
  if (!low) return low.status();
  const auto high = read(bus, *csr + kMaximum);
  if (!high) return high.status();
  AbsoluteFeature result;
  result.csr = *csr;
  result.range = {toFloat(*low), toFloat(*high)};
  // Registers that hold no numbers cannot be trusted with a value either.
  if (!std::isfinite(result.range.min) || !std::isfinite(result.range.max) ||
      result.range.min > result.range.max)
    return absent;
  return std::optional<AbsoluteFeature>(result);
}

Status checkRange(const char* name, const char* unit, double value, const ControlRange& range) {
  // Limits are floats: a limit that a user copied from --probe must not fail by its last digit.
  const double tolerance = 1e-6 * std::max(std::abs(range.min), std::abs(range.max));
  if (value >= range.min - tolerance && value <= range.max + tolerance) return Status::ok();
  char text[160];
  std::snprintf(text, sizeof text, "%s of %g%s is outside of what the camera has: %g to %g%s", name,
                value, unit, range.min, range.max, unit);
  return {StatusCode::kInvalidInput, text};
}

Status setAbsolute(RegisterBus& bus, Feature feature, const AbsoluteFeature& absolute,
                   double value) {
  const std::uint64_t offset = valueRegister(feature);
  const auto before = read(bus, offset);
  if (!before) return before.status();
  const std::uint32_t manual = (*before & ~(kOnePush | kAutomatic)) | kAbsolute | kSwitchedOn;
  if (manual != *before)
    if (auto status = write(bus, offset, manual); !status) return status;
  const double bounded = std::min(std::max(value, absolute.range.min), absolute.range.max);
  return write(bus, absolute.csr + kValue, toBits(static_cast<float>(bounded)));
}

Result<std::optional<ControlRange>> whiteBalanceRange(const RegisterBus& bus) {
  const auto inquiry = inquire(bus, Feature::kWhiteBalance);
  if (!inquiry) return inquiry.status();
  if ((*inquiry & kManualInquiry) == 0) return std::optional<ControlRange>();
  return std::optional<ControlRange>(ControlRange{static_cast<double>(*inquiry >> 12 & 0xFFF),
                                                  static_cast<double>(*inquiry & 0xFFF)});
}

Status setWhiteBalance(RegisterBus& bus, std::optional<double> blue, std::optional<double> red) {
  const std::uint64_t offset = valueRegister(Feature::kWhiteBalance);
  const auto before = read(bus, offset);
  if (!before) return before.status();
  std::uint32_t value = (*before & ~(kOnePush | kAutomatic | kAbsolute)) | kSwitchedOn;
  if (blue) value = (value & ~0xFFF000U) | static_cast<std::uint32_t>(std::lround(*blue)) << 12;
  if (red) value = (value & ~0xFFFU) | static_cast<std::uint32_t>(std::lround(*red));
  return write(bus, offset, value);
}

struct Absolute {
  Feature feature;
  const char* name;
  const char* unit;
  std::optional<double> Controls::*control;
  std::optional<ControlRange> Capabilities::*range;
};
constexpr Absolute kAbsolutes[] = {
    {Feature::kFrameRate, "frame rate", " Hz", &Controls::rate_hz, &Capabilities::rate_hz},
    {Feature::kShutter, "exposure", " s", &Controls::exposure_s, &Capabilities::exposure_s},
    {Feature::kGain, "gain", " dB", &Controls::gain_db, &Capabilities::gain_db}};

}  // namespace

Result<Capabilities> iidcCapabilities(const RegisterBus& bus) {
  Capabilities capabilities;
  capabilities.registers = true;
  const auto sensor = readSensor(bus);
  if (!sensor) return sensor.status();
  capabilities.width_px = sensor->width_px;
  capabilities.height_px = sensor->height_px;
  for (const Absolute& absolute : kAbsolutes) {
    const auto feature = absoluteFeature(bus, absolute.feature);
    if (!feature) return feature.status();
    if (*feature) capabilities.*absolute.range = (*feature)->range;
  }
  const auto white_balance = whiteBalanceRange(bus);
  if (!white_balance) return white_balance.status();
  capabilities.white_balance = *white_balance;
  const auto temperature = inquire(bus, Feature::kTemperature);
  if (!temperature) return temperature.status();
  capabilities.temperature = *temperature != 0;
  const auto frame_info = bus.read(kFrameInfo);  // a camera without it is no failure
  capabilities.frame_counter = frame_info && (*frame_info & kPresent) != 0;
  return capabilities;
}

Status setIidcControls(RegisterBus& bus, const Controls& controls) {
  std::optional<AbsoluteFeature> features[std::size(kAbsolutes)];
  for (std::size_t i = 0; i < std::size(kAbsolutes); ++i) {
    const auto& wanted = controls.*kAbsolutes[i].control;
    if (!wanted) continue;
    const auto feature = absoluteFeature(bus, kAbsolutes[i].feature);
    if (!feature) return feature.status();
    if (!*feature)
      return {StatusCode::kUnsupported, std::string("this camera has no register for ") +
                                            kAbsolutes[i].name + " in absolute units"};
    if (auto status =
            checkRange(kAbsolutes[i].name, kAbsolutes[i].unit, *wanted, (*feature)->range);
        !status)
      return status;
    features[i] = *feature;
  }
  const bool balance = controls.white_balance_blue || controls.white_balance_red;
  if (balance) {
    const auto range = whiteBalanceRange(bus);
    if (!range) return range.status();
    if (!*range) return {StatusCode::kUnsupported, "this camera has no register for white balance"};
    for (const auto& value : {controls.white_balance_blue, controls.white_balance_red})
      if (value)
        if (auto status = checkRange("white balance", "", *value, **range); !status) return status;
  }
  for (std::size_t i = 0; i < std::size(kAbsolutes); ++i)
    if (features[i])
      if (auto status = setAbsolute(bus, kAbsolutes[i].feature, *features[i],
                                    *(controls.*kAbsolutes[i].control));
          !status)
        return status;
  if (!balance) return Status::ok();
  return setWhiteBalance(bus, controls.white_balance_blue, controls.white_balance_red);
}

Result<Controls> iidcControls(const RegisterBus& bus) {
  Controls controls;
  for (const Absolute& absolute : kAbsolutes) {
    const auto feature = absoluteFeature(bus, absolute.feature);
    if (!feature) return feature.status();
    if (!*feature) continue;
    const auto bits = read(bus, (*feature)->csr + kValue);
    if (!bits) return bits.status();
    if (std::isfinite(toFloat(*bits))) controls.*absolute.control = toFloat(*bits);
  }
  const auto range = whiteBalanceRange(bus);
  if (!range) return range.status();
  if (*range) {
    const auto value = read(bus, valueRegister(Feature::kWhiteBalance));
    if (!value) return value.status();
    controls.white_balance_blue = *value >> 12 & 0xFFF;
    controls.white_balance_red = *value & 0xFFF;
  }
  return controls;
}

std::optional<double> iidcTemperatureC(const RegisterBus& bus) {
  const auto inquiry = inquire(bus, Feature::kTemperature);
  if (!inquiry || *inquiry == 0) return std::nullopt;
  const auto value = bus.read(valueRegister(Feature::kTemperature));
  if (!value || (*value & kPresent) == 0) return std::nullopt;
  // Point Grey counts tenths of a kelvin. What is far from a working camera is another unit.
  const double celsius = 0.1 * (*value & 0xFFF) - 273.15;
  if (celsius < -40.0 || celsius > 125.0) return std::nullopt;
  return celsius;
}

}  // namespace scanner::bumblebee
