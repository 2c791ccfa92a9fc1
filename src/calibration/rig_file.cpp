#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "scanner/calibration/calibration_files.h"

namespace scanner::calibration {
namespace {

const char* const kPoseKey = "T_base_link_bumblebee_left_optical";

template <typename Matrix>
ParameterTree rowByRow(const Matrix& matrix) {
  ParameterTree list = ParameterTree::array();
  for (int r = 0; r < matrix.rows(); ++r) {
    for (int c = 0; c < matrix.cols(); ++c) list.push_back(matrix(r, c));
  }
  return list;
}

ParameterTree cameraTree(const CameraModel& camera) {
  ParameterTree tree;
  tree["size"] = {camera.width, camera.height};
  tree["distortion_model"] = camera.distortion_model;
  tree["K"] = rowByRow(camera.K);
  tree["D"] = camera.D;
  tree["R"] = rowByRow(camera.R);
  tree["P"] = rowByRow(camera.P);
  return tree;
}

std::string comment(const StereoCalibrationReport& report, bool pose_known) {
  char line[320];
  std::snprintf(line, sizeof line,
                "# calibrate_stereo: %zu views of a %dx%d board, residuals %.3f px, epipolar error "
                "%.3f px,\n# baseline %.2f mm, distortion %s.\n",
                report.usedViews(), report.board.columns, report.board.rows, report.rms_px,
                report.epipolar.mean_px, 1e3 * report.calibration.baseline(),
                toString(report.distortion));
  std::string text = line;
  if (!pose_known) {
    text += std::string("# ") + kPoseKey +
            " was not measured: base_link stands level at the left camera.\n";
  }
  return text;
}

}  // namespace

StereoCalibrationOptions loadCalibrationOptions(const std::string& path) {
  const ParameterTree tree = readYaml(path);
  StereoCalibrationOptions options;
  if (!tree.is_object()) throw ConfigurationError(path + ": not a configuration file");
  try {
    if (tree.contains("calibration")) loadOptions(tree["calibration"], "calibration", options);
  } catch (const ConfigurationError& error) {
    throw ConfigurationError(path + ": " + error.what());
  }
  return options;
}

void writeRig(const std::string& path, const StereoCalibrationReport& report,
              const std::string& existing) {
  ParameterTree tree = ParameterTree::object();
  if (!existing.empty()) {
    loadRig(existing);  // says what is wrong with it
    tree = readYaml(existing);
  } else {
    // x forward = the camera's z, y left = -x, z up = -y.
    tree[kPoseKey] = {{"translation", {0.0, 0.0, 0.0}}, {"rotation_xyzw", {-0.5, 0.5, -0.5, 0.5}}};
  }
  tree["left"] = cameraTree(report.calibration.left);
  tree["right"] = cameraTree(report.calibration.right);
  // Beside the target and then in its place: a full disk leaves the old file.
  const std::string beside = path + ".part";
  std::ofstream file(beside);
  file << comment(report, !existing.empty()) << toYaml(tree);
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(beside, path, error);
  if (!file || error) {
    std::filesystem::remove(beside, error);
    throw ConfigurationError("cannot write " + path);
  }
}

}  // namespace scanner::calibration
