#include "scanner/pipeline/scan_folder.h"

#include <cstdio>
#include <filesystem>

#include "scanner/core/ply.h"
#include "scanner/core/trajectory_io.h"

namespace scanner::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSubfolders[] = {"views", "groups"};

}  // namespace

ScanFolder::ScanFolder(const std::string& path) : path_(path) {
  for (const char* subfolder : kSubfolders) {
    std::error_code error;
    fs::create_directories(fs::path(path) / subfolder, error);
    if (error) throw ConfigurationError("cannot write to " + path + ": " + error.message());
  }
  const std::string probe = (fs::path(path) / ".writable").string();
  const Status status = writeFileAtomically(probe, "");
  if (!status) throw ConfigurationError("cannot write to " + path + ": " + status.message());
  fs::remove(probe);
}

std::string ScanFolder::numbered(const char* folder, const char* stem, int index) {
  char name[64];
  std::snprintf(name, sizeof name, "%s/%s_%03d.ply", folder, stem, index);
  const std::string file = (fs::path(path_) / name).string();
  written_.insert(file);
  return file;
}

Status ScanFolder::writeView(const View& view) {
  return writePly(numbered("views", "view", view.index), view.cloud);
}

Status ScanFolder::writeGroup(int index, const PointCloud& cloud) {
  return writePly(numbered("groups", "group", index), cloud);
}

Status ScanFolder::writeTrajectory(const Trajectory& trajectory) {
  return writeTum((fs::path(path_) / "trajectory.tum").string(), trajectory);
}

Status ScanFolder::writeCloud(const PointCloud& cloud) {
  return writePly((fs::path(path_) / "cloud.ply").string(), cloud);
}

Status ScanFolder::writeModel(const Mesh& mesh) {
  return writePly((fs::path(path_) / "model.ply").string(), mesh);
}

Status ScanFolder::writeText(const std::string& name, const std::string& text) {
  return writeFileAtomically((fs::path(path_) / name).string(), text);
}

void ScanFolder::removeLeftovers() const {
  for (const char* subfolder : kSubfolders) {
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(fs::path(path_) / subfolder, ignored)) {
      if (entry.path().extension() == ".ply" && written_.count(entry.path().string()) == 0) {
        fs::remove(entry.path(), ignored);
      }
    }
  }
}

}  // namespace scanner::pipeline
