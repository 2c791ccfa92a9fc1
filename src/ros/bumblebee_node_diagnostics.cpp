#include "ros/bumblebee_node_diagnostics.h"

#include <algorithm>
#include <cmath>

namespace scanner::bridge {
namespace {

using bumblebee::DriverState;
using bumblebee::DriverStatistics;

constexpr auto kRecent = std::chrono::seconds(10);
constexpr double kSaturated = 0.2;       ///< share of an eye's pixels
constexpr double kRateTolerance = 0.1;   ///< of the wanted rate
constexpr double kRateSettlesPairs = 5;  ///< and as many seconds: then the measured rate counts
/// Two eyes on one scene hardly differ; below this share of the other's mean one is covered.
constexpr double kCovered = 0.3;
constexpr double kDark = 0.05;  ///< mean level of a scene where nothing can be said

std::string cameraName(const bumblebee::CameraIdentity& camera) {
  std::string name = camera.vendor;
  for (const std::string& part : {camera.model, camera.serial}) {
    if (!part.empty()) name += (name.empty() ? "" : " ") + part;
  }
  return name.empty() ? "none" : name + " (" + toString(camera.transport) + ")";
}

const char* toText(BumblebeeCalibration::State state) {
  switch (state) {
    case BumblebeeCalibration::State::kUnknown:
      return "not known before the first images";
    case BumblebeeCalibration::State::kUncalibrated:
      return "none";
    case BumblebeeCalibration::State::kRefused:
      return "refused";
    case BumblebeeCalibration::State::kGood:
      return "good";
  }
  return "";
}

void addValues(const DriverStatistics& now, double wanted_rate_hz, DiagnosticStatus& status) {
  status.add("state", toString(now.state));
  status.add("camera", cameraName(now.camera));
  status.add("firmware", now.camera.firmware);
  status.addf("image size", "%dx%d", now.format.width_px, now.format.height_px);
  status.addf("rate (Hz)", "%.3f", now.rate_hz);
  status.addf("rate wanted (Hz)", "%.3f", wanted_rate_hz);
  status.add("pairs", now.pairs);
  status.add("dropped", now.dropped);
  status.add("damaged", now.damaged);
  status.add("lost packets", now.lost_packets);
  status.add("connections", now.connections);
  status.addf("bandwidth (MB/s)", "%.2f", now.bandwidth_Bps * 1e-6);
  if (now.temperature_c) status.addf("temperature (deg C)", "%.1f", *now.temperature_c);
  status.addf("exposure (ms)", "%.3f", now.exposure_s * 1e3);
  status.addf("gain (dB)", "%.2f", now.gain_db);
  status.addf("saturated left (%)", "%.2f", now.saturated_share[0] * 100.0);
  status.addf("saturated right (%)", "%.2f", now.saturated_share[1] * 100.0);
  status.addf("mean level left", "%.3f", now.mean_level[0]);
  status.addf("mean level difference", "%.3f", now.mean_level[0] - now.mean_level[1]);
  status.add("stamps from", toString(now.stamps));
  status.addf("clock drift (ppm)", "%.1f", now.drift_ppm);
  status.addf("arrival jitter (ms)", "%.3f", now.arrival_jitter_s * 1e3);
  status.add("factory calibration", now.factory_calibration.empty() ? "none" : "read");
}

std::uint64_t grown(std::uint64_t before, std::uint64_t now) {
  return now > before ? now - before : 0;
}

}  // namespace

void BumblebeeReport::remember(const DriverStatistics& now, Clock::time_point time) {
  if (now.connections != connections_) {
    connections_ = now.connections;
    streaming_since_ = time;
  }
  recent_.push_back({time, now.dropped, now.lost_packets});
  while (time - recent_.front().time > kRecent) recent_.pop_front();
}

void BumblebeeReport::warn(const DriverStatistics& now, double wanted_rate_hz,
                           Clock::time_point time, DiagnosticStatus& status) const {
  if (!now.problem.empty()) status.mergeSummary(kDiagnosticWarn, now.problem);
  const std::uint64_t dropped = grown(recent_.front().dropped, now.dropped);
  const std::uint64_t packets = grown(recent_.front().lost_packets, now.lost_packets);
  if (dropped > 0) {
    status.mergeSummaryf(kDiagnosticWarn, "%lu pairs dropped lately (%lu packets lost)",
                         static_cast<unsigned long>(dropped), static_cast<unsigned long>(packets));
  } else if (packets > 0) {
    status.mergeSummaryf(kDiagnosticWarn, "%lu packets lost lately",
                         static_cast<unsigned long>(packets));
  }
  const double streaming_s = std::chrono::duration<double>(time - streaming_since_).count();
  const bool settled = streaming_s > std::max(5.0, kRateSettlesPairs / wanted_rate_hz);
  if (settled && std::abs(now.rate_hz - wanted_rate_hz) > kRateTolerance * wanted_rate_hz) {
    status.mergeSummaryf(kDiagnosticWarn, "%.2f Hz instead of %.2f Hz", now.rate_hz,
                         wanted_rate_hz);
  }
  for (int eye = 0; eye < 2; ++eye) {
    if (now.saturated_share[eye] <= kSaturated) continue;
    status.mergeSummaryf(kDiagnosticWarn, "%s image saturated", eye == 0 ? "left" : "right");
  }
  const double bright = std::max(now.mean_level[0], now.mean_level[1]);
  const double dark = std::min(now.mean_level[0], now.mean_level[1]);
  if (bright > kDark && dark < kCovered * bright) {
    status.mergeSummaryf(kDiagnosticWarn, "the %s eye is much darker: covered?",
                         now.mean_level[0] < now.mean_level[1] ? "left" : "right");
  }
}

void BumblebeeReport::fill(const DriverStatistics& now, double wanted_rate_hz,
                           const BumblebeeCalibration::Verdict& calibration, Clock::time_point time,
                           DiagnosticStatus& status) {
  using State = BumblebeeCalibration::State;
  remember(now, time);
  status.hardware_id = now.camera.serial.empty() ? "none" : now.camera.serial;
  addValues(now, wanted_rate_hz, status);
  status.add("calibration",
             toText(calibration.state) +
                 (calibration.reason.empty() ? std::string() : ": " + calibration.reason));
  if (now.state != DriverState::kStreaming) {
    return status.summary(kDiagnosticError,
                          now.problem.empty() ? std::string(toString(now.state)) : now.problem);
  }
  status.summary(kDiagnosticOk, "streaming");
  warn(now, wanted_rate_hz, time, status);
  if (calibration.state == State::kRefused) {
    status.mergeSummary(kDiagnosticError, "calibration refused: " + calibration.reason);
  } else if (calibration.state == State::kUncalibrated) {
    status.mergeSummary(kDiagnosticError, calibration.reason + ": images only");
  }
}

}  // namespace scanner::bridge
