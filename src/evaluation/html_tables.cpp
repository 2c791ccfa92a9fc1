#include <algorithm>
#include <cmath>

#include "evaluation/html_parts.h"
#include "evaluation/html_text.h"
#include "evaluation/published.h"

namespace scanner::evaluation::html {
namespace {

using Cells = std::vector<std::string>;
constexpr const char* kArrow = " \xE2\x86\x92 ";

std::string number(int value) { return std::to_string(value); }

/// Columns of tables 5.2 to 5.6: degrees as they are, metres in mm.
constexpr std::size_t kAngles = 4;

std::string motionCell(double value, std::size_t column) {
  return column < kAngles ? fixed(value, 2) : fixed(1e3 * value, 1);
}

Cells motionCells(const std::string& label, const published::Columns& values, bool muted) {
  Cells cells = {muted ? "<em>" + label + "</em>" : label};
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::string cell = motionCell(values[i], i);
    cells.push_back(muted ? "<em>" + cell + "</em>" : cell);
  }
  return cells;
}

published::Columns columnsOf(const MotionComponents& m) {
  return {m.arc_deg, m.roll_deg, m.pitch_deg, m.yaw_deg, m.rho_m, m.x_m, m.y_m, m.z_m};
}

published::Columns columnsOf(const MotionSummary& s, double Statistics::*value) {
  return {s.arc_deg.*value, s.roll_deg.*value, s.pitch_deg.*value, s.yaw_deg.*value,
          s.rho_m.*value,   s.x_m.*value,      s.y_m.*value,       s.z_m.*value};
}

std::string motionTable(const std::string& caption, const std::string& note,
                        const std::vector<MotionRow>& rows, const published::Motion& published) {
  if (rows.empty()) return "";
  Table table;
  table.caption = caption;
  table.note = note;
  table.fold = true;
  table.head = {
      "",     "arc \xC2\xB0", "roll \xC2\xB0", "pitch \xC2\xB0", "yaw \xC2\xB0", "distance mm",
      "x mm", "y mm",         "z mm"};
  for (const MotionRow& row : rows) {
    table.rows.push_back(
        motionCells(number(row.from) + kArrow + number(row.to), columnsOf(row.motion), false));
  }
  const MotionSummary summary = summarize(rows);
  table.summary = {motionCells("median", columnsOf(summary, &Statistics::median), false),
                   motionCells("mean", columnsOf(summary, &Statistics::mean), false),
                   motionCells("sigma", columnsOf(summary, &Statistics::sigma), false),
                   motionCells("published median", published.median, true),
                   motionCells("published mean", published.mean, true),
                   motionCells("published sigma", published.sigma, true)};
  return toHtml(table);
}

/// Numbers of the views instead of positions in the trajectory, where the report knows them.
std::vector<MotionRow> neighbours(const FolderData& data) {
  if (data.trajectory.size() < 2) return {};
  std::vector<int> index;
  for (const ReportView& view : data.report.views) {
    if (view.registered) index.push_back(view.index);
  }
  std::vector<MotionRow> rows = motionsBetweenNeighbours(data.trajectory);
  if (index.size() != data.trajectory.size()) return rows;
  for (MotionRow& row : rows) {
    row.from = index[static_cast<std::size_t>(row.from)];
    row.to = index[static_cast<std::size_t>(row.to)];
  }
  return rows;
}

Table viewTable(const ScanReport& report) {
  const bool truth = report.truth.has_value();
  Table table;
  table.caption = "Views";
  table.note =
      "Residual: mean distance of matched points. Step: of the trials below; (7) after thinning the"
      " crowded normals. Prior error: what registration corrected in the motion since the view"
      " before.";
  table.fold = true;
  table.head = {"view",   "time s",      "result",         "step",
                "points", "residual mm", "prior error mm", "prior error \xC2\xB0"};
  if (truth) table.head.insert(table.head.end(), {"off truth mm", "off truth \xC2\xB0"});
  for (const ReportView& view : report.views) {
    const double time = toSeconds(view.stamp - report.views.front().stamp);
    Cells row = {number(view.index),
                 fixed(time, 2),
                 view.registered ? "registered" : "<b>discarded:</b> " + escape(view.reason),
                 view.registered ? number(view.trial) + (view.resampled ? " (7)" : "") : "",
                 grouped(view.points),
                 fixed(1e3 * view.mean_distance_m, 2),
                 fixed(1e3 * view.prior_rho_m, 2),
                 fixed(view.prior_arc_deg, 3)};
    if (truth) {
      row.push_back(fixed(1e3 * view.truth_position_m, 2));
      row.push_back(fixed(view.truth_rotation_deg, 3));
    }
    table.rows.push_back(row);
  }
  return table;
}

using ViewValue = double (*)(const ReportView&);

void addViewSummary(const ScanReport& report, Table& table) {
  std::vector<std::pair<ViewValue, int>> columns = {
      {[](const ReportView& v) { return static_cast<double>(v.points); }, 0},
      {[](const ReportView& v) { return 1e3 * v.mean_distance_m; }, 2},
      {[](const ReportView& v) { return 1e3 * v.prior_rho_m; }, 2},
      {[](const ReportView& v) { return v.prior_arc_deg; }, 3}};
  if (report.truth) {
    columns.emplace_back([](const ReportView& v) { return 1e3 * v.truth_position_m; }, 2);
    columns.emplace_back([](const ReportView& v) { return v.truth_rotation_deg; }, 3);
  }
  const std::pair<const char*, double Statistics::*> lines[] = {{"median", &Statistics::median},
                                                                {"mean", &Statistics::mean},
                                                                {"sigma", &Statistics::sigma},
                                                                {"largest", &Statistics::max}};
  std::vector<Statistics> statistics;
  for (const auto& [value, digits] : columns) {
    std::vector<double> samples;
    for (const ReportView& view : report.views) samples.push_back(value(view));
    statistics.push_back(summarize(samples));
  }
  for (const auto& [label, part] : lines) {
    Cells row = {label, "", "", ""};
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const double value = statistics[i].*part;
      const bool whole = columns[i].second == 0 && value >= 0.0;
      row.push_back(whole ? grouped(static_cast<std::size_t>(std::lround(value)))
                          : fixed(value, columns[i].second));
    }
    table.summary.push_back(row);
  }
}

std::string trialTable(const ScanReport& report) {
  int total = 0, published_total = 0;
  for (const int count : report.trials) total += count;
  for (const int count : published::kTrials) published_total += count;
  if (total == 0) return "";
  static const char* kStarts[] = {"prior, shift only",
                                  "prior, full",
                                  "on the last view, shift only",
                                  "on the last view, full",
                                  "on the reference, shift only",
                                  "on the reference, full",
                                  "again without the crowded normals",
                                  "given up"};
  Table table;
  table.caption = "Trial statistics (table 5.1)";
  table.note = "How often each step of the registration was the one that succeeded.";
  table.words_in_second = true;
  table.head = {"step",  "start and kind",     "alignments",
                "share", "<em>published</em>", "<em>share</em>"};
  for (std::size_t i = 0; i < report.trials.size(); ++i) {
    table.rows.push_back(
        {std::to_string(i + 1), kStarts[i], number(report.trials[i]),
         fixed(100.0 * report.trials[i] / total, 1) + " %",
         "<em>" + number(published::kTrials[i]) + "</em>",
         "<em>" + fixed(100.0 * published::kTrials[i] / published_total, 1) + " %</em>"});
  }
  return toHtml(table);
}

std::string samplingTable(const ScanReport& report) {
  if (report.sampling.empty()) return "";
  Table table;
  table.caption = "Normal-space sampling (table 4.2)";
  table.note =
      "Normals of all points of a view over buckets of spherical angles, in the hemisphere about"
      " their mean; means over the views.";
  table.head = {"bucket",         "buckets", "empty", "empty %", "points per occupied bucket",
                "sigma of these", ""};
  for (const ReportSampling& row : report.sampling) {
    const std::string size = fixed(row.bucket_deg, 0) + "\xC2\xB0";
    table.rows.push_back({size, fixed(row.buckets, 0), fixed(row.empty, 1),
                          fixed(100.0 * row.empty / row.buckets, 1), fixed(row.per_bucket, 1),
                          fixed(row.per_bucket_sigma, 1), ""});
    for (const published::Sampling& p : published::kSampling) {
      if (p.bucket_deg != row.bucket_deg) continue;
      table.rows.push_back({"", "<em>" + fixed(p.buckets, 0) + "</em>",
                            "<em>" + fixed(p.empty, 1) + "</em>",
                            "<em>" + fixed(100.0 * p.empty / p.buckets, 1) + "</em>",
                            "<em>" + fixed(p.per_bucket, 1) + "</em>",
                            "<em>" + fixed(p.per_bucket_sigma, 1) + "</em>", "<em>published</em>"});
    }
  }
  return toHtml(table);
}

std::string compatibleTable(const ScanReport& report) {
  if (report.compatible.empty()) return "";
  Table table;
  table.caption = "Compatible points by cutoff angle (table 4.3)";
  table.note =
      "Samples of the view before whose normal is compatible with that of a sample; means over all"
      " samples.";
  table.head = {"cutoff", "points", "share", "<em>published points</em>", "<em>share</em>"};
  for (const ReportCompatible& row : report.compatible) {
    Cells cells = {fixed(row.angle_deg, 0) + "\xC2\xB0", fixed(row.points, 1),
                   fixed(100.0 * row.share, 2) + " %", "", ""};
    for (const published::Compatible& p : published::kCompatible) {
      if (p.angle_deg != row.angle_deg) continue;
      cells[3] = "<em>" + fixed(p.points, 1) + "</em>";
      cells[4] = "<em>" + fixed(100.0 * p.share, 2) + " %</em>";
    }
    table.rows.push_back(cells);
  }
  return toHtml(table);
}

constexpr double DeviationFigures::*kDeviationColumns[] = {
    &DeviationFigures::max_m, &DeviationFigures::min_m, &DeviationFigures::mean_positive_m,
    &DeviationFigures::mean_negative_m, &DeviationFigures::sigma_m};

Cells deviationCells(const std::string& label, const DeviationFigures& row) {
  Cells cells = {label};
  for (const auto column : kDeviationColumns) cells.push_back(fixed(1e3 * (row.*column), 2));
  return cells;
}

std::string deviationTable(const std::string& caption, const std::vector<DeviationFigures>& rows,
                           const DeviationFigures& together,
                           const std::array<double, 5>& published) {
  if (rows.empty()) return "";
  Table table;
  table.caption = caption;
  table.fold = true;
  table.head = {"", "max mm", "min mm", "mean of + mm", "mean of \xE2\x88\x92 mm", "sigma mm"};
  for (const DeviationFigures& row : rows) {
    table.rows.push_back(deviationCells(escape(row.label), row));
  }
  if (std::isfinite(together.max_m)) {
    table.summary.push_back(deviationCells("all together", together));
  }
  Cells median = {"median"}, mean = {"mean"}, sigma = {"sigma"},
        thesis = {"<em>published mean</em>"};
  for (std::size_t i = 0; i < published.size(); ++i) {
    std::vector<double> samples;
    samples.reserve(rows.size());
    for (const DeviationFigures& row : rows) samples.push_back(1e3 * (row.*kDeviationColumns[i]));
    const Statistics statistics = summarize(samples);
    median.push_back(fixed(statistics.median, 2));
    mean.push_back(fixed(statistics.mean, 2));
    sigma.push_back(fixed(statistics.sigma, 2));
    thesis.push_back("<em>" + fixed(1e3 * published[i], 2) + "</em>");
  }
  table.summary.insert(table.summary.end(), {median, mean, sigma, thesis});
  return toHtml(table);
}

}  // namespace

std::string scanTables(const FolderData& data) {
  std::string out;
  if (!data.report.views.empty()) {
    Table views = viewTable(data.report);
    addViewSummary(data.report, views);
    out += toHtml(views);
  }
  return out + trialTable(data.report);
}

std::string motionTables(const FolderData& data) {
  const ScanReport& report = data.report;
  std::string out;
  out += motionTable("Motion between neighbouring views (table 5.2)",
                     "How the sensor moved, as seen from the map, after registration.",
                     neighbours(data), published::kTable52);
  out +=
      motionTable("Error of the prior between neighbouring views (table 5.3)",
                  "What registration had to correct in the motion that the inertial sensor gave.",
                  report.prior_relative, published::kTable53);
  out += motionTable("Error of the prior since the first view (table 5.4)",
                     "The same with the motions compounded from the first view on.",
                     report.prior_absolute, published::kTable54);
  out +=
      motionTable("Error of the prior between groups (table 5.5)",
                  "Between the first views of a group and of the group it was registered against.",
                  report.group_prior_relative, published::kTable55);
  out += motionTable("Error of the prior since the first group (table 5.6)", "",
                     report.group_prior_absolute, published::kTable56);
  return out;
}

std::string samplingTables(const FolderData& data) {
  return samplingTable(data.report) + compatibleTable(data.report);
}

std::string deviationTables(const FolderData& data) {
  if (!data.deviation) return "";
  const DeviationFile& d = *data.deviation;
  return deviationTable("Deviation of the views (table 5.7)", d.views, d.all_views,
                        published::kTable57Mean) +
         deviationTable("Deviation of the groups (table 5.8)", d.groups, d.all_groups,
                        published::kTable58Mean);
}

std::string runTables(const FolderData& data) {
  std::string out;
  if (const std::optional<ReportModel>& m = data.report.model) {
    Table table;
    table.caption = "Model";
    table.head = {"vertices",           "faces",          "pieces", "boundary edges",
                  "non-manifold edges", "mean spacing mm"};
    table.rows = {{grouped(m->vertices), grouped(m->faces), grouped(m->components),
                   grouped(m->boundary_edges), grouped(m->non_manifold_edges),
                   fixed(1e3 * m->mean_spacing_m, 2)}};
    out += toHtml(table);
  }
  const ReportTimes& t = data.report.time_s;
  Table table;
  table.caption = "Processing time and memory";
  table.note = "Wall-clock seconds. A dash: the stage ran where its time was not taken.";
  table.head = {"stereo",  "inertial", "registration",  "global",
                "surface", "total",    "peak memory MB"};
  table.rows = {{fixed(t.stereo, 1), fixed(t.inertial, 2), fixed(t.registration, 1),
                 fixed(t.global, 1), fixed(t.surface, 1), fixed(t.total, 1),
                 fixed(data.report.peak_memory_mb, 0)}};
  return out + toHtml(table);
}

}  // namespace scanner::evaluation::html
