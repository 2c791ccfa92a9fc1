// Files of the command register_scans.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "scanner/core/ply.h"
#include "scanner/core/trajectory_io.h"
#include "scanner/registration/normals.h"
#include "scanner/registration/scan_set.h"

namespace scanner::registration {
namespace {

namespace fs = std::filesystem;
constexpr double kPi = 3.14159265358979323846;
constexpr std::size_t kNormalNeighbours = 16;

Status lineError(const std::string& path, int line, const std::string& what) {
  return {StatusCode::kInvalidInput, path + ":" + std::to_string(line) + ": " + what};
}

Result<std::shared_ptr<const View>> readScan(const std::string& file, int index, int threads) {
  auto mesh = readPly(file);
  if (!mesh) return mesh.status();
  auto view = std::make_shared<View>();
  view->index = index;
  view->stamp = Time(fromSeconds(static_cast<double>(index)));
  view->cloud = std::move(mesh->vertices);
  if (!view->cloud.hasNormals()) {
    view->cloud = finitePoints(view->cloud, false);
    estimateNormalsTowards(view->cloud, kNormalNeighbours, Eigen::Vector3d::UnitZ(), threads);
  }
  view->cloud = finitePoints(view->cloud, true);
  return std::shared_ptr<const View>(std::move(view));
}

nlohmann::json poseJson(const Eigen::Isometry3d& T) {
  const Eigen::Quaterniond q(T.linear());
  return {{"translation_m", {T.translation().x(), T.translation().y(), T.translation().z()}},
          {"quaternion_xyzw", {q.x(), q.y(), q.z(), q.w()}}};
}

// Names of the written scans: the file's own, with a number when two folders hold the same name.
std::vector<std::string> outputNames(const std::vector<std::string>& files) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < files.size(); ++i) {
    std::string name = fs::path(files[i]).stem().string();
    if (std::find(names.begin(), names.end(), name) != names.end()) {
      name += "_" + std::to_string(i);
    }
    names.push_back(name);
  }
  return names;
}

Status writeOutputs(const RegisterScansArguments& arguments,
                    const std::vector<std::shared_ptr<const View>>& scans,
                    const ScanSetOutcome& outcome) {
  const fs::path out(arguments.out);
  const std::vector<std::string> names = outputNames(arguments.files);
  PointCloud merged;
  Trajectory trajectory;
  nlohmann::json report = nlohmann::json::array();
  bool colors = true;
  for (std::size_t i = 0; i < scans.size(); ++i) {
    if (outcome.scans[i].registered) colors = colors && scans[i]->cloud.hasColors();
  }
  for (std::size_t i = 0; i < scans.size(); ++i) {
    const ScanOutcome& scan = outcome.scans[i];
    nlohmann::json entry = {{"file", arguments.files[i]},
                            {"registered", scan.registered},
                            {"reason", scan.reason},
                            {"verified_pairs", scan.edges},
                            {"mean_distance_m", scan.mean_distance_m},
                            {"T_map_scan", poseJson(scan.T_map_scan)}};
    report.push_back(entry);
    if (!scan.registered) continue;
    const PointCloud placed = transformed(scans[i]->cloud, scan.T_map_scan);
    const Status written = writePly((out / "scans" / (names[i] + ".ply")).string(), placed);
    if (!written) return written;
    PointCloud plain;
    plain.points = placed.points;
    plain.normals = placed.normals;
    if (colors) plain.colors = placed.colors;
    merged.append(plain);
    trajectory.push_back({Time(fromSeconds(static_cast<double>(i))), scan.T_map_scan});
  }
  Status written = writePly((out / "cloud.ply").string(), merged);
  if (written) written = writeTum((out / "poses.tum").string(), trajectory);
  if (written) {
    written = writeFileAtomically((out / "poses.json").string(), report.dump(2) + "\n");
  }
  return written;
}

std::string summaryLine(const ScanSetOutcome& outcome, const std::string& out) {
  std::size_t registered = 0;
  std::string lost;
  for (std::size_t i = 0; i < outcome.scans.size(); ++i) {
    registered += outcome.scans[i].registered ? 1 : 0;
    if (!outcome.scans[i].registered) {
      lost += "; scan " + std::to_string(i) + ": " + outcome.scans[i].reason;
    }
  }
  std::ostringstream text;
  text << registered << " of " << outcome.scans.size() << " scans registered, " << outcome.edges
       << " verified pairs, " << std::fixed << std::setprecision(3)
       << outcome.refinement.final_rms_m * 1e3 << " mm rms to the surface, written to " << out
       << lost;
  return text.str();
}

}  // namespace

Result<NamedPoses> readStanfordConf(const std::string& path) {
  std::ifstream file(path);
  if (!file) return Status(StatusCode::kIoError, path + ": cannot be read");
  NamedPoses poses;
  std::string text;
  for (int line = 1; std::getline(file, text); ++line) {
    std::istringstream fields(text);
    std::string keyword;
    std::string name;
    if (!(fields >> keyword) || keyword != "bmesh") continue;
    double v[7];
    if (!(fields >> name)) return lineError(path, line, "a bmesh without a file name");
    for (double& value : v) {
      if (!(fields >> value) || !std::isfinite(value)) {
        return lineError(path, line, "a bmesh needs seven finite numbers after the name");
      }
    }
    const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
    if (std::abs(q.norm() - 1.0) > 1e-2) return lineError(path, line, "no unit quaternion");
    // The file's quaternion turns the other way round: p_ref = R(q)^T p + t.
    poses[fs::path(name).filename().string()] =
        makePose(Eigen::Vector3d(v[0], v[1], v[2]), q.normalized().conjugate());
  }
  if (poses.empty()) return Status(StatusCode::kInvalidInput, path + ": holds no bmesh line");
  return poses;
}

Result<std::vector<Eigen::Isometry3d>> readPriors(const std::string& path,
                                                  const std::vector<std::string>& files) {
  std::vector<Eigen::Isometry3d> poses;
  if (fs::path(path).extension() == ".conf") {
    const auto named = readStanfordConf(path);
    if (!named) return named.status();
    for (const std::string& file : files) {
      const auto found = named->find(fs::path(file).filename().string());
      if (found == named->end()) {
        return Status(StatusCode::kInvalidInput,
                      std::string(path).append(": holds no pose for ").append(file));
      }
      poses.push_back(found->second);
    }
    return poses;
  }
  const auto trajectory = readTum(path);
  if (!trajectory) return trajectory.status();
  if (trajectory->size() != files.size()) {
    return Status(StatusCode::kInvalidInput,
                  path + ": holds " + std::to_string(trajectory->size()) + " poses for " +
                      std::to_string(files.size()) + " files");
  }
  for (const StampedPose& pose : *trajectory) poses.push_back(pose.T_map_base);
  return poses;
}

Result<std::string> runRegisterScans(const RegisterScansArguments& arguments) {
  RegistrationOptions options = scanSetOptions();
  if (!arguments.config.empty()) {
    const ParameterTree tree = readYaml(arguments.config);
    if (!tree.is_object() || !tree.contains("registration")) {
      throw ConfigurationError(arguments.config + ": has no block `registration`");
    }
    loadOptions(tree.at("registration"), "registration", options);
  }
  auto priors = readPriors(arguments.prior, arguments.files);
  if (!priors) return priors.status();
  std::vector<std::shared_ptr<const View>> scans;
  for (std::size_t i = 0; i < arguments.files.size(); ++i) {
    auto scan = readScan(arguments.files[i], static_cast<int>(i), arguments.threads);
    if (!scan) return scan.status();
    scans.push_back(*scan);
  }
  std::error_code error;
  fs::create_directories(fs::path(arguments.out) / "scans", error);
  if (error) {
    return Status(StatusCode::kIoError, arguments.out + ": cannot be created: " + error.message());
  }
  const auto initial = disturbed(*priors, arguments.disturb_deg * kPi / 180.0,
                                 arguments.disturb_mm * 1e-3, arguments.seed);
  const auto outcome = registerScans(scans, initial, options, arguments.threads, arguments.seed);
  if (!outcome) return outcome.status();
  const Status written = writeOutputs(arguments, scans, *outcome);
  if (!written) return written;
  return summaryLine(*outcome, arguments.out);
}

}  // namespace scanner::registration
