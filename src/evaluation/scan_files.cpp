#include "evaluation/scan_files.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "scanner/core/trajectory_io.h"
#include "scanner/evaluation/report.h"

namespace scanner::evaluation {
namespace {

namespace fs = std::filesystem;

/// The files `folder`/`stem`_NNN.ply by their number.
std::vector<PlacedFile> numberedFiles(const fs::path& folder, const std::string& stem) {
  std::vector<PlacedFile> files;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    PlacedFile file;
    int length = 0;
    if (std::sscanf(name.c_str(), (stem + "_%d.ply%n").c_str(), &file.index, &length) != 1 ||
        length != static_cast<int>(name.size())) {
      continue;
    }
    file.path = entry.path().string();
    files.push_back(file);
  }
  std::sort(files.begin(), files.end(),
            [](const PlacedFile& a, const PlacedFile& b) { return a.index < b.index; });
  return files;
}

Result<ScanReport> readReport(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) {
    return Status(StatusCode::kIoError, "cannot read " + path.string());
  }
  return parseReport(text.str());
}

/// Places the views that the trajectory has a pose for; the others were discarded.
void placeViews(const fs::path& folder, const Trajectory& trajectory, ScanFiles& out) {
  const Result<ScanReport> report = readReport(folder / "report.json");
  if (!report) {
    out.warnings.push_back("no table of views: " + report.status().message());
    return;
  }
  std::map<Time, Eigen::Isometry3d> poses;
  for (const StampedPose& pose : trajectory) poses.emplace(pose.stamp, pose.T_map_base);
  std::map<int, Time> stamps;
  for (const ReportView& view : report->views) {
    if (view.registered) stamps.emplace(view.index, view.stamp);
  }
  for (PlacedFile& file : numberedFiles(folder / "views", "view")) {
    const auto stamp = stamps.find(file.index);
    if (stamp == stamps.end()) continue;
    const auto pose = poses.find(stamp->second);
    if (pose == poses.end()) {
      out.warnings.push_back("view " + std::to_string(file.index) +
                             " left out: trajectory.tum has "
                             "no pose at its stamp");
      continue;
    }
    file.T_map_cloud = pose->second;
    out.views.push_back(file);
  }
}

}  // namespace

Result<ScanFiles> listScanFiles(const std::string& folder) {
  ScanFiles out;
  out.model = (fs::path(folder) / "model.ply").string();
  if (!fs::is_regular_file(out.model)) {
    return Status(StatusCode::kIoError, folder + " is no scan folder: it has no model.ply");
  }
  out.groups = numberedFiles(fs::path(folder) / "groups", "group");
  const Result<Trajectory> trajectory = readTum((fs::path(folder) / "trajectory.tum").string());
  if (!trajectory) {
    out.warnings.push_back("no table of views: " + trajectory.status().message());
    return out;
  }
  if (!trajectory->empty()) out.first_pose = trajectory->front();
  placeViews(folder, *trajectory, out);
  return out;
}

}  // namespace scanner::evaluation
