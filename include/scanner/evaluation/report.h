#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "scanner/core/status.h"
#include "scanner/core/time.h"
#include "scanner/evaluation/pose_error.h"

namespace scanner::evaluation {

inline constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// One view in the report. What is not known stays NaN, and becomes null.
struct ReportView {
  int index = -1;
  Time stamp;
  bool registered = false;
  std::string reason;  ///< why it was discarded; empty for a registered view
  int trial = 0;       ///< 1..6, 0 for the first view
  bool resampled = false;
  std::size_t points = 0;
  double mean_distance_m = kUnknown;
  double prior_arc_deg = kUnknown;
  double prior_rho_m = kUnknown;
  double truth_position_m = kUnknown;
  double truth_rotation_deg = kUnknown;
};

struct ReportLoop {
  bool closed = false;
  double residual_m = kUnknown;
  double residual_deg = kUnknown;
};

struct ReportModel {
  std::size_t vertices = 0;
  std::size_t faces = 0;
  std::size_t components = 0;
  std::size_t boundary_edges = 0;
  std::size_t non_manifold_edges = 0;
  double mean_spacing_m = kUnknown;
};

/// Wall-clock seconds; NaN for a stage that ran where its time was not taken.
struct ReportTimes {
  double stereo = 0.0;
  double inertial = 0.0;
  double registration = 0.0;
  double global = 0.0;
  double surface = 0.0;
  double total = 0.0;
};

/// How the normals of a view spread over buckets of spherical angles (thesis table 4.2): means over
/// the views, of the hemisphere about the view's mean normal.
struct ReportSampling {
  double bucket_deg = 0.0;
  double buckets = kUnknown;
  double empty = kUnknown;
  double per_bucket = kUnknown;  ///< points, mean over the occupied buckets
  double per_bucket_sigma = kUnknown;
};

/// Samples of the previous view whose normal is compatible with that of a sample (thesis
/// table 4.3).
struct ReportCompatible {
  double angle_deg = 0.0;
  double points = kUnknown;  ///< mean count
  double share = kUnknown;   ///< of the samples of that view, 0..1
};

/// Everything that report.json holds; plain values, filled by whoever ran the scan.
struct ScanReport {
  std::vector<ReportView> views;  ///< every view, in order; total and discarded are counted here
  int groups = 0;
  std::array<int, 8> trials{};  ///< how often steps 1..8 of method.md section 8 were taken
  std::vector<MotionRow> prior_relative;
  std::vector<MotionRow> prior_absolute;
  std::vector<MotionRow> group_prior_relative;  ///< `from` and `to` are numbers of groups
  std::vector<MotionRow> group_prior_absolute;
  std::vector<ReportSampling> sampling;
  std::vector<ReportCompatible> compatible;
  std::optional<PoseErrors> truth;  ///< absent without ground truth
  ReportLoop loop;
  std::optional<ReportModel> model;  ///< absent when no surface was made
  ReportTimes time_s;
  double peak_memory_mb = kUnknown;
  std::vector<std::string> warnings;           ///< trouble with the input, one line each
  std::map<std::string, std::size_t> skipped;  ///< what was left out, counted by reason
};

/// The report as JSON with keys in a fixed order, two spaces of indentation and a final newline.
/// Unknown numbers and absent parts are null. Same report, same bytes.
///
///     views{total,registered,discarded,discarded_views[{index,stamp_ns,reason}]}  groups
///     trials{"1".."8"}
///     prior{relative|absolute|group_relative|group_absolute{arc_deg,roll_deg,pitch_deg,yaw_deg,rho_m,x_m,y_m,z_m
///                             -> median,mean,sigma,min,max,count}}
///     truth{position_rmse_m,position_max_m,rotation_rmse_deg,rotation_max_deg,compared,skipped}
///     loop{closed,residual_m,residual_deg}
///     model{vertices,faces,components,boundary_edges,non_manifold_edges,mean_spacing_m}
///     time_s{stereo,inertial,registration,global,surface,total}  peak_memory_mb
///     warnings[]  skipped{reason -> count}
///     tables{views[{index,stamp_ns,...}],prior_relative[{from,to,arc_deg,...}],prior_absolute[],
///            group_prior_relative[],group_prior_absolute[],sampling[],compatible[]}
std::string toJson(const ScanReport& report);

/// The inverse: a key that is absent, null or of another type leaves its field unknown.
/// kInvalidInput for text that is no JSON object.
Result<ScanReport> parseReport(const std::string& json);

}  // namespace scanner::evaluation
