#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "bumblebee/driver_impl.h"

namespace scanner::bumblebee {
namespace {

/// `wanted` within what the camera can do, or nothing when it lacks the control. A value outside
/// is named in `refused`.
std::optional<double> within(const std::optional<ControlRange>& range, double wanted,
                             const char* name, std::string& refused) {
  if (!range) return std::nullopt;
  // Cameras round their limits; a hair beyond one is no mistake of the user's.
  const double slack = 1e-6 * std::max(std::abs(range->min), std::abs(range->max));
  if (wanted < range->min - slack || wanted > range->max + slack) {
    char text[160];
    std::snprintf(text, sizeof(text), "%s%s = %g lies outside the camera's %g .. %g",
                  refused.empty() ? "" : "; ", name, wanted, range->min, range->max);
    refused += text;
  }
  return std::max(range->min, std::min(range->max, wanted));
}

bool differs(double asked, double real) { return std::abs(asked - real) > 1e-9; }

}  // namespace

DriverOptions DriverCore::options() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return options_;
}

Controls DriverCore::wantedControls(const DriverOptions& o, const Capabilities& c,
                                    std::string& refused) {
  Controls controls;
  controls.rate_hz = within(c.rate_hz, o.rate_hz, "rate_hz", refused);
  if (o.white_balance_blue > 0.0) {
    controls.white_balance_blue =
        within(c.white_balance, o.white_balance_blue, "white_balance_blue", refused);
  }
  if (o.white_balance_red > 0.0) {
    controls.white_balance_red =
        within(c.white_balance, o.white_balance_red, "white_balance_red", refused);
  }
  if (!o.auto_exposure || !c.exposure_s) {
    controls.exposure_s = within(c.exposure_s, o.exposure_s, "exposure_s", refused);
    controls.gain_db = within(c.gain_db, o.gain_db, "gain_db", refused);
    return controls;
  }
  // Automatic: from where it was, within the limits that hold now.
  const std::lock_guard<std::mutex> lock(mutex_);
  const ExposureSetting start = metering_->within(in_force_);
  controls.exposure_s = start.exposure_s;
  if (c.gain_db) controls.gain_db = start.gain_db;
  return controls;
}

void DriverCore::setUpMetering(const DriverOptions& o, const Capabilities& c) {
  metering_.reset();
  if (!o.auto_exposure || !c.exposure_s) return;
  AutoExposureOptions metering;
  metering.target = o.auto_target;
  metering.max_exposure_s = o.auto_exposure_max_s;
  metering.exposure_s = *c.exposure_s;
  metering.gain_db = c.gain_db.value_or(ControlRange{0.0, 0.0});
  metering_.emplace(metering);
}

/// What the options ask for, as far as the camera is not there yet.
Status DriverCore::applyOptions(StereoCamera& camera) {
  const DriverOptions wanted = options();
  const Capabilities capabilities = camera.capabilities();
  setUpMetering(wanted, capabilities);
  std::string refused;
  Controls controls = wantedControls(wanted, capabilities, refused);
  const Result<Controls> now = camera.controls();
  if (now) {  // writing what is already so would disturb some cameras' streams
    const auto skip = [](std::optional<double>& asked, const std::optional<double>& real) {
      if (asked && real && !differs(*asked, *real)) asked.reset();
    };
    skip(controls.exposure_s, now->exposure_s);
    skip(controls.gain_db, now->gain_db);
    skip(controls.rate_hz, now->rate_hz);
    skip(controls.white_balance_blue, now->white_balance_blue);
    skip(controls.white_balance_red, now->white_balance_red);
  }
  Status status = camera.setControls(controls);
  readBack(camera);
  if (status && !refused.empty()) status = Status(StatusCode::kOutOfRange, refused);
  const std::lock_guard<std::mutex> lock(mutex_);
  refused_ = status.message();
  return status;
}

void DriverCore::readBack(StereoCamera& camera) {
  const Result<Controls> real = camera.controls();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (real) in_force_ = {real->exposure_s.value_or(0.0), real->gain_db.value_or(0.0)};
  const double rate = real ? real->rate_hz.value_or(0.0) : applied_rate_hz_;
  applied_rate_hz_ = rate > 0.0 ? rate : options_.rate_hz;
}

/// Auto-exposure: both eyes of every pair, one setting.
void DriverCore::meter(const DecodedPair& pair) {
  const std::lock_guard<std::mutex> access(access_);
  if (!metering_) return;
  ExposureSetting in_force;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    in_force = in_force_;
  }
  const std::optional<ExposureSetting> next = metering_->update(pair.statistics, in_force);
  if (!next) return;
  Controls controls;
  controls.exposure_s = next->exposure_s;
  if (camera_->capabilities().gain_db) controls.gain_db = next->gain_db;
  const Status status = camera_->setControls(controls);
  readBack(*camera_);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!status) refused_ = "auto-exposure: " + status.message();
}

Status DriverCore::reconfigure(const DriverOptions& wanted) {
  validate(wanted);
  const std::lock_guard<std::mutex> access(access_);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    options_.rate_hz = wanted.rate_hz;
    options_.auto_exposure = wanted.auto_exposure;
    options_.exposure_s = wanted.exposure_s;
    options_.gain_db = wanted.gain_db;
    options_.auto_exposure_max_s = wanted.auto_exposure_max_s;
    options_.auto_target = wanted.auto_target;
    options_.white_balance_blue = wanted.white_balance_blue;
    options_.white_balance_red = wanted.white_balance_red;
  }
  return camera_ == nullptr ? Status::ok() : applyOptions(*camera_);
}

Result<std::uint32_t> DriverCore::readRegister(std::uint64_t offset) {
  const std::lock_guard<std::mutex> access(access_);
  if (camera_ == nullptr) return Status(StatusCode::kOutOfRange, "no camera is connected");
  return camera_->readRegister(offset);
}

Status DriverCore::writeRegister(std::uint64_t offset, std::uint32_t value) {
  const std::lock_guard<std::mutex> access(access_);
  if (camera_ == nullptr) return {StatusCode::kOutOfRange, "no camera is connected"};
  return camera_->writeRegister(offset, value);
}

}  // namespace scanner::bumblebee
