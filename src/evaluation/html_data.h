#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "scanner/core/mesh.h"
#include "scanner/core/se3.h"
#include "scanner/core/status.h"
#include "scanner/evaluation/report.h"

namespace scanner::evaluation::html {

/// A row of thesis tables 5.7 and 5.8; NaN where the file does not say.
struct DeviationFigures {
  std::string label;
  double max_m = kUnknown, min_m = kUnknown;
  double mean_positive_m = kUnknown, mean_negative_m = kUnknown;
  double sigma_m = kUnknown;
};

/// deviation.json.
struct DeviationFile {
  DeviationFigures model;
  double mean_m = kUnknown, rmse_m = kUnknown;
  double median_absolute_m = kUnknown, p95_absolute_m = kUnknown;
  double coverage = kUnknown;  ///< 0..1
  std::size_t points = 0, outliers = 0;
  std::string placement;  ///< "as_given", "first_pose", "best_fit" or ""
  std::vector<DeviationFigures> views, groups;
  DeviationFigures all_views, all_groups;  ///< their points taken together
};

struct Picture {
  std::string caption;  ///< plain text
  std::string uri;      ///< value of src=
};

/// A scan folder as far as the report shows it. What is not there is empty.
struct FolderData {
  std::string name;  ///< of the folder
  ScanReport report;
  Trajectory trajectory;  ///< T_map_base of the registered views
  std::string config;     ///< YAML
  std::optional<Mesh> model;
  std::optional<DeviationFile> deviation;
  std::vector<Picture> deviation_pictures;
  std::vector<Picture> samples;      ///< pictures/, in the order of their names
  std::vector<std::string> trouble;  ///< files that are there but cannot be read
};

/// Fails without a sound report.json, naming it; trouble with any other file is in `trouble`.
Result<FolderData> readFolder(const std::string& folder);

}  // namespace scanner::evaluation::html
