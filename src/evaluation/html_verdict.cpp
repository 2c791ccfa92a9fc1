#include <algorithm>
#include <cmath>
#include <map>

#include "evaluation/html_parts.h"
#include "evaluation/html_text.h"
#include "scanner/evaluation/summary.h"

namespace scanner::evaluation::html {
namespace {

enum class Grade { kSound, kCheck, kUnusable };

double pathLength(const Trajectory& trajectory) {
  double length = 0.0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    length += (trajectory[i].T_map_base.translation() - trajectory[i - 1].T_map_base.translation())
                  .norm();
  }
  return length;
}

/// Positions further off than this are worth a word: a centimetre, or 1 % of a long path.
double worrying(const FolderData& data) {
  return std::max(0.01, 0.01 * pathLength(data.trajectory));
}

Grade gradeOf(const FolderData& data) {
  const ScanReport& report = data.report;
  const std::size_t registered = registeredViews(report);
  constexpr std::size_t kFewest = 2;
  if (registered < kFewest) return Grade::kUnusable;
  constexpr double kMostOfThem = 0.9;
  const double share = static_cast<double>(registered) /
                       static_cast<double>(std::max<std::size_t>(1, report.views.size()));
  const bool proven = report.truth ? report.truth->position_max_m <= worrying(data)
                                   : report.loop.closed && report.loop.residual_m <= worrying(data);
  return share >= kMostOfThem && proven && report.model ? Grade::kSound : Grade::kCheck;
}

Statistics residuals(const ScanReport& report) {
  std::vector<double> samples;
  for (const ReportView& view : report.views) samples.push_back(view.mean_distance_m);
  return summarize(samples);
}

std::string viewSentence(const ScanReport& report) {
  const std::size_t registered = registeredViews(report), total = report.views.size();
  if (total == 0) return "No stereo pictures were processed.";
  if (registered == 0)
    return "None of the " + counted(total, "view", "views") + " could be registered.";
  if (registered == total) {
    return total == 1 ? "The only view was taken into the model."
                      : "All " + grouped(total) + " views were registered.";
  }
  return grouped(registered) + " of " + counted(total, "view was", "views were") + " registered.";
}

/// Why views are missing, the commonest reason first.
std::string discardSentence(const ScanReport& report) {
  std::map<std::string, std::size_t> reasons;
  std::size_t discarded = 0;
  for (const ReportView& view : report.views) {
    if (view.registered) continue;
    ++discarded;
    ++reasons[view.reason.empty() ? "no reason given" : view.reason];
  }
  if (discarded == 0) return "";
  std::vector<std::pair<std::string, std::size_t>> order(reasons.begin(), reasons.end());
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  constexpr std::size_t kNamed = 3;
  std::string out = "Left out: ";
  for (std::size_t i = 0; i < std::min(kNamed, order.size()); ++i) {
    if (i > 0) out += "; ";
    out += counted(order[i].second, "view", "views") + " (" + escape(order[i].first) + ")";
  }
  if (order.size() > kNamed) out += "; others are in the table of the views";
  return out + ".";
}

std::string loopSentence(const ScanReport& report) {
  if (registeredViews(report) < 2) return "";
  if (!report.loop.closed) {
    return "The camera path was not closed to a loop, so nothing checks how far the far end has"
           " drifted.";
  }
  return "The camera came back over surface that it had seen before; there the chain of views "
         "was " +
         millimetres(report.loop.residual_m) + " and " + degrees(report.loop.residual_deg) +
         " off, and this was spread over the loop.";
}

std::string trustSentence(const FolderData& data) {
  const ScanReport& report = data.report;
  if (registeredViews(report) < 2) return "There is nothing here to measure on.";
  if (report.truth) {
    return "Against the known true positions, the camera was placed within " +
           millimetres(report.truth->position_rmse_m) + " (typical) and " +
           millimetres(report.truth->position_max_m) + " (worst).";
  }
  const Statistics matched = residuals(report);
  std::string out = "No true positions are known for this recording: ";
  if (report.loop.closed) {
    out += "expect the shape to hold to about " +
           millimetres(std::max(report.loop.residual_m, matched.count > 0 ? matched.median : 0.0)) +
           " over the whole object,";
  } else if (matched.count > 0) {
    out += "neighbouring views fit to " + millimetres(matched.median) +
           ", but the whole may be off by more,";
  } else {
    out += "the figures are the scanner's own,";
  }
  return out + " and check a known length before relying on absolute dimensions.";
}

std::string modelSentence(const FolderData& data) {
  if (!data.report.model) return "There is no surface model.";
  const ReportModel& model = *data.report.model;
  std::string out = "The model has " + counted(model.faces, "triangle", "triangles") +
                    " with corners " + millimetres(model.mean_spacing_m) + " apart";
  if (model.components > 1) out += ", in " + grouped(model.components) + " pieces";
  out += model.boundary_edges == 0 ? ", and is closed." : ", and is open at its edges or holes.";
  if (!data.deviation || !std::isfinite(data.deviation->model.sigma_m)) return out;
  const DeviationFile& d = *data.deviation;
  out += " Against the reference it deviates by " + millimetres(d.mean_m) + " on average, sigma " +
         millimetres(d.model.sigma_m);
  if (std::isfinite(d.coverage)) out += ", and covers " + fixed(100.0 * d.coverage, 1) + " % of it";
  return out + ".";
}

std::string keyFigure(const std::string& name, const std::string& value, const std::string& more) {
  return "<div><dt>" + name + "</dt><dd>" + value + "</dd><dd class=\"more\">" + more +
         "</dd></div>\n";
}

void addRow(Table& table, const std::string& name, const std::string& value,
            const std::string& meaning) {
  table.rows.push_back({name, value, meaning});
}

void addTruth(const FolderData& data, Table& table) {
  const PoseErrors& truth = *data.report.truth;
  addRow(table, "position, root mean square", millimetres(truth.position_rmse_m),
         "over " + counted(truth.poses.size(), "view", "views") +
             ", after laying the first pose on its true place");
  addRow(table, "position, largest", millimetres(truth.position_max_m), "");
  addRow(table, "orientation, root mean square", degrees(truth.rotation_rmse_deg), "");
  addRow(table, "orientation, largest", degrees(truth.rotation_max_deg), "");
  if (truth.skipped > 0) {
    addRow(table, "views not compared", std::to_string(truth.skipped),
           "no truth at the time they were taken");
  }
}

/// What the scanner can say about itself.
void addPredicted(const FolderData& data, Table& table) {
  const ScanReport& report = data.report;
  const Statistics matched = residuals(report);
  if (matched.count > 0) {
    addRow(table, "residual between views, median", millimetres(matched.median),
           "mean distance of matched points; the sampling of the surface is in it");
    addRow(table, "residual between views, largest", millimetres(matched.max), "");
  }
  if (report.loop.closed) {
    addRow(table, "gap where the loop closed",
           millimetres(report.loop.residual_m) + ", " + degrees(report.loop.residual_deg),
           "before it was spread over the views: a measure of the drift");
  }
  if (data.model && data.model->vertices.hasSigmas()) {
    std::vector<double> sigmas;
    for (const float sigma : data.model->vertices.sigmas) sigmas.push_back(sigma);
    addRow(table, "predicted noise of a model point, median", millimetres(summarize(sigmas).median),
           "one standard deviation, from the stereo noise model and the views that saw it");
  }
}

std::string placementNote(const std::string& placement) {
  if (placement == "best_fit") {
    return "The model was fitted to the reference first: an error of its place as a whole does not"
           " show.";
  }
  return placement == "first_pose" ? "The model lies where the true pose of the first view puts it."
                                   : "";
}

void addDeviation(const FolderData& data, Table& table) {
  const DeviationFile& d = *data.deviation;
  addRow(table, "model against reference, mean", millimetres(d.mean_m),
         "signed, positive outside; " + counted(d.points, "point", "points"));
  addRow(table, "sigma", millimetres(d.model.sigma_m), "");
  addRow(table, "root mean square", millimetres(d.rmse_m), "");
  addRow(table, "median of the distances", millimetres(d.median_absolute_m), "");
  addRow(table, "95 % are within", millimetres(d.p95_absolute_m), "");
  addRow(table, "range", millimetres(d.model.min_m) + " to " + millimetres(d.model.max_m), "");
  if (std::isfinite(d.coverage)) {
    addRow(table, "reference covered", fixed(100.0 * d.coverage, 1) + "&nbsp;%",
           "share of its area that the model comes near");
  }
  addRow(table, "outliers", grouped(d.outliers), "points too far away to be compared");
}

}  // namespace

std::string verdict(const FolderData& data) {
  static const std::map<Grade, std::pair<const char*, const char*>> kBadges = {
      {Grade::kSound, {"sound", "Sound"}},
      {Grade::kCheck, {"check", "Usable, with reservations"}},
      {Grade::kUnusable, {"unusable", "Not usable"}}};
  const auto& [style, label] = kBadges.at(gradeOf(data));
  std::string out = std::string("<p class=\"verdict\"><strong class=\"badge ") + style + "\">" +
                    label + "</strong> ";
  for (const std::string& sentence :
       {viewSentence(data.report), discardSentence(data.report), loopSentence(data.report),
        trustSentence(data), modelSentence(data)}) {
    if (!sentence.empty()) out += sentence + " ";
  }
  const std::size_t warnings = data.report.warnings.size() + data.trouble.size();
  if (warnings > 0) {
    out +=
        counted(warnings, "warning is", "warnings are") + " <a href=\"#notes\">listed below</a>.";
  }
  return out + "</p>\n";
}

std::string keyFigures(const FolderData& data) {
  const ScanReport& report = data.report;
  const std::size_t registered = registeredViews(report);
  std::string out = "<dl class=\"figures\">\n";
  out +=
      keyFigure("Views", grouped(registered) + " of " + grouped(report.views.size()),
                counted(static_cast<std::size_t>(std::max(0, report.groups)), "group", "groups"));
  if (!data.trajectory.empty()) {
    const Duration time = data.trajectory.back().stamp - data.trajectory.front().stamp;
    out += keyFigure("Camera path", fixed(pathLength(data.trajectory), 2) + "&nbsp;m",
                     "in " + seconds(toSeconds(time)));
  }
  out += report.loop.closed ? keyFigure("Loop closed over", millimetres(report.loop.residual_m),
                                        degrees(report.loop.residual_deg))
                            : keyFigure("Loop", "open", "drift not checked");
  if (report.truth) {
    out += keyFigure("Position error", millimetres(report.truth->position_rmse_m),
                     "RMS against the truth");
  }
  if (data.deviation && std::isfinite(data.deviation->model.sigma_m)) {
    out += keyFigure("Surface sigma", millimetres(data.deviation->model.sigma_m),
                     "against the reference");
  }
  if (report.model) {
    out += keyFigure("Model", grouped(report.model->faces),
                     "triangles, " + millimetres(report.model->mean_spacing_m) + " apart");
  }
  if (std::isfinite(report.time_s.total)) {
    out += keyFigure("Processing", seconds(report.time_s.total),
                     std::isfinite(report.peak_memory_mb)
                         ? fixed(report.peak_memory_mb, 0) + "&nbsp;MB at most"
                         : "");
  }
  return out + "</dl>\n";
}

std::string accuracy(const FolderData& data) {
  Table table;
  table.words = true;
  if (data.report.truth) {
    table.caption = "Errors against the known truth";
    addTruth(data, table);
  } else {
    table.caption = "Predicted errors";
    table.note =
        "No truth came with this recording. These figures are the scanner's own view of itself:"
        " errors that all views share, of scale and calibration above all, do not show in them.";
    addPredicted(data, table);
  }
  std::string out = table.rows.empty() ? "" : toHtml(table);
  if (data.report.truth) {
    Table predicted;
    predicted.words = true;
    predicted.caption = "What the scanner says about itself, without the truth";
    addPredicted(data, predicted);
    if (!predicted.rows.empty()) out += toHtml(predicted);
  }
  if (data.deviation) {
    Table surface;
    surface.caption = "Surface against the reference";
    surface.note = placementNote(data.deviation->placement);
    surface.words = true;
    addDeviation(data, surface);
    out += toHtml(surface);
  }
  return out;
}

std::string troubles(const FolderData& data) {
  std::string out;
  const auto item = [](const std::string& html) { return "<li>" + html + "</li>\n"; };
  for (const std::string& line : data.trouble) out += item(escape(line));
  for (const std::string& line : data.report.warnings) out += item(escape(line));
  for (const auto& [reason, count] : data.report.skipped) {
    out += item(grouped(count) + " " + escape(reason));
  }
  for (const ReportView& view : data.report.views) {
    if (view.registered) continue;
    out += item("view " + std::to_string(view.index) + " discarded: " + escape(view.reason));
  }
  return out.empty() ? "" : "<ul class=\"notes\">\n" + out + "</ul>\n";
}

}  // namespace scanner::evaluation::html
