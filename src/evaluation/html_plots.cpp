#include <algorithm>
#include <cmath>

#include "evaluation/html_parts.h"
#include "evaluation/html_text.h"
#include "evaluation/svg_plot.h"

namespace scanner::evaluation::html {
namespace {

constexpr const char* kBlue = "#2563a8";
constexpr const char* kOrange = "#c2620c";
constexpr const char* kRed = "#c81e1e";

/// One position per view of the report: measured, or for a discarded view where it would lie
/// between its neighbours, by time.
struct PathPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  bool registered = false;
};

std::vector<PathPoint> pathOf(const FolderData& data) {
  std::vector<PathPoint> path;
  const Trajectory& known = data.trajectory;
  if (known.empty()) return path;
  const auto before = [](const StampedPose& pose, Time stamp) { return pose.stamp < stamp; };
  for (const StampedPose& pose : known) {
    path.push_back({pose.T_map_base.translation(), true});
  }
  for (const ReportView& view : data.report.views) {
    if (view.registered) continue;
    const auto next = std::lower_bound(known.begin(), known.end(), view.stamp, before);
    if (next == known.begin() || next == known.end()) continue;  // nothing to lie between
    const auto previous = next - 1;
    const double share =
        toSeconds(view.stamp - previous->stamp) / toSeconds(next->stamp - previous->stamp);
    path.push_back({(1.0 - share) * previous->T_map_base.translation() +
                        share * next->T_map_base.translation(),
                    false});
  }
  return path;
}

/// Size of the box around a path.
Eigen::Vector3d extent(const std::vector<PathPoint>& path) {
  Eigen::Vector3d low = path.front().position, high = low;
  for (const PathPoint& point : path) {
    low = low.cwiseMin(point.position);
    high = high.cwiseMax(point.position);
  }
  return high - low;
}

/// The path projected to two axes of the map.
std::string pathPlot(const std::vector<PathPoint>& path, const std::string& title, int across,
                     int up) {
  static const char* kNames[] = {"x", "y", "z"};
  // A path that fits into a hand is easier read in millimetres.
  constexpr double kHand = 0.2;
  const bool small = extent(path).norm() < kHand;
  const double scale = small ? 1e3 : 1.0;
  const std::string unit = small ? " (mm)" : " (m)";
  svg::Series line, stops, lost;
  stops.mark = svg::Mark::kDot;
  lost.mark = svg::Mark::kCross;
  lost.color = kRed;
  for (const PathPoint& point : path) {
    svg::Series& series = point.registered ? line : lost;
    series.x.push_back(scale * point.position[across]);
    series.y.push_back(scale * point.position[up]);
  }
  const double last = std::max(1.0, static_cast<double>(line.x.size()) - 1.0);
  for (std::size_t i = 0; i < line.x.size(); ++i) {
    line.colors.push_back(svg::sequentialColor(static_cast<double>(i) / last));
  }
  stops.x = line.x;
  stops.y = line.y;
  stops.colors = line.colors;
  if (!lost.x.empty()) lost.label = "discarded";
  svg::Plot plot;
  plot.title = title;
  plot.x_label = kNames[across] + unit;
  plot.y_label = kNames[up] + unit;
  plot.series = {line, stops, lost};
  plot.equal_scales = true;
  plot.from_zero = false;
  plot.height = 360;
  return svg::toSvg(plot);
}

using ValueOf = double (*)(const ReportView&);

svg::Series series(const FolderData& data, svg::Mark mark, const char* color,
                   const std::string& label, ValueOf value) {
  svg::Series out;
  out.mark = mark;
  out.color = color;
  out.label = label;
  for (const ReportView& view : data.report.views) {
    out.x.push_back(view.index);
    out.y.push_back(value(view));
  }
  return out;
}

std::string viewPlot(const FolderData& data, const std::string& title, const std::string& unit,
                     const char* color, ValueOf value) {
  svg::Plot plot;
  plot.title = title;
  plot.x_label = "view";
  plot.y_label = unit;
  plot.series = {series(data, svg::Mark::kBar, color, "", value)};
  return svg::toSvg(plot);
}

std::string pointsPlot(const FolderData& data) {
  const auto kept = [](const ReportView& v) {
    return v.registered ? 1e-3 * static_cast<double>(v.points) : kUnknown;
  };
  const auto lost = [](const ReportView& v) {
    return v.registered ? kUnknown : 1e-3 * static_cast<double>(v.points);
  };
  svg::Plot plot;
  plot.title = "Points per view";
  plot.x_label = "view";
  plot.y_label = "thousand";
  plot.series = {series(data, svg::Mark::kBar, kBlue, "", kept),
                 series(data, svg::Mark::kBar, kRed, "", lost)};
  const auto discarded = [](const ReportView& v) { return !v.registered; };
  if (std::any_of(data.report.views.begin(), data.report.views.end(), discarded)) {
    plot.series[1].label = "discarded";
  }
  return svg::toSvg(plot);
}

std::string timePlot(const ReportTimes& times) {
  std::vector<svg::Bar> bars;
  const std::pair<const char*, double> stages[] = {{"stereo", times.stereo},
                                                   {"inertial", times.inertial},
                                                   {"registration", times.registration},
                                                   {"global", times.global},
                                                   {"surface", times.surface}};
  bool any = false;
  for (const auto& [name, value] : stages) {
    bars.push_back({name, value, std::isfinite(value) ? fixed(value, 1) + " s" : "not taken"});
    any = any || value > 0.0;
  }
  return any ? svg::toSvg("Time per stage", bars) : "";
}

std::string card(const std::string& svg) {
  return svg.empty() ? "" : "<div class=\"plot\">\n" + svg + "</div>\n";
}

}  // namespace

std::string plots(const FolderData& data) {
  std::string out;
  const std::vector<PathPoint> path = pathOf(data);
  if (!path.empty()) {
    out += card(pathPlot(path, "Camera path from above (dark: first view, yellow: last)", 0, 1));
    const Eigen::Vector3d size = extent(path);
    const int wider = size.x() >= size.y() ? 0 : 1;
    out += card(pathPlot(path, "Camera path from the side", wider, 2));
  }
  out += card(viewPlot(data, "Prior: error in position", "mm", kBlue,
                       [](const ReportView& v) { return 1e3 * v.prior_rho_m; }));
  out += card(viewPlot(data, "Prior: error in rotation", "deg", kOrange,
                       [](const ReportView& v) { return v.prior_arc_deg; }));
  out += card(viewPlot(data, "Registration: mean distance of matched points", "mm", kBlue,
                       [](const ReportView& v) { return 1e3 * v.mean_distance_m; }));
  out += card(viewPlot(data, "Distance from the true position", "mm", kBlue,
                       [](const ReportView& v) { return 1e3 * v.truth_position_m; }));
  out += card(viewPlot(data, "Angle to the true orientation", "deg", kOrange,
                       [](const ReportView& v) { return v.truth_rotation_deg; }));
  out += card(pointsPlot(data));
  out += card(timePlot(data.report.time_s));
  return out.empty() ? "" : "<div class=\"plots\">\n" + out + "</div>\n";
}

}  // namespace scanner::evaluation::html
