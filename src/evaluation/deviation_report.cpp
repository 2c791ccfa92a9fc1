#include "scanner/evaluation/deviation_report.h"

#include <array>
#include <cstdarg>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace scanner::evaluation {
namespace {

using Json = nlohmann::ordered_json;  // keeps the order of writing; NaN is dumped as null

struct Column {
  const char* name;
  double DeviationStatistics::*value;
};

constexpr std::array<Column, 9> kColumns{
    {{"max_m", &DeviationStatistics::max_m},
     {"min_m", &DeviationStatistics::min_m},
     {"mean_positive_m", &DeviationStatistics::mean_positive_m},
     {"mean_negative_m", &DeviationStatistics::mean_negative_m},
     {"mean_m", &DeviationStatistics::mean_m},
     {"sigma_m", &DeviationStatistics::sigma_m},
     {"rmse_m", &DeviationStatistics::rmse_m},
     {"median_absolute_m", &DeviationStatistics::median_absolute_m},
     {"p95_absolute_m", &DeviationStatistics::p95_absolute_m}}};

void addStatistics(Json& out, const DeviationStatistics& s) {
  for (const Column& column : kColumns) out[column.name] = s.*column.value;
  out["points"] = s.points;
  out["outliers"] = s.outliers;
  out["skipped"] = s.skipped;
}

void addDeviation(Json& out, const Deviation& d) {
  addStatistics(out, d);
  out["coverage"] = d.coverage;
  Json rows = Json::array();
  for (int r = 0; r < 4; ++r) {
    Json row = Json::array();
    for (int c = 0; c < 4; ++c) row.push_back(d.alignment.matrix()(r, c));
    rows.push_back(row);
  }
  out["alignment"] = rows;
}

Json tableRows(const DeviationTable& table) {
  Json rows = Json::array();
  for (const DeviationRow& row : table.rows) {
    Json out{{"index", row.index}};
    addStatistics(out, row.deviation);
    rows.push_back(out);
  }
  return rows;
}

Statistics columnStatistics(const DeviationTable& table, const Column& column) {
  std::vector<double> samples;
  for (const DeviationRow& row : table.rows) samples.push_back(row.deviation.*column.value);
  return summarize(samples);
}

/// The last rows of the table, or null without one.
Json tableSummary(const DeviationTable& table) {
  if (table.rows.empty()) return nullptr;
  Json median, mean, sigma, model;
  for (const Column& column : kColumns) {
    const Statistics statistics = columnStatistics(table, column);
    median[column.name] = statistics.median;
    mean[column.name] = statistics.mean;
    sigma[column.name] = statistics.sigma;
  }
  addStatistics(model, table.together);
  return {{"median", median}, {"mean", mean}, {"sigma", sigma}, {"model", model}};
}

__attribute__((format(printf, 1, 2))) std::string line(const char* format, ...) {
  std::array<char, 256> text{};
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text.data(), text.size(), format, arguments);
  va_end(arguments);
  return std::string(text.data()) + '\n';
}

std::string figures(const Deviation& d) {
  return line("  deviation   %+.3f .. %+.3f mm, means %+.3f / %+.3f, sigma %.3f", 1e3 * d.min_m,
              1e3 * d.max_m, 1e3 * d.mean_negative_m, 1e3 * d.mean_positive_m, 1e3 * d.sigma_m) +
         line("  size        RMSE %.3f mm, median %.3f, 95 %% %.3f", 1e3 * d.rmse_m,
              1e3 * d.median_absolute_m, 1e3 * d.p95_absolute_m) +
         line("  points      %zu compared, %zu outliers (%.2f %%), %zu skipped", d.points,
              d.outliers,
              100.0 * static_cast<double>(d.outliers) / static_cast<double>(d.points + d.outliers),
              d.skipped) +
         line("  coverage    %.1f %% of the reference", 100.0 * d.coverage);
}

std::string tableLines(const char* name, const DeviationTable& table) {
  if (table.rows.empty()) return "";
  std::string out =
      line("%-12s%zu; mm      max     min   mean+   mean-   sigma", name, table.rows.size());
  const auto row = [&](const char* label, const auto& value) {
    std::string cells;
    for (const std::size_t c : {0, 1, 2, 3, 5}) {
      std::array<char, 32> cell{};
      std::snprintf(cell.data(), cell.size(), " %7.2f", 1e3 * value(kColumns[c]));
      cells += cell.data();
    }
    out += line("  %-19s%s", label, cells.c_str());
  };
  row("median", [&](const Column& c) { return columnStatistics(table, c).median; });
  row("mean", [&](const Column& c) { return columnStatistics(table, c).mean; });
  row("sigma", [&](const Column& c) { return columnStatistics(table, c).sigma; });
  row("all at once", [&](const Column& c) { return table.together.*c.value; });
  return out;
}

}  // namespace

const char* toString(Placement placement) {
  switch (placement) {
    case Placement::kFirstPose:
      return "first_pose";
    case Placement::kBestFit:
      return "best_fit";
    case Placement::kAsGiven:
      break;
  }
  return "as_given";
}

std::string toJson(const DeviationReport& report) {
  Json out{{"model", report.model},
           {"reference", report.reference},
           {"placement", toString(report.placement)}};
  addDeviation(out, report.deviation);
  out["first_pose"] = nullptr;
  if (report.first_pose) addDeviation(out["first_pose"], *report.first_pose);
  out["range_m"] = report.range_m;
  out["options"] = {{"outlier_m", report.options.outlier_m},
                    {"coverage_m", report.options.coverage_m}};
  out["tables"] = {{"views", tableRows(report.views)}, {"groups", tableRows(report.groups)}};
  out["summaries"] = {{"views", tableSummary(report.views)},
                      {"groups", tableSummary(report.groups)}};
  out["warnings"] = report.warnings;
  return out.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

std::string summary(const DeviationReport& report) {
  std::string out;
  if (report.first_pose) out += "placed by the first pose\n" + figures(*report.first_pose);
  switch (report.placement) {
    case Placement::kAsGiven:
      out += "placed as given\n";
      break;
    case Placement::kFirstPose:
      out += "placed by the first pose\n";
      break;
    case Placement::kBestFit:
      out += "best fit\n";
      break;
  }
  out += figures(report.deviation);
  out += tableLines("views", report.views) + tableLines("groups", report.groups);
  for (const std::string& warning : report.warnings) out += "warning     " + warning + '\n';
  return out;
}

}  // namespace scanner::evaluation
