#include "bumblebee/aravis_features.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <initializer_list>

namespace scanner::bumblebee::aravis {
namespace {

constexpr double kMicro = 1e-6;
/// GainRaw has no unit. A range this small is dB (as that of Aravis' own camera), up to ten times
/// this steps of 0.1 dB; what is larger cannot be told, and such a gain is left alone.
constexpr double kLargestGainDb = 60.0;

bool has(ArvCamera* camera, const char* feature) {
  return arv_camera_is_feature_available(camera, feature, nullptr) != FALSE;
}

std::optional<ControlRange> range(double min, double max) {
  if (!std::isfinite(min) || !std::isfinite(max) || !(max > min)) return std::nullopt;
  return ControlRange{min, max};
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%g", value);
  return text;
}

/// dB of one unit of the camera's gain, 0 if unknown.
double gainUnit(ArvCamera* camera) {
  if (arv_camera_is_gain_available(camera, nullptr) == FALSE) return 0.0;
  double min = 0.0;
  double max = 0.0;
  Error error;
  arv_camera_get_gain_bounds(camera, &min, &max, error.out());
  if (error) return 0.0;
  ArvGcNode* const node = arv_device_get_feature(arv_camera_get_device(camera), "Gain");
  if (ARV_IS_GC_FLOAT(node) && g_strcmp0(arv_gc_float_get_unit(ARV_GC_FLOAT(node)), "dB") == 0) {
    return 1.0;
  }
  if (max <= kLargestGainDb) return 1.0;
  return max <= 10.0 * kLargestGainDb ? 0.1 : 0.0;
}

std::optional<ControlRange> exposureRange(ArvCamera* camera) {
  if (arv_camera_is_exposure_time_available(camera, nullptr) == FALSE) return std::nullopt;
  double min = 0.0;
  double max = 0.0;
  Error error;
  arv_camera_get_exposure_time_bounds(camera, &min, &max, error.out());
  if (error) return std::nullopt;
  return range(kMicro * min, kMicro * max);
}

std::optional<ControlRange> gainRange(ArvCamera* camera) {
  const double unit_db = gainUnit(camera);
  if (unit_db == 0.0) return std::nullopt;
  double min = 0.0;
  double max = 0.0;
  Error error;
  arv_camera_get_gain_bounds(camera, &min, &max, error.out());
  if (error) return std::nullopt;
  return range(unit_db * min, unit_db * max);
}

std::optional<ControlRange> rateRange(ArvCamera* camera) {
  if (arv_camera_is_frame_rate_available(camera, nullptr) == FALSE) return std::nullopt;
  double min = 0.0;
  double max = 0.0;
  Error error;
  arv_camera_get_frame_rate_bounds(camera, &min, &max, error.out());
  if (error) return std::nullopt;
  if (min > max) std::swap(min, max);  // a rate made from a period
  return range(std::max(min, 0.0), max);
}

std::optional<ControlRange> balanceRange(ArvCamera* camera) {
  if (!has(camera, "BalanceRatioSelector") || !has(camera, "BalanceRatio")) return std::nullopt;
  double min = 0.0;
  double max = 0.0;
  Error error;
  arv_camera_get_float_bounds(camera, "BalanceRatio", &min, &max, error.out());
  if (error) return std::nullopt;
  return range(min, max);
}

/// Rounding of limits that were converted must not refuse the limit itself.
Status checkRange(const char* what, const char* unit, const std::optional<double>& value,
                  const std::optional<ControlRange>& allowed) {
  if (!value) return Status::ok();
  if (!allowed) {
    return {StatusCode::kUnsupported, std::string("camera has no control of ") + what};
  }
  const double slack = 1e-9 * std::abs(allowed->max);
  if (*value >= allowed->min - slack && *value <= allowed->max + slack) return Status::ok();
  return {StatusCode::kInvalidInput, std::string(what) + " " + number(*value) + unit +
                                         ": the camera takes " + number(allowed->min) + " .. " +
                                         number(allowed->max) + unit};
}

Status setGain(ArvCamera* camera, double gain_db) {
  Error error;
  if (arv_camera_is_gain_auto_available(camera, nullptr) != FALSE) {
    arv_camera_set_gain_auto(camera, ARV_AUTO_OFF, error.out());
    if (error) return error.status("automatic gain off");
  }
  double value = gain_db / gainUnit(camera);
  if (!has(camera, "Gain")) value = std::round(value);
  arv_camera_set_gain(camera, value, error.out());
  return error.status("gain");
}

Status setExposure(ArvCamera* camera, double exposure_s) {
  Error error;
  if (arv_camera_is_exposure_auto_available(camera, nullptr) != FALSE) {
    arv_camera_set_exposure_time_auto(camera, ARV_AUTO_OFF, error.out());
    if (error) return error.status("automatic exposure off");
  }
  // Nanoseconds: a register of whole microseconds would cut 3999.9999 down.
  arv_camera_set_exposure_time(camera, std::round(exposure_s * 1e9) * 1e-3, error.out());
  return error.status("exposure");
}

Status setBalance(ArvCamera* camera, const char* channel, double ratio) {
  Error error;
  if (has(camera, "BalanceWhiteAuto")) {
    arv_camera_set_string(camera, "BalanceWhiteAuto", "Off", error.out());
    if (error) return error.status("automatic white balance off");
  }
  arv_camera_set_string(camera, "BalanceRatioSelector", channel, error.out());
  if (!error) arv_camera_set_float(camera, "BalanceRatio", ratio, error.out());
  return error.status("white balance");
}

std::optional<double> readBalance(ArvCamera* camera, const char* channel) {
  Error error;
  arv_camera_set_string(camera, "BalanceRatioSelector", channel, error.out());
  if (error) return std::nullopt;
  const double ratio = arv_camera_get_float(camera, "BalanceRatio", error.out());
  if (error) return std::nullopt;
  return ratio;
}

Status checkSide(const char* what, int value, int min, int max, int increment) {
  const int step = std::max(increment, 1);
  if (value >= min && value <= max && (value - min) % step == 0) return Status::ok();
  return {StatusCode::kInvalidInput, std::string(what) + " " + std::to_string(value) +
                                         " px: the camera takes " + std::to_string(min) + " .. " +
                                         std::to_string(max) + " in steps of " +
                                         std::to_string(step)};
}

}  // namespace

Capabilities readCapabilities(ArvCamera* camera) {
  Capabilities result;
  gint width = 0;
  gint height = 0;
  arv_camera_get_width_bounds(camera, nullptr, &width, nullptr);
  arv_camera_get_height_bounds(camera, nullptr, &height, nullptr);
  result.width_px = width;
  result.height_px = height;
  result.exposure_s = exposureRange(camera);
  result.gain_db = gainRange(camera);
  result.rate_hz = rateRange(camera);
  result.white_balance = balanceRange(camera);
  result.frame_counter = true;
  result.temperature = has(camera, "DeviceTemperature");
  result.device_clock = true;
  if (arv_camera_is_gv_device(camera) != FALSE) {
    auto* const device = ARV_GV_DEVICE(arv_camera_get_device(camera));
    result.device_clock = arv_gv_device_get_timestamp_tick_frequency(device, nullptr) != 0;
  }
  return result;
}

Status applyControls(ArvCamera* camera, const Capabilities& capabilities,
                     const Controls& controls) {
  for (const Status& checked :
       {checkRange("rate", " Hz", controls.rate_hz, capabilities.rate_hz),
        checkRange("exposure", " s", controls.exposure_s, capabilities.exposure_s),
        checkRange("gain", " dB", controls.gain_db, capabilities.gain_db),
        checkRange("white balance (blue)", "", controls.white_balance_blue,
                   capabilities.white_balance),
        checkRange("white balance (red)", "", controls.white_balance_red,
                   capabilities.white_balance)}) {
    if (!checked) return checked;
  }
  Status status;
  if (controls.rate_hz) {
    Error error;
    arv_camera_set_frame_rate(camera, *controls.rate_hz, error.out());
    status = error.status("frame rate");
  }
  if (status && controls.exposure_s) status = setExposure(camera, *controls.exposure_s);
  if (status && controls.gain_db) status = setGain(camera, *controls.gain_db);
  if (status && controls.white_balance_blue) {
    status = setBalance(camera, "Blue", *controls.white_balance_blue);
  }
  if (status && controls.white_balance_red) {
    status = setBalance(camera, "Red", *controls.white_balance_red);
  }
  return status;
}

Result<Controls> readControls(ArvCamera* camera, const Capabilities& capabilities) {
  Controls result;
  Error error;
  if (capabilities.exposure_s) {
    result.exposure_s = kMicro * arv_camera_get_exposure_time(camera, error.out());
    if (error) return error.status("exposure");
  }
  if (capabilities.gain_db) {
    result.gain_db = gainUnit(camera) * arv_camera_get_gain(camera, error.out());
    if (error) return error.status("gain");
  }
  if (capabilities.rate_hz) {
    result.rate_hz = arv_camera_get_frame_rate(camera, error.out());
    if (error) return error.status("frame rate");
  }
  if (capabilities.white_balance) {
    result.white_balance_blue = readBalance(camera, "Blue");
    result.white_balance_red = readBalance(camera, "Red");
  }
  return result;
}

std::optional<double> readTemperature(ArvCamera* camera) {
  Error error;
  const double value = arv_camera_get_float(camera, "DeviceTemperature", error.out());
  if (error || !std::isfinite(value)) return std::nullopt;
  return value;
}

Status selectStereoFormat(ArvCamera* camera) {
  Error error;
  guint count = 0;
  const std::unique_ptr<const char*, Free> names(
      arv_camera_dup_available_pixel_formats_as_strings(camera, &count, error.out()));
  if (error) return error.status("pixel formats");
  std::string all;
  bool found = false;
  for (guint i = 0; i < count; ++i) {
    const std::string name = names.get()[i];
    found = found || name == "Mono16";
    all += (i == 0 ? "" : ", ") + name;
  }
  if (!found) {
    return {StatusCode::kUnsupported,
            "camera does not send both eyes in one picture: it has no Mono16, only " + all};
  }
  arv_camera_set_pixel_format(camera, ARV_PIXEL_FORMAT_MONO_16, error.out());
  return error.status("pixel format");
}

Status selectSize(ArvCamera* camera, int width_px, int height_px) {
  Error error;
  // The offsets limit the sizes.
  if (arv_camera_is_region_offset_available(camera, nullptr) != FALSE) {
    arv_camera_set_integer(camera, "OffsetX", 0, error.out());
    if (!error) arv_camera_set_integer(camera, "OffsetY", 0, error.out());
    if (error) return error.status("offset of the picture");
  }
  gint min_width = 0;
  gint max_width = 0;
  arv_camera_get_width_bounds(camera, &min_width, &max_width, error.out());
  if (error) return error.status("width");
  gint min_height = 0;
  gint max_height = 0;
  arv_camera_get_height_bounds(camera, &min_height, &max_height, error.out());
  if (error) return error.status("height");
  const int width = width_px == 0 ? max_width : width_px;
  const int height = height_px == 0 ? max_height : height_px;
  const gint step_x = arv_camera_get_width_increment(camera, nullptr);
  const gint step_y = arv_camera_get_height_increment(camera, nullptr);
  if (Status s = checkSide("width", width, min_width, max_width, step_x); !s) return s;
  if (Status s = checkSide("height", height, min_height, max_height, step_y); !s) return s;
  arv_camera_set_integer(camera, "Width", width, error.out());
  if (!error) arv_camera_set_integer(camera, "Height", height, error.out());
  return error.status("size of the picture");
}

PixelFormat readTile(ArvCamera* camera) {
  if (!has(camera, "PixelColorFilter")) return PixelFormat::kBayerRggb8;
  const std::string filter = readText(camera, "PixelColorFilter");
  if (filter == "None") return PixelFormat::kMono8;
  if (filter == "BayerBG") return PixelFormat::kBayerBggr8;
  if (filter == "BayerGB") return PixelFormat::kBayerGbrg8;
  if (filter == "BayerGR") return PixelFormat::kBayerGrbg8;
  return PixelFormat::kBayerRggb8;
}

Status selectPacketSize(ArvCamera* camera, int bytes) {
  Error error;
  if (bytes > 0) {
    arv_camera_gv_set_packet_size(camera, bytes, error.out());
    if (error) return error.status("packet size");
    const guint set = arv_camera_gv_get_packet_size(camera, error.out());
    if (error) return error.status("packet size");
    if (set != static_cast<guint>(bytes)) {
      return {StatusCode::kInvalidInput, "packets of " + std::to_string(bytes) +
                                             " bytes: the camera made it " + std::to_string(set)};
    }
  } else {
    arv_camera_gv_auto_packet_size(camera, error.out());
    if (error) return error.status("packet size");
  }
  arv_camera_gv_set_packet_size_adjustment(camera, ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
  return Status::ok();
}

std::string readText(ArvCamera* camera, const char* feature) {
  if (!has(camera, feature)) return {};
  const char* const text = arv_camera_get_string(camera, feature, nullptr);
  return text != nullptr ? text : "";
}

}  // namespace scanner::bumblebee::aravis
