#include "scanner/evaluation/report.h"

#include <nlohmann/json.hpp>

namespace scanner::evaluation {

namespace {

// Keys keep the order in which they are written here. NaN and infinity are dumped as null.
using Json = nlohmann::ordered_json;

Json toTree(const Statistics& s) {
  return {{"median", s.median}, {"mean", s.mean}, {"sigma", s.sigma},
          {"min", s.min},       {"max", s.max},   {"count", s.count}};
}

Json toTree(const MotionSummary& s) {
  return {{"arc_deg", toTree(s.arc_deg)},
          {"roll_deg", toTree(s.roll_deg)},
          {"pitch_deg", toTree(s.pitch_deg)},
          {"yaw_deg", toTree(s.yaw_deg)},
          {"rho_m", toTree(s.rho_m)},
          {"x_m", toTree(s.x_m)},
          {"y_m", toTree(s.y_m)},
          {"z_m", toTree(s.z_m)}};
}

Json toTree(const std::vector<MotionRow>& rows) {
  Json out = Json::array();
  for (const MotionRow& row : rows) {
    const MotionComponents& m = row.motion;
    out.push_back({{"from", row.from},
                   {"to", row.to},
                   {"arc_deg", m.arc_deg},
                   {"roll_deg", m.roll_deg},
                   {"pitch_deg", m.pitch_deg},
                   {"yaw_deg", m.yaw_deg},
                   {"rho_m", m.rho_m},
                   {"x_m", m.x_m},
                   {"y_m", m.y_m},
                   {"z_m", m.z_m}});
  }
  return out;
}

Json toTree(const std::vector<ReportSampling>& rows) {
  Json out = Json::array();
  for (const ReportSampling& row : rows) {
    out.push_back({{"bucket_deg", row.bucket_deg},
                   {"buckets", row.buckets},
                   {"empty", row.empty},
                   {"per_bucket", row.per_bucket},
                   {"per_bucket_sigma", row.per_bucket_sigma}});
  }
  return out;
}

Json toTree(const std::vector<ReportCompatible>& rows) {
  Json out = Json::array();
  for (const ReportCompatible& row : rows) {
    out.push_back({{"angle_deg", row.angle_deg}, {"points", row.points}, {"share", row.share}});
  }
  return out;
}

Json viewCounts(const std::vector<ReportView>& views) {
  std::size_t registered = 0;
  Json discarded = Json::array();
  for (const ReportView& view : views) {
    if (view.registered) {
      ++registered;
    } else {
      discarded.push_back({{"index", view.index},
                           {"stamp_ns", toNanoseconds(view.stamp)},
                           {"reason", view.reason}});
    }
  }
  return {{"total", views.size()},
          {"registered", registered},
          {"discarded", views.size() - registered},
          {"discarded_views", discarded}};
}

Json viewTable(const std::vector<ReportView>& views) {
  Json out = Json::array();
  for (const ReportView& view : views) {
    Json row;
    row["index"] = view.index;
    row["stamp_ns"] = toNanoseconds(view.stamp);
    row["registered"] = view.registered;
    row["reason"] = view.reason.empty() ? Json() : Json(view.reason);
    row["trial"] = view.registered ? Json(view.trial) : Json();
    row["resampled"] = view.resampled;
    row["points"] = view.points;
    row["mean_distance_m"] = view.mean_distance_m;
    row["prior_arc_deg"] = view.prior_arc_deg;
    row["prior_rho_m"] = view.prior_rho_m;
    row["truth_position_m"] = view.truth_position_m;
    row["truth_rotation_deg"] = view.truth_rotation_deg;
    out.push_back(row);
  }
  return out;
}

Json truthTree(const std::optional<PoseErrors>& truth) {
  if (!truth) return nullptr;
  return {{"position_rmse_m", truth->position_rmse_m},
          {"position_max_m", truth->position_max_m},
          {"rotation_rmse_deg", truth->rotation_rmse_deg},
          {"rotation_max_deg", truth->rotation_max_deg},
          {"compared", truth->poses.size()},
          {"skipped", truth->skipped}};
}

Json modelTree(const std::optional<ReportModel>& model) {
  if (!model) return nullptr;
  return {{"vertices", model->vertices},
          {"faces", model->faces},
          {"components", model->components},
          {"boundary_edges", model->boundary_edges},
          {"non_manifold_edges", model->non_manifold_edges},
          {"mean_spacing_m", model->mean_spacing_m}};
}

Json timeTree(const ReportTimes& t) {
  return {{"stereo", t.stereo}, {"inertial", t.inertial}, {"registration", t.registration},
          {"global", t.global}, {"surface", t.surface},   {"total", t.total}};
}

}  // namespace

std::string toJson(const ScanReport& report) {
  Json trials = Json::object();
  for (std::size_t i = 0; i < report.trials.size(); ++i) {
    trials[std::to_string(i + 1)] = report.trials[i];
  }
  Json skipped = Json::object();
  for (const auto& [reason, count] : report.skipped) skipped[reason] = count;

  Json out;
  out["views"] = viewCounts(report.views);
  out["groups"] = report.groups;
  out["trials"] = trials;
  out["prior"] = {{"relative", toTree(summarize(report.prior_relative))},
                  {"absolute", toTree(summarize(report.prior_absolute))},
                  {"group_relative", toTree(summarize(report.group_prior_relative))},
                  {"group_absolute", toTree(summarize(report.group_prior_absolute))}};
  out["truth"] = truthTree(report.truth);
  out["loop"] = {{"closed", report.loop.closed},
                 {"residual_m", report.loop.residual_m},
                 {"residual_deg", report.loop.residual_deg}};
  out["model"] = modelTree(report.model);
  out["time_s"] = timeTree(report.time_s);
  out["peak_memory_mb"] = report.peak_memory_mb;
  out["warnings"] = report.warnings;
  out["skipped"] = skipped;
  out["tables"] = {{"views", viewTable(report.views)},
                   {"prior_relative", toTree(report.prior_relative)},
                   {"prior_absolute", toTree(report.prior_absolute)},
                   {"group_prior_relative", toTree(report.group_prior_relative)},
                   {"group_prior_absolute", toTree(report.group_prior_absolute)},
                   {"sampling", toTree(report.sampling)},
                   {"compatible", toTree(report.compatible)}};
  // Text that is no UTF-8 (a file name in a warning) must not lose the report.
  return out.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace scanner::evaluation
