#include "scanner/pipeline/report_builder.h"

#include <sys/resource.h>

#include <fstream>
#include <map>
#include <sstream>

#include "scanner/evaluation/html_report.h"

namespace scanner::pipeline {
namespace {

using evaluation::ReportView;
using evaluation::ScanReport;

double peakMemoryMb() {
  rusage usage{};
  if (getrusage(RUSAGE_SELF, &usage) != 0) return evaluation::kUnknown;
  return static_cast<double>(usage.ru_maxrss) / 1024.0;  // Linux counts kilobytes
}

std::vector<ReportView> reportViews(const ReportInput& input) {
  std::vector<ReportView> views;
  for (const FrameOutcome& frame : input.frames) {
    ReportView view;
    view.index = frame.index;
    view.stamp = frame.stamp;
    view.reason = frame.reason;
    view.points = frame.points;
    views.push_back(view);
  }
  // The last word on a view is the registrar's: finish() may place one that add() could not.
  for (const registration::RegisteredView& registered : input.registrar.views()) {
    ReportView& view = views.at(static_cast<std::size_t>(registered.view->index));
    view.registered = registered.registered;
    view.reason = registered.discard_reason;
    view.trial = registered.trial;
    view.resampled = registered.resampled;
    if (!registered.registered || registered.previous_registered < 0) continue;
    const evaluation::MotionComponents error = evaluation::motionComponents(
        registered.T_prev_registered_prior.inverse() * registered.T_prev_registered);
    view.mean_distance_m = registered.mean_distance_m;
    view.prior_arc_deg = error.arc_deg;
    view.prior_rho_m = error.rho_m;
  }
  return views;
}

void addPriorErrors(const ReportInput& input, ScanReport& report) {
  const auto& views = input.registrar.views();
  std::vector<evaluation::PriorPair> pairs;
  for (const registration::RegisteredView& view : views) {
    if (!view.registered || view.previous_registered < 0) continue;
    const auto& previous = views[static_cast<std::size_t>(view.previous_registered)];
    pairs.push_back({previous.view->index, view.view->index, view.T_prev_registered_prior,
                     view.T_prev_registered});
  }
  report.prior_relative = evaluation::relativePriorErrors(pairs);
  report.prior_absolute = evaluation::absolutePriorErrors(pairs);
}

void addTruth(const ReportInput& input, ScanReport& report) {
  if (!input.truth) return;
  Trajectory estimate;
  for (const registration::RegisteredView& view : input.registrar.views()) {
    if (view.registered) estimate.push_back({view.view->stamp, view.T_map_base});
  }
  Result<evaluation::PoseErrors> errors = evaluation::compareToTruth(estimate, *input.truth);
  if (!errors) {
    report.warnings.push_back("no comparison with the truth: " + errors.status().message());
    return;
  }
  for (const evaluation::PoseErrorRow& row : errors->poses) {
    for (ReportView& view : report.views) {
      if (!view.registered || view.stamp != row.stamp) continue;
      view.truth_position_m = row.position_m;
      view.truth_rotation_deg = row.rotation_deg;
    }
  }
  report.truth = *std::move(errors);
}

/// What the inertial sensor said about the motion between two of the registrar's views.
Eigen::Isometry3d priorBetween(const std::vector<registration::RegisteredView>& views, int from,
                               int to) {
  Eigen::Isometry3d T_from_to = Eigen::Isometry3d::Identity();
  for (int v = from + 1; v <= to; ++v) {
    T_from_to = T_from_to * views[static_cast<std::size_t>(v)].T_prev_prior;
  }
  return T_from_to;
}

/// Tables 5.5 and 5.6: groups against the one they were registered to, and against the first.
void addGroupPriorErrors(const ReportInput& input, ScanReport& report) {
  const auto& views = input.registrar.views();
  const auto& groups = input.registrar.groups();
  std::map<int, const registration::Group*> placed;
  std::vector<evaluation::PriorPair> relative, absolute;
  using registration::GroupPlacement;
  for (const registration::Group& group : groups) {
    if (group.placement == GroupPlacement::kOpen || group.placement == GroupPlacement::kFailed) {
      continue;
    }
    const auto reference = placed.find(group.reference_group);
    placed[group.id] = &group;
    if (group.placement != GroupPlacement::kRegistered || reference == placed.end()) continue;
    const registration::Group& first = *placed.begin()->second;
    relative.push_back({group.reference_group, group.id,
                        priorBetween(views, reference->second->first_view, group.first_view),
                        group.T_reference_group});
    absolute.push_back({first.id, group.id, priorBetween(views, first.first_view, group.first_view),
                        first.T_map_group.inverse() * group.T_map_group});
  }
  report.group_prior_relative = evaluation::relativePriorErrors(relative);
  report.group_prior_absolute = evaluation::relativePriorErrors(absolute);
}

double totalOf(const evaluation::ReportTimes& t) {
  return t.stereo + t.inertial + t.registration + t.global + t.surface;
}

void addSkipped(const ReportInput& input, ScanReport& report) {
  const inertial::InertialStatistics& imu = input.inertial;
  const std::pair<const char*, std::size_t> counts[] = {
      {"inertial samples that are not finite", imu.non_finite},
      {"inertial samples that go back in time", imu.backwards},
      {"inertial samples of equal stamp", imu.duplicates},
      {"gaps in the inertial samples", imu.gaps},
  };
  for (const auto& [reason, count] : counts) {
    if (count > 0) report.skipped[reason] = count;
  }
}

}  // namespace

std::optional<evaluation::ReportModel> reportModel(const surface::MeshStatistics& model) {
  if (model.faces == 0) return std::nullopt;
  return evaluation::ReportModel{model.vertices,           model.faces,
                                 model.components,         model.boundary_edges,
                                 model.non_manifold_edges, model.mean_spacing_m};
}

Status addModelToReport(ScanFolder& folder, const surface::MeshStatistics& model, double seconds) {
  const std::string path = folder.path() + "/report.json";
  std::ifstream file(path, std::ios::binary);
  if (!file) return Status::ok();
  std::ostringstream text;
  text << file.rdbuf();
  Result<ScanReport> report = evaluation::parseReport(text.str());
  if (!report) return Status(report.status().code(), path + ": " + report.status().message());
  report->model = reportModel(model);
  report->time_s.surface = seconds;
  report->time_s.total = totalOf(report->time_s);
  if (Status status = folder.writeText("report.json", evaluation::toJson(*report)); !status) {
    return status;
  }
  return evaluation::writeHtmlReport(folder.path());
}

ScanReport buildReport(const ReportInput& input, int threads) {
  ScanReport report;
  report.warnings = input.warnings;
  report.views = reportViews(input);
  report.groups = static_cast<int>(input.registrar.groups().size());
  const auto trials = input.registrar.trials().total();
  for (std::size_t step = 1; step < trials.size(); ++step) {
    report.trials[step - 1] = static_cast<int>(trials[step]);
  }
  addPriorErrors(input, report);
  addGroupPriorErrors(input, report);
  report.sampling = samplingTable(input.registrar.views(), threads);
  report.compatible = compatibleTable(input.registrar.views(), input.options, threads);
  addTruth(input, report);
  if (input.model) report.model = reportModel(*input.model);
  addSkipped(input, report);
  if (input.loop && input.loop->closed) {
    report.loop = {true, input.loop->residual_m, input.loop->residual_deg};
  }
  const StageTimes& t = input.times;
  report.time_s = {t.stereo, t.inertial, t.registration, t.global, t.surface};
  report.time_s.total = totalOf(report.time_s);
  report.peak_memory_mb = peakMemoryMb();
  return report;
}

}  // namespace scanner::pipeline
