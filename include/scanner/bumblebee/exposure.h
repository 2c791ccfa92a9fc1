#pragma once

#include <array>
#include <optional>

#include "scanner/bumblebee/decode.h"
#include "scanner/bumblebee/stereo_camera.h"

namespace scanner::bumblebee {

/// One setting for both eyes: matching compares grey values, so the eyes must stay alike.
struct ExposureSetting {
  double exposure_s = 0.0;
  double gain_db = 0.0;
};

struct AutoExposureOptions {
  double target = 0.35;                 ///< mean level of both eyes, 0..1
  double max_exposure_s = 0.008;        ///< beyond it gain is raised instead: less motion blur
  ControlRange exposure_s{10e-6, 0.1};  ///< of the camera
  ControlRange gain_db{0.0, 0.0};       ///< of the camera
  double gain_step_db = 1.0;            ///< gains are multiples of it; exposure does the rest
  double saturated_limit = 0.02;        ///< share of pixels at 255 in the brighter eye
  double protection = 0.5;              ///< for highlights the mean may fall to this much of
                                        ///< the target (sky in the picture), not further
  double dead_band = 0.1;               ///< corrections below this share are left alone
  double damping = 0.85;                ///< share of a correction (in stops) done at once
  int settle_frames = 3;  ///< frames until a setting surely shows; the controller waits for it
};

/// Auto-exposure. It assumes a linear sensor and waits after every change until the change shows,
/// so the loop has no dead time to oscillate on: a correction that is right needs one step,
/// whatever the camera's delay up to `settle_frames`. Where pixels are clipped the true level is
/// unknown; it is taken to lie the higher the more of them there are, so that a picture that is
/// burnt out comes back in a few steps. Deterministic. Not thread-safe.
class AutoExposure {
 public:
  /// Throws ConfigurationError for options that cannot be (empty ranges, target outside 0..1 ...).
  explicit AutoExposure(const AutoExposureOptions& options);

  /// To be called for every frame, with the setting that the camera says is in force (not what was
  /// asked of it: cameras round). Returns the setting to ask for; nothing when all is well, while a
  /// change is under way, or at the end of the ranges.
  std::optional<ExposureSetting> update(const std::array<EyeStatistics, 2>& eyes,
                                        const ExposureSetting& in_force);
  /// The nearest setting within the ranges that has the same brightness: to start with.
  ExposureSetting within(const ExposureSetting& setting) const;

 private:
  double correction(const std::array<EyeStatistics, 2>& eyes) const;
  ExposureSetting split(double product) const;

  AutoExposureOptions options_;
  double longest_s_ = 0.0;  ///< exposure before gain is used
  int wait_ = 0;            ///< frames that the last change may still need
};

}  // namespace scanner::bumblebee
