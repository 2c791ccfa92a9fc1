#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "scanner/core/status.h"
#include "scanner/evaluation/deviation.h"

namespace scanner::evaluation {

/// How the model came to lie on the reference.
enum class Placement { kAsGiven, kFirstPose, kBestFit };
const char* toString(Placement placement);

struct DeviationRow {
  int index = 0;  ///< of the view or group
  DeviationStatistics deviation;
};

/// Thesis table 5.7 or 5.8.
struct DeviationTable {
  std::vector<DeviationRow> rows;
  DeviationStatistics together;  ///< of all rows' points at once, the tables' row "model"
};

/// Everything that deviation.json holds.
struct DeviationReport {
  std::string model, reference;  ///< file names without their folders
  Placement placement = Placement::kAsGiven;
  Deviation deviation;                  ///< of the model, placed so
  std::optional<Deviation> first_pose;  ///< placed by the first pose, when a best fit followed
  DeviationTable views, groups;         ///< empty unless a scan folder has them
  double range_m = 0.0;                 ///< of the colours
  DeviationOptions options;
  std::vector<std::string> warnings;
};

/// Keys in a fixed order; what is not known is null; same report, same bytes.
///
///     model  reference  placement("as_given"|"first_pose"|"best_fit")
///     max_m min_m mean_positive_m mean_negative_m mean_m sigma_m rmse_m median_absolute_m
///     p95_absolute_m points outliers skipped  coverage  alignment[4][4] (T_reference_model)
///     first_pose{the keys from max_m to alignment}  range_m  options{outlier_m,coverage_m}
///     tables{views[{index,max_m,...,skipped}],groups[]}
///     summaries{views|groups{median|mean|sigma|model{max_m,...}}}  warnings[]
std::string toJson(const DeviationReport& report);

/// For a person: the figures of the model in mm, and the last rows of the tables.
std::string summary(const DeviationReport& report);

struct EvaluationRequest {
  std::string model;      ///< PLY of a mesh or cloud, or a scan folder
  std::string reference;  ///< PLY of a mesh
  std::string truth;     ///< TUM file of true poses of base_link in the reference's frame, or empty
  std::string out;       ///< folder to fill; may be the scan folder
  bool align = false;    ///< best fit, after the placement by the truth if there is one
  double range_m = 0.0;  ///< of the colours; 0 chooses it from the 95th percentile
  bool per_point =
      false;  ///< write deviation.asc, `x y z deviation` a line, which CloudCompare reads
  DeviationOptions options;
  int threads = 1;
};

using EvaluationProgress =
    std::function<void(std::size_t done, std::size_t total, const std::string& what)>;

/// Compares a model with a reference and writes deviation.json, deviation.ply (the model in the
/// reference's frame, coloured), deviation.png and histogram.png into `out`. Throws
/// ConfigurationError for a reference or request that cannot be used; trouble with the model is a
/// status. The result does not depend on `threads`.
Result<DeviationReport> evaluateModel(const EvaluationRequest& request,
                                      const EvaluationProgress& progress);

}  // namespace scanner::evaluation
