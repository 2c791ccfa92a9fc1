#include "scanner/pipeline/scan_folder.h"

#include <cstdio>
#include <filesystem>

#include "scanner/core/ply.h"
#include "scanner/core/trajectory_io.h"

namespace scanner::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSubfolders[] = {"views", "groups"};
constexpr const char* kPictures = "pictures";  // made with the first picture

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

std::string ScanFolder::numbered(const char* folder, const char* stem, int index,
                                 const std::string& end) {
  char name[64];
  std::snprintf(name, sizeof name, "%s/%s_%03d", folder, stem, index);
  const std::string file = (fs::path(path_) / name).string() + end;
  written_.insert(file);
  return file;
}

Status ScanFolder::writeView(const View& view) {
  return writePly(numbered("views", "view", view.index, ".ply"), view.cloud);
}

Status ScanFolder::writeGroup(int index, const PointCloud& cloud) {
  return writePly(numbered("groups", "group", index, ".ply"), cloud);
}

Status ScanFolder::writePicture(int index, const std::string& name, const std::string& jpeg) {
  const fs::path place = fs::path(path_) / kPictures;
  std::error_code error;
  fs::create_directories(place, error);
  if (error) {
    return Status(StatusCode::kIoError, "cannot make " + place.string() + ": " + error.message());
  }
  return writeFileAtomically(numbered(kPictures, "view", index, "_" + name + ".jpg"), jpeg);
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
  for (const char* subfolder : {"views", "groups", kPictures}) {
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(fs::path(path_) / subfolder, ignored)) {
      const fs::path extension = entry.path().extension();
      const bool ours = extension == ".ply" || extension == ".jpg";
      if (ours && written_.count(entry.path().string()) == 0) fs::remove(entry.path(), ignored);
    }
  }
  // What was found out about the model of the earlier scan does not hold for this one.
  for (const char* name : {"deviation.json", "deviation.ply", "deviation.png", "histogram.png"}) {
    std::error_code ignored;
    fs::remove(fs::path(path_) / name, ignored);
  }
}

}  // namespace scanner::pipeline
