#include "ros/euroc_folder.h"

#include <yaml-cpp/yaml.h>

#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>

namespace scanner::bridge {
namespace {

namespace fs = std::filesystem;

Status bad(const fs::path& file, const std::string& what) {
  return Status(StatusCode::kInvalidInput, file.string() + ": " + what);
}

/// The files start with OpenCV's `%YAML:1.0`, which is no valid YAML directive.
Result<YAML::Node> readSensor(const fs::path& file) {
  std::ifstream in(file);
  if (!in) return Status(StatusCode::kIoError, file.string() + ": cannot be read");
  std::string text, line;
  while (std::getline(in, line)) text += (line.rfind("%YAML", 0) == 0 ? "" : line) + '\n';
  try {
    return YAML::Load(text);
  } catch (const YAML::Exception& e) {
    return bad(file, e.what());
  }
}

Result<std::vector<double>> numbers(const YAML::Node& node, const std::string& key,
                                    std::size_t count, const fs::path& file) {
  try {
    const auto values = node.as<std::vector<double>>();
    bool finite = true;
    for (const double v : values) finite = finite && std::isfinite(v);
    if (values.size() == count && finite) return values;
    return bad(file, key + " needs " + std::to_string(count) + " finite numbers, has " +
                         std::to_string(values.size()));
  } catch (const YAML::Exception&) {
    return bad(file, key + " is missing or not a list of numbers");
  }
}

Result<Eigen::Isometry3d> extrinsics(const YAML::Node& sensor, const fs::path& file) {
  const YAML::Node data = sensor["T_BS"] ? sensor["T_BS"]["data"] : YAML::Node();
  Result<std::vector<double>> values = numbers(data, "T_BS.data", 16, file);
  if (!values) return values.status();
  const Eigen::Matrix4d m =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values->data());
  const Eigen::Matrix3d R = m.topLeftCorner<3, 3>();
  const Eigen::Matrix3d rotation = nearestRotation(R);
  constexpr double kRotationTolerance = 1e-3;
  if (!((R - rotation).norm() < kRotationTolerance)) return bad(file, "T_BS is not a rotation");
  return makePose(m.topRightCorner<3, 1>(), Eigen::Quaterniond(rotation));
}

/// Calls `take` with the fields of each line; '#' starts a comment.
Status readCsv(const fs::path& file, std::size_t min_fields,
               const std::function<Status(const std::vector<std::string>&)>& take) {
  std::ifstream in(file);
  if (!in) return Status(StatusCode::kIoError, file.string() + ": cannot be read");
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line[0] == '#') continue;
    std::vector<std::string> fields;
    std::istringstream split(line);
    for (std::string field; std::getline(split, field, ',');) fields.push_back(field);
    const std::string where = file.string() + ":" + std::to_string(number) + ": ";
    if (fields.size() < min_fields) {
      return Status(StatusCode::kInvalidInput, where + "needs " + std::to_string(min_fields) +
                                                   " fields, has " + std::to_string(fields.size()));
    }
    if (Status status = take(fields); !status)
      return Status(status.code(), where + status.message());
  }
  return Status::ok();
}

/// A stamp in nanoseconds, after the previous one.
Result<Time> stampAfter(const std::string& field, const std::optional<Time>& previous) {
  std::int64_t ns = 0;
  const auto end = field.data() + field.size();
  const auto parsed = std::from_chars(field.data(), end, ns);
  if (parsed.ec != std::errc() || parsed.ptr != end || ns < 0) {
    return Status(StatusCode::kInvalidInput, "'" + field + "' is no time in nanoseconds");
  }
  const Time stamp = fromNanoseconds(ns);
  if (previous && stamp <= *previous) {
    return Status(StatusCode::kInvalidInput, "time " + field + " is not after the line before");
  }
  return stamp;
}

/// fields[1..count] as finite numbers.
Result<std::vector<double>> values(const std::vector<std::string>& fields, std::size_t count) {
  std::vector<double> out;
  for (std::size_t i = 1; i <= count; ++i) {
    std::size_t used = 0;
    double value = std::nan("");
    try {
      value = std::stod(fields[i], &used);
    } catch (const std::exception&) {
      used = 0;
    }
    if (used == 0 || !std::isfinite(value)) {
      return Status(StatusCode::kInvalidInput, "'" + fields[i] + "' is not a finite number");
    }
    out.push_back(value);
  }
  return out;
}

Status readIntrinsics(const YAML::Node& sensor, const fs::path& file, CameraModel& model) {
  const std::string camera = sensor["camera_model"].as<std::string>("");
  const std::string distortion = sensor["distortion_model"].as<std::string>("");
  if (camera != "pinhole") return bad(file, "camera_model '" + camera + "' is not handled");
  if (distortion != "radial-tangential") {
    return bad(file, "distortion_model '" + distortion + "' is not handled");
  }
  Result<std::vector<double>> size = numbers(sensor["resolution"], "resolution", 2, file);
  Result<std::vector<double>> K = numbers(sensor["intrinsics"], "intrinsics", 4, file);
  Result<std::vector<double>> D =
      numbers(sensor["distortion_coefficients"], "distortion_coefficients", 4, file);
  for (const Status& status : {size.status(), K.status(), D.status()}) {
    if (!status) return status;
  }
  model.width = static_cast<int>((*size)[0]);
  model.height = static_cast<int>((*size)[1]);
  model.distortion_model = "plumb_bob";
  model.D = *D;
  model.D.push_back(0.0);
  model.K << (*K)[0], 0.0, (*K)[2], 0.0, (*K)[1], (*K)[3], 0.0, 0.0, 1.0;
  return Status::ok();
}

Status readCamera(const fs::path& folder, EurocCamera& camera) {
  const fs::path file = folder / "sensor.yaml";
  Result<YAML::Node> sensor = readSensor(file);
  if (!sensor) return sensor.status();
  if (Status status = readIntrinsics(*sensor, file, camera.model); !status) return status;
  Result<Eigen::Isometry3d> T = extrinsics(*sensor, file);
  if (!T) return T.status();
  camera.T_body_camera = *T;
  std::optional<Time> previous;
  return readCsv(folder / "data.csv", 2, [&](const std::vector<std::string>& fields) {
    Result<Time> stamp = stampAfter(fields[0], previous);
    if (!stamp) return stamp.status();
    previous = *stamp;
    camera.images.emplace_back(*stamp, (folder / "data" / fields[1]).string());
    return Status::ok();
  });
}

Status readImu(const fs::path& folder, EurocFolder& euroc) {
  Result<YAML::Node> sensor = readSensor(folder / "sensor.yaml");
  if (!sensor) return sensor.status();
  Result<Eigen::Isometry3d> T = extrinsics(*sensor, folder / "sensor.yaml");
  if (!T) return T.status();
  euroc.T_body_imu = *T;
  return readCsv(folder / "data.csv", 7, [&](const std::vector<std::string>& fields) {
    std::optional<Time> previous;
    if (!euroc.samples.empty()) previous = euroc.samples.back().stamp;
    Result<Time> stamp = stampAfter(fields[0], previous);
    if (!stamp) return stamp.status();
    Result<std::vector<double>> v = values(fields, 6);
    if (!v) return v.status();
    ImuSample sample;
    sample.stamp = *stamp;
    sample.angular_velocity = {(*v)[0], (*v)[1], (*v)[2]};
    sample.linear_acceleration = {(*v)[3], (*v)[4], (*v)[5]};
    euroc.samples.push_back(sample);
    return Status::ok();
  });
}

Status readTruth(const fs::path& folder, EurocFolder& euroc) {
  if (!fs::exists(folder)) return Status::ok();
  Result<YAML::Node> sensor = readSensor(folder / "sensor.yaml");
  if (!sensor) return sensor.status();
  Result<Eigen::Isometry3d> T_body_truth = extrinsics(*sensor, folder / "sensor.yaml");
  if (!T_body_truth) return T_body_truth.status();
  const Eigen::Isometry3d T_truth_imu = T_body_truth->inverse() * euroc.T_body_imu;
  return readCsv(folder / "data.csv", 8, [&](const std::vector<std::string>& fields) {
    std::optional<Time> previous;
    if (!euroc.truth.empty()) previous = euroc.truth.back().stamp;
    Result<Time> stamp = stampAfter(fields[0], previous);
    if (!stamp) return stamp.status();
    Result<std::vector<double>> v = values(fields, 7);
    if (!v) return v.status();
    const Eigen::Quaterniond q((*v)[3], (*v)[4], (*v)[5], (*v)[6]);  // w first in the file
    constexpr double kUnitTolerance = 0.01;
    if (std::abs(q.norm() - 1.0) > kUnitTolerance) {
      return Status(StatusCode::kInvalidInput, "the quaternion is not of unit length");
    }
    const Eigen::Isometry3d T_world_truth = makePose({(*v)[0], (*v)[1], (*v)[2]}, q.normalized());
    euroc.truth.push_back({*stamp, T_world_truth * T_truth_imu});
    return Status::ok();
  });
}

}  // namespace

Result<EurocFolder> readEuroc(const std::string& directory) {
  fs::path root(directory);
  if (fs::exists(root / "mav0")) root /= "mav0";
  if (!fs::is_directory(root / "cam0") || !fs::is_directory(root / "cam1") ||
      !fs::is_directory(root / "imu0")) {
    return Status(StatusCode::kIoError,
                  directory + ": not an ASL folder (cam0, cam1 and imu0 are needed)");
  }
  EurocFolder euroc;
  for (const Status& status :
       {readCamera(root / "cam0", euroc.left), readCamera(root / "cam1", euroc.right),
        readImu(root / "imu0", euroc), readTruth(root / "state_groundtruth_estimate0", euroc)}) {
    if (!status) return status;
  }
  return euroc;
}

}  // namespace scanner::bridge
