#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "scanner/core/status.h"

namespace scanner::bumblebee {

/// The configuration text for the Triclops library that a Bumblebee carries in its memory. Its
/// rectification model is closed, so it is never used for rectification (that is CameraInfo from a
/// calibration of our own); it is kept word by word for provenance, and what can be read without
/// knowing the format is picked out for display.
struct FactoryCalibration {
  std::string text;                   ///< as in the camera, without the padding at its end
  std::optional<std::string> serial;  ///< of the camera, as the text has it
  std::optional<int> width_px, height_px;
  std::optional<double> focal_length;  ///< as the text has it: its unit is not documented
  std::optional<double> baseline;      ///< likewise
};

inline constexpr std::uint64_t kCalibrationLengthRegister = 0x1FFC;  ///< bytes
inline constexpr std::uint64_t kCalibrationDataRegister = 0x2000;    ///< quadlets, big-endian
inline constexpr std::uint32_t kLargestCalibration_bytes = 64 * 1024;

using RegisterReader = std::function<Result<std::uint32_t>(std::uint64_t offset)>;

/// Reads the text, one quadlet a call. kNotEnoughData when the camera has none (length 0, or all
/// ones: erased memory); kInvalidInput for an absurd length or data that is no text; else the
/// status of the register that could not be read.
Result<FactoryCalibration> readFactoryCalibration(const RegisterReader& read);

/// Picks out what lines of the kinds `key value`, `key = value`, `key: value` and `<key> value`
/// say; the first line of a key counts, values that are no sensible number are left out. Never
/// fails.
FactoryCalibration parseFactoryCalibration(std::string text);

}  // namespace scanner::bumblebee
