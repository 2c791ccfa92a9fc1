#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "scanner/core/se3.h"
#include "scanner/core/status.h"

namespace scanner::evaluation {

/// A point cloud of a scan folder and its place in the map.
struct PlacedFile {
  int index = 0;  ///< the number in the file's name
  std::string path;
  Eigen::Isometry3d T_map_cloud = Eigen::Isometry3d::Identity();
};

/// What `evaluate` needs of a scan folder.
struct ScanFiles {
  std::string model;
  std::vector<PlacedFile> views;   ///< registered ones, by index
  std::vector<PlacedFile> groups;  ///< by index
  std::optional<StampedPose> first_pose;
  std::vector<std::string> warnings;  ///< tables that cannot be made, and why
};

/// Lists the folder. A view is placed by the pose of the trajectory at its stamp, which
/// report.json knows. kIoError when the folder has no model.ply.
Result<ScanFiles> listScanFiles(const std::string& folder);

}  // namespace scanner::evaluation
