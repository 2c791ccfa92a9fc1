#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "evaluation/deviation_pictures.h"
#include "evaluation/scan_files.h"
#include "scanner/core/ply.h"
#include "scanner/core/trajectory_io.h"
#include "scanner/evaluation/deviation_report.h"

namespace scanner::evaluation {
namespace {

namespace fs = std::filesystem;

/// The steps of an evaluation, counted for whoever watches.
class Steps {
 public:
  Steps(const EvaluationProgress& progress, std::size_t total)
      : progress_(progress), total_(total) {}
  void next(const std::string& what) {
    if (progress_) progress_(done_, total_, what);
    ++done_;
  }

 private:
  const EvaluationProgress& progress_;
  std::size_t total_;
  std::size_t done_ = 0;
};

void requireRequest(const EvaluationRequest& request) {
  if (request.threads < 1) throw ConfigurationError("evaluate: threads must be at least 1");
  if (!(request.range_m >= 0.0)) throw ConfigurationError("evaluate: the range is negative");
  std::error_code error;
  fs::create_directories(request.out, error);
  if (!fs::is_directory(request.out)) {
    throw ConfigurationError("cannot write to " + request.out + ": " +
                             (error ? error.message() : "not a folder"));
  }
}

Mesh readReference(const std::string& path) {
  Result<Mesh> mesh = readPly(path);
  if (!mesh) throw ConfigurationError(mesh.status().message());
  return *std::move(mesh);
}

SurfaceDistance surfaceOf(const Mesh& reference, const std::string& path) {
  try {
    return SurfaceDistance(reference);
  } catch (const ConfigurationError& error) {
    throw ConfigurationError(path + ": " + error.what());
  }
}

/// T_reference_map from the true pose of the first registered view.
Eigen::Isometry3d placedByFirstPose(const std::string& truth, const ScanFiles& files) {
  if (!files.first_pose) {
    throw ConfigurationError("a truth needs a scan folder with a trajectory.tum as the model");
  }
  const Result<Trajectory> poses = readTum(truth);
  if (!poses) throw ConfigurationError(poses.status().message());
  const Result<Eigen::Isometry3d> T_reference_base =
      poseAt(*poses, files.first_pose->stamp, fromSeconds(0.1));
  if (!T_reference_base) {
    throw ConfigurationError(truth +
                             ": no pose at the first view: " + T_reference_base.status().message());
  }
  return *T_reference_base * files.first_pose->T_map_base.inverse();
}

/// One of the tables 5.7 and 5.8; files that cannot be read become warnings.
DeviationTable tableOf(const std::vector<PlacedFile>& files, const SurfaceDistance& reference,
                       const Eigen::Isometry3d& T_reference_map, const EvaluationRequest& request,
                       Steps& steps, std::vector<std::string>& warnings) {
  DeviationTable table;
  std::vector<float> all;
  for (const PlacedFile& file : files) {
    steps.next(fs::path(file.path).filename().string());
    const Result<Mesh> cloud = readPly(file.path);
    if (!cloud) {
      warnings.push_back(cloud.status().message());
      continue;
    }
    const auto signed_m = signedDistances(cloud->vertices, reference,
                                          T_reference_map * file.T_map_cloud, request.threads);
    table.rows.push_back({file.index, deviationStatistics(signed_m, request.options.outlier_m)});
    all.insert(all.end(), signed_m.begin(), signed_m.end());
  }
  table.together = deviationStatistics(all, request.options.outlier_m);
  return table;
}

Status placeAndCompare(const EvaluationRequest& request, const Mesh& model, const Mesh& reference,
                       const SurfaceDistance& surface, const ScanFiles& files,
                       DeviationReport& report) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  if (!request.truth.empty()) {
    T = placedByFirstPose(request.truth, files);
    report.placement = Placement::kFirstPose;
  }
  if (request.align) {
    if (report.placement == Placement::kFirstPose) {
      auto placed = deviation(model, surface, reference, T, request.options, request.threads);
      if (!placed) return placed.status();
      report.first_pose = *std::move(placed);
    } else {
      const auto start =
          searchPlacement(model, surface, reference, T, request.options, request.threads);
      if (!start) return start.status();
      T = *start;
    }
    const auto fit = align(model, surface, reference, T, request.options, request.threads);
    if (!fit) return fit.status();
    T = *fit;
    report.placement = Placement::kBestFit;
  }
  auto compared = deviation(model, surface, reference, T, request.options, request.threads);
  if (!compared) return compared.status();
  report.deviation = *std::move(compared);
  report.range_m = request.range_m > 0.0 ? request.range_m : readableRange(report.deviation);
  return Status::ok();
}

Status writePicture(const fs::path& path, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  if (!cv::imencode(".png", image, bytes)) {
    return {StatusCode::kIoError, "cannot encode " + path.string()};
  }
  return writeFileAtomically(path.string(), std::string(bytes.begin(), bytes.end()));
}

/// Points of the model in the reference's frame with their deviation, m; what is not finite is left
/// out.
std::string pointLines(const PointCloud& points, const std::vector<float>& signed_m) {
  std::string out;
  std::array<char, 96> line{};
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!std::isfinite(signed_m[i])) continue;
    const Eigen::Vector3d p = points.points[i].cast<double>();
    const int length = std::snprintf(line.data(), line.size(), "%.9g %.9g %.9g %.9g\n", p.x(),
                                     p.y(), p.z(), static_cast<double>(signed_m[i]));
    out.append(line.data(), static_cast<std::size_t>(length));
  }
  return out;
}

Status writeFiles(const EvaluationRequest& request, const Mesh& model, const Mesh& reference,
                  const DeviationReport& report) {
  Mesh colored = colorCoded(model, report.deviation, report.range_m, request.options.outlier_m);
  colored.vertices = transformed(colored.vertices, report.deviation.alignment);
  const fs::path out(request.out);
  for (const Status& status :
       {writePly((out / "deviation.ply").string(), colored),
        writePicture(out / "deviation.png", drawDeviation(colored, reference, report)),
        writePicture(out / "histogram.png", drawHistogram(report)),
        writeFileAtomically((out / "deviation.json").string(), toJson(report))}) {
    if (!status) return status;
  }
  if (!request.per_point) return Status::ok();
  return writeFileAtomically((out / "deviation.asc").string(),
                             pointLines(colored.vertices, report.deviation.signed_m));
}

}  // namespace

Result<DeviationReport> evaluateModel(const EvaluationRequest& request,
                                      const EvaluationProgress& progress) {
  requireRequest(request);
  ScanFiles files;
  files.model = request.model;
  if (fs::is_directory(request.model)) {
    Result<ScanFiles> listed = listScanFiles(request.model);
    if (!listed) return listed.status();
    files = *std::move(listed);
  }
  Steps steps(progress, 3 + files.views.size() + files.groups.size());
  steps.next("reading");
  const Mesh reference = readReference(request.reference);
  const SurfaceDistance surface = surfaceOf(reference, request.reference);
  const Result<Mesh> model = readPly(files.model);
  if (!model) return model.status();
  DeviationReport report;
  report.model = fs::path(files.model).filename().string();
  report.reference = fs::path(request.reference).filename().string();
  report.options = request.options;
  report.warnings = files.warnings;
  steps.next(request.align ? "aligning" : "model");
  if (const Status status = placeAndCompare(request, *model, reference, surface, files, report);
      !status) {
    return Status(status.code(), files.model + ": " + status.message());
  }
  const Eigen::Isometry3d& T = report.deviation.alignment;
  report.views = tableOf(files.views, surface, T, request, steps, report.warnings);
  report.groups = tableOf(files.groups, surface, T, request, steps, report.warnings);
  steps.next("pictures");
  if (const Status status = writeFiles(request, *model, reference, report); !status) return status;
  steps.next("done");
  return report;
}

}  // namespace scanner::evaluation
