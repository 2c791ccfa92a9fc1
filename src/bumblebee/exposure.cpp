#include "scanner/bumblebee/exposure.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace scanner::bumblebee {
namespace {

constexpr double kLargestStep = 16.0;  ///< factor of brightness in one correction
constexpr double kBurntWeight = 3.0;   ///< a picture all at 255 is taken for 1 + 3 times as bright
constexpr double kHighlight = 250.0;   ///< grey value that the brightest pixels are led to
constexpr double kBackOff = 0.8;       ///< when they are at 255 and nobody knows by how much
constexpr double kRounding_db = 0.05;  ///< of exposures by the camera: not worth a step of gain
constexpr double kDarkest = 1e-3;      ///< mean level of a black picture: avoids a division by 0

double linear(double gain_db) { return std::pow(10.0, gain_db / 20.0); }
double product(const ExposureSetting& s) { return s.exposure_s * linear(s.gain_db); }

/// Grey value that only the share `limit` of the pixels lies above.
double upperQuantile(const EyeStatistics& eye, double limit) {
  double count = 0.0;
  for (const std::uint32_t n : eye.histogram) count += n;
  double above = 0.0;
  for (std::size_t value = eye.histogram.size(); value-- > 0;) {
    above += eye.histogram[value];
    if (above > limit * count) return static_cast<double>(value);
  }
  return 0.0;
}

void require(bool ok, const char* what) {
  if (!ok) throw ConfigurationError(std::string("auto-exposure: ") + what);
}

bool isRange(const ControlRange& range, double least) {
  return std::isfinite(range.min) && std::isfinite(range.max) && range.min >= least &&
         range.max >= range.min;
}

}  // namespace

AutoExposure::AutoExposure(const AutoExposureOptions& options) : options_(options) {
  const auto isShare = [](double v) { return v > 0.0 && v < 1.0; };
  require(isShare(options.target), "the target lies within 0 .. 1");
  require(isRange(options.exposure_s, 0.0) && options.exposure_s.max > 0.0,
          "the range of exposures is empty");
  require(isRange(options.gain_db, -200.0) && options.gain_db.max <= 200.0,
          "the range of gains is empty");
  require(std::isfinite(options.max_exposure_s) && options.max_exposure_s > 0.0,
          "the longest exposure is positive");
  require(std::isfinite(options.gain_step_db) && options.gain_step_db > 0.0,
          "the step of the gain is positive");
  require(isShare(options.saturated_limit) && options.protection > 0.0 && options.protection <= 1.0,
          "the limits of highlights lie within 0 .. 1");
  require(isShare(options.dead_band), "the dead band lies within 0 .. 1");
  require(options.damping > 0.0 && options.damping <= 1.0, "the damping lies within 0 .. 1");
  require(options.settle_frames >= 1, "a change needs at least one frame");
  options_.exposure_s.min = std::max(options.exposure_s.min, 1e-9);
  longest_s_ = std::clamp(options.max_exposure_s, options_.exposure_s.min, options.exposure_s.max);
}

/// Factor that the brightness should change by.
double AutoExposure::correction(const std::array<EyeStatistics, 2>& eyes) const {
  double mean = 0.0;
  double highlights = kLargestStep;
  for (const EyeStatistics& eye : eyes) {
    // Clipped pixels count as brighter than they show.
    const double burnt = eye.saturated_share;
    mean += 0.5 * (eye.mean_level + kBurntWeight * burnt * burnt);
    const double brightest = upperQuantile(eye, options_.saturated_limit);
    if (brightest >= 255.0) {
      highlights = std::min(highlights, kBackOff);
    } else if (brightest > 0.0) {
      highlights = std::min(highlights, kHighlight / brightest);
    }
  }
  const double to_target = options_.target / std::max(mean, kDarkest);
  const double wanted = std::max(std::min(to_target, highlights), options_.protection * to_target);
  return std::clamp(wanted, 1.0 / kLargestStep, kLargestStep);
}

/// Exposure first, then whole steps of gain; the exposure makes up for their rounding.
ExposureSetting AutoExposure::split(double wanted) const {
  const double step = options_.gain_step_db;
  const double lowest = std::ceil(options_.gain_db.min / step - 1e-9) * step;
  const double highest = std::floor(options_.gain_db.max / step + 1e-9) * step;
  ExposureSetting s;
  if (highest < lowest) {  // the range holds no whole step: the gain stays at its end
    s.gain_db = options_.gain_db.min;
  } else {
    const double missing_db = 20.0 * std::log10(wanted / longest_s_);
    s.gain_db = std::clamp(std::ceil((missing_db - kRounding_db) / step) * step, lowest, highest);
  }
  s.exposure_s = std::clamp(wanted / linear(s.gain_db), options_.exposure_s.min, longest_s_);
  return s;
}

ExposureSetting AutoExposure::within(const ExposureSetting& setting) const {
  return split(std::max(product(setting), 1e-12));
}

std::optional<ExposureSetting> AutoExposure::update(const std::array<EyeStatistics, 2>& eyes,
                                                    const ExposureSetting& in_force) {
  if (wait_ > 0 && --wait_ > 0) return std::nullopt;
  const double current = product(in_force);
  if (!(current > 0.0) || !std::isfinite(current)) return std::nullopt;
  const double factor = correction(eyes);
  if (factor < 1.0 + options_.dead_band && factor > 1.0 / (1.0 + options_.dead_band)) {
    return std::nullopt;
  }
  const ExposureSetting next = split(current * std::pow(factor, options_.damping));
  const double change = product(next) / current;
  // At the end of the ranges, or less than a camera's rounding: nothing to be gained.
  if (std::abs(change - 1.0) < 0.01) return std::nullopt;
  wait_ = options_.settle_frames;
  return next;
}

}  // namespace scanner::bumblebee
