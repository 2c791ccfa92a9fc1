#pragma once

#include <set>
#include <string>

#include "scanner/core/cloud.h"
#include "scanner/core/mesh.h"
#include "scanner/core/se3.h"
#include "scanner/core/status.h"

namespace scanner::pipeline {

/// The folder that a scan leaves behind (docs/architecture.md). Every file is written beside its
/// place and renamed, so what stands there is whole at any time, also after a crash or with a full
/// disk. Not thread-safe.
class ScanFolder {
 public:
  /// Makes the folder and its subfolders and checks that they can be written to. Throws
  /// ConfigurationError naming the folder and the reason.
  explicit ScanFolder(const std::string& path);

  const std::string& path() const { return path_; }

  /// views/view_NNN.ply: conditioned points of one view in base_link.
  Status writeView(const View& view);
  /// groups/group_NNN.ply: merged points of one similarity group, in map.
  Status writeGroup(int index, const PointCloud& cloud);
  Status writeTrajectory(const Trajectory& trajectory);
  Status writeCloud(const PointCloud& cloud);
  Status writeModel(const Mesh& mesh);
  /// pictures/view_NNN_NAME.jpg; `jpeg` is the content of the file.
  Status writePicture(int index, const std::string& name, const std::string& jpeg);
  Status writeText(const std::string& name, const std::string& text);
  /// Removes views, groups and pictures that an earlier scan left here and this one did not write,
  /// and the evaluation of the earlier model.
  void removeLeftovers() const;

 private:
  std::string numbered(const char* folder, const char* stem, int index, const std::string& end);

  std::string path_;
  std::set<std::string> written_;
};

}  // namespace scanner::pipeline
