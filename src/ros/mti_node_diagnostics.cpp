#include "ros/mti_node_diagnostics.h"

#include <cmath>

namespace scanner::bridge {
namespace {

using mti::DriverState;
using mti::DriverStatistics;

constexpr auto kRecent = std::chrono::seconds(10);
constexpr double kRateTolerance = 0.05;                 ///< of the wanted rate
constexpr auto kRateSettles = std::chrono::seconds(5);  ///< then the measured rate counts

const char* orUnknown(const std::string& text) { return text.empty() ? "unknown" : text.c_str(); }

void addValues(const DriverStatistics& now, double wanted_rate_hz,
               const std::optional<double>& temperature_c, DiagnosticStatus& status) {
  status.add("state", toString(now.state));
  status.add("problem", now.problem);
  status.add("notes", now.notes);
  status.add("port", now.port.empty() ? "none" : now.port);
  status.add("baud rate", now.baud_rate);
  status.add("device id", orUnknown(now.device_id));
  status.add("firmware", orUnknown(now.firmware));
  status.add("protocol", orUnknown(now.protocol));
  status.addf("rate (Hz)", "%.3f", now.rate_hz);
  if (wanted_rate_hz > 0.0) status.addf("rate wanted (Hz)", "%.3f", wanted_rate_hz);
  status.add("samples", now.samples);
  status.add("lost", now.lost);
  status.add("rejected", now.rejected);
  status.add("checksum errors", now.checksum_errors);
  status.add("skipped bytes", now.skipped_bytes);
  status.add("connections", now.connections);
  status.addf("clock drift (ppm)", "%.2f", now.drift_ppm);
  status.addf("arrival jitter (ms)", "%.3f", now.arrival_jitter_s * 1e3);
  if (temperature_c) status.addf("temperature (deg C)", "%.1f", *temperature_c);
}

}  // namespace

void MtiReport::remember(const DriverStatistics& now, Clock::time_point time) {
  if (now.connections != connections_) {
    connections_ = now.connections;
    measuring_since_ = time;
  }
  recent_.push_back({time, now.lost, now.rejected, now.checksum_errors});
  while (time - recent_.front().time > kRecent) recent_.pop_front();
}

void MtiReport::warn(const DriverStatistics& now, double wanted_rate_hz, Clock::time_point time,
                     DiagnosticStatus& status) const {
  const auto grown = [&](std::uint64_t Counts::*count, std::uint64_t value, const char* what) {
    if (value <= recent_.front().*count) return;
    status.mergeSummaryf(kDiagnosticWarn, "%lu %s lately",
                         static_cast<unsigned long>(value - recent_.front().*count), what);
  };
  grown(&Counts::lost, now.lost, "samples lost");
  grown(&Counts::rejected, now.rejected, "samples rejected");
  grown(&Counts::checksum_errors, now.checksum_errors, "checksum errors");
  const bool settled = time - measuring_since_ > kRateSettles;
  if (settled && wanted_rate_hz > 0.0 &&
      std::abs(now.rate_hz - wanted_rate_hz) > kRateTolerance * wanted_rate_hz) {
    status.mergeSummaryf(kDiagnosticWarn, "%.2f Hz instead of %.2f Hz", now.rate_hz,
                         wanted_rate_hz);
  }
}

void MtiReport::fill(const DriverStatistics& now, double wanted_rate_hz,
                     const std::optional<double>& temperature_c, Clock::time_point time,
                     DiagnosticStatus& status) {
  remember(now, time);
  status.hardware_id = now.device_id.empty() ? "none" : now.device_id;
  addValues(now, wanted_rate_hz, temperature_c, status);
  if (now.state != DriverState::kMeasuring) {
    return status.summary(kDiagnosticError,
                          now.problem.empty() ? std::string(toString(now.state)) : now.problem);
  }
  status.summary(kDiagnosticOk, "measuring");
  warn(now, wanted_rate_hz, time, status);
}

}  // namespace scanner::bridge
