#include "scanner/evaluation/summary.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>

namespace scanner::evaluation {
namespace {

__attribute__((format(printf, 2, 3))) void addLine(std::string& out, const char* format, ...) {
  char line[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line, sizeof line, format, arguments);
  va_end(arguments);
  out += line;
  out += '\n';
}

}  // namespace

std::size_t registeredViews(const ScanReport& report) {
  return static_cast<std::size_t>(
      std::count_if(report.views.begin(), report.views.end(),
                    [](const ReportView& view) { return view.registered; }));
}

std::string summary(const ScanReport& report) {
  std::string out;
  addLine(out, "views      %zu of %zu registered, %d groups", registeredViews(report),
          report.views.size(), report.groups);
  std::string trials;
  for (const int count : report.trials) trials += " " + std::to_string(count);
  addLine(out, "trials    %s  (steps 1 to 8)", trials.c_str());
  if (report.loop.closed) {
    addLine(out, "loop       closed over %.1f mm, %.2f deg", 1e3 * report.loop.residual_m,
            report.loop.residual_deg);
  } else {
    addLine(out, "loop       not closed");
  }
  if (report.truth) {
    addLine(out, "truth      position %.1f mm RMS (max %.1f), rotation %.2f deg RMS (max %.2f)",
            1e3 * report.truth->position_rmse_m, 1e3 * report.truth->position_max_m,
            report.truth->rotation_rmse_deg, report.truth->rotation_max_deg);
  }
  if (report.model) {
    addLine(out, "model      %zu vertices, %zu faces, %zu pieces, spacing %.2f mm",
            report.model->vertices, report.model->faces, report.model->components,
            1e3 * report.model->mean_spacing_m);
  } else {
    addLine(out, "model      none");
  }
  addLine(out,
          "time       stereo %.1f, inertial %.1f, registration %.1f, global %.1f, surface %.1f,"
          " total %.1f s; peak memory %.0f MB",
          report.time_s.stereo, report.time_s.inertial, report.time_s.registration,
          report.time_s.global, report.time_s.surface, report.time_s.total, report.peak_memory_mb);
  for (const auto& [reason, count] : report.skipped) {
    addLine(out, "skipped    %zu %s", count, reason.c_str());
  }
  for (const std::string& warning : report.warnings) out += "warning    " + warning + "\n";
  for (const ReportView& view : report.views) {
    if (!view.registered)
      out += "discarded  view " + std::to_string(view.index) + ": " + view.reason + "\n";
  }
  return out;
}

}  // namespace scanner::evaluation
