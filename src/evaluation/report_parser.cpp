#include <algorithm>
#include <cmath>

#include "evaluation/lenient_json.h"
#include "scanner/evaluation/report.h"

namespace scanner::evaluation {
namespace {

std::vector<ReportView> parseViews(const Json& tables) {
  std::vector<ReportView> views;
  for (const Json* row : objectsOf(tables, "views")) {
    ReportView view;
    view.index = integerOf<int>(*row, "index", -1);
    view.stamp = fromNanoseconds(integerOf<std::int64_t>(*row, "stamp_ns"));
    view.registered = flagOf(*row, "registered");
    view.reason = textOf(*row, "reason");
    view.trial = integerOf<int>(*row, "trial");
    view.resampled = flagOf(*row, "resampled");
    view.points = integerOf<std::size_t>(*row, "points");
    view.mean_distance_m = numberOf(*row, "mean_distance_m");
    view.prior_arc_deg = numberOf(*row, "prior_arc_deg");
    view.prior_rho_m = numberOf(*row, "prior_rho_m");
    view.truth_position_m = numberOf(*row, "truth_position_m");
    view.truth_rotation_deg = numberOf(*row, "truth_rotation_deg");
    views.push_back(view);
  }
  return views;
}

std::vector<MotionRow> parseMotions(const Json& tables, const char* key) {
  std::vector<MotionRow> rows;
  for (const Json* row : objectsOf(tables, key)) {
    rows.push_back(
        {integerOf<int>(*row, "from", -1),
         integerOf<int>(*row, "to", -1),
         {numberOf(*row, "arc_deg"), numberOf(*row, "roll_deg"), numberOf(*row, "pitch_deg"),
          numberOf(*row, "yaw_deg"), numberOf(*row, "rho_m"), numberOf(*row, "x_m"),
          numberOf(*row, "y_m"), numberOf(*row, "z_m")}});
  }
  return rows;
}

void parseSampling(const Json& tables, ScanReport& report) {
  for (const Json* row : objectsOf(tables, "sampling")) {
    report.sampling.push_back({numberOf(*row, "bucket_deg"), numberOf(*row, "buckets"),
                               numberOf(*row, "empty"), numberOf(*row, "per_bucket"),
                               numberOf(*row, "per_bucket_sigma")});
  }
  for (const Json* row : objectsOf(tables, "compatible")) {
    report.compatible.push_back(
        {numberOf(*row, "angle_deg"), numberOf(*row, "points"), numberOf(*row, "share")});
  }
}

void parseTruth(const Json& json, ScanReport& report) {
  if (!json.is_object()) return;
  PoseErrors truth;
  truth.position_rmse_m = numberOf(json, "position_rmse_m");
  truth.position_max_m = numberOf(json, "position_max_m");
  truth.rotation_rmse_deg = numberOf(json, "rotation_rmse_deg");
  truth.rotation_max_deg = numberOf(json, "rotation_max_deg");
  truth.skipped = integerOf<int>(json, "skipped");
  truth.poses.resize(std::min(integerOf<std::size_t>(json, "compared"), report.views.size()));
  // Their errors stand in the table of the views, in the same order.
  std::size_t next = 0;
  for (const ReportView& view : report.views) {
    if (next == truth.poses.size()) break;
    if (!std::isfinite(view.truth_position_m)) continue;
    truth.poses[next++] = {view.stamp, view.truth_position_m, view.truth_rotation_deg};
  }
  report.truth = std::move(truth);
}

void parseModel(const Json& json, ScanReport& report) {
  if (!json.is_object()) return;
  report.model = ReportModel{integerOf<std::size_t>(json, "vertices"),
                             integerOf<std::size_t>(json, "faces"),
                             integerOf<std::size_t>(json, "components"),
                             integerOf<std::size_t>(json, "boundary_edges"),
                             integerOf<std::size_t>(json, "non_manifold_edges"),
                             numberOf(json, "mean_spacing_m")};
}

void parseNotes(const Json& json, ScanReport& report) {
  if (const Json& warnings = member(json, "warnings"); warnings.is_array()) {
    for (const Json& line : warnings) {
      if (line.is_string()) report.warnings.push_back(line.get<std::string>());
    }
  }
  if (const Json& skipped = member(json, "skipped"); skipped.is_object()) {
    for (const auto& [reason, count] : skipped.items()) {
      if (count.is_number_unsigned()) report.skipped[reason] = count.get<std::size_t>();
    }
  }
}

}  // namespace

Result<ScanReport> parseReport(const std::string& json) {
  const Json tree = Json::parse(json, nullptr, false);
  if (!tree.is_object()) return Status(StatusCode::kInvalidInput, "no JSON object");
  ScanReport report;
  const Json& tables = member(tree, "tables");
  report.views = parseViews(tables);
  report.groups = integerOf<int>(tree, "groups");
  for (std::size_t i = 0; i < report.trials.size(); ++i) {
    report.trials[i] = integerOf<int>(member(tree, "trials"), std::to_string(i + 1).c_str());
  }
  report.prior_relative = parseMotions(tables, "prior_relative");
  report.prior_absolute = parseMotions(tables, "prior_absolute");
  report.group_prior_relative = parseMotions(tables, "group_prior_relative");
  report.group_prior_absolute = parseMotions(tables, "group_prior_absolute");
  parseSampling(tables, report);
  parseTruth(member(tree, "truth"), report);
  const Json& loop = member(tree, "loop");
  report.loop = {flagOf(loop, "closed"), numberOf(loop, "residual_m"),
                 numberOf(loop, "residual_deg")};
  parseModel(member(tree, "model"), report);
  const Json& times = member(tree, "time_s");
  report.time_s = {numberOf(times, "stereo"),       numberOf(times, "inertial"),
                   numberOf(times, "registration"), numberOf(times, "global"),
                   numberOf(times, "surface"),      numberOf(times, "total")};
  report.peak_memory_mb = numberOf(tree, "peak_memory_mb");
  parseNotes(tree, report);
  return report;
}

}  // namespace scanner::evaluation
