#include "scanner/core/camera.h"

#include <Eigen/LU>
#include <cmath>
#include <nlohmann/json.hpp>

#include "scanner/core/options.h"
#include "scanner/core/se3.h"

namespace scanner {
namespace {

constexpr double kRotationTolerance = 1e-3;
// Numbers in a rig file are written with at least this many digits.
constexpr double kFocalTolerancePx = 1e-3;

Status invalid(const std::string& message) { return {StatusCode::kInvalidInput, message}; }

Status validateOne(const CameraModel& camera, const std::string& side) {
  const auto number = [](double v) { return std::to_string(v); };
  if (camera.width <= 0 || camera.height <= 0) {
    return invalid(side + " camera: size is " + std::to_string(camera.width) + "x" +
                   std::to_string(camera.height));
  }
  if (!camera.K.allFinite() || !camera.R.allFinite() || !camera.P.allFinite()) {
    return invalid(side + " camera: K, R or P holds a NaN or an infinity");
  }
  for (const double d : camera.D) {
    if (!std::isfinite(d)) return invalid(side + " camera: D holds a NaN or an infinity");
  }
  if (camera.K(0, 0) <= 0.0 || camera.K(1, 1) <= 0.0) {
    return invalid(side + " camera: focal length K[0] = " + number(camera.K(0, 0)) +
                   ", K[4] = " + number(camera.K(1, 1)) + " must be positive (is it calibrated?)");
  }
  if (camera.P(0, 0) <= 0.0 || camera.P(1, 1) <= 0.0) {
    return invalid(side + " camera: focal length P[0] = " + number(camera.P(0, 0)) +
                   " must be positive (is it calibrated?)");
  }
  const double off = (camera.R * camera.R.transpose() - Eigen::Matrix3d::Identity()).norm();
  if (off > kRotationTolerance || camera.R.determinant() < 0.0) {
    return invalid(side + " camera: R is not a rotation (off by " + number(off) + ")");
  }
  return Status::ok();
}

std::vector<double> numbers(const ParameterTree& tree, const std::string& key, std::size_t count) {
  const auto found = tree.find(key);
  if (found == tree.end()) throw ConfigurationError("key '" + key + "' is missing");
  std::vector<double> values;
  if (found->is_array()) {
    for (const ParameterTree& item : *found) {
      if (!item.is_number()) throw ConfigurationError("key '" + key + "' must hold numbers");
      values.push_back(item.get<double>());
    }
  }
  if (values.size() != count && count != 0) {
    throw ConfigurationError("key '" + key + "' must hold " + std::to_string(count) + " numbers");
  }
  return values;
}

CameraModel loadCamera(const ParameterTree& tree) {
  CameraModel camera;
  const std::vector<double> size = numbers(tree, "size", 2);
  camera.width = static_cast<int>(size[0]);
  camera.height = static_cast<int>(size[1]);
  camera.D = numbers(tree, "D", 0);
  camera.distortion_model = tree.value("distortion_model", std::string("plumb_bob"));
  using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  using RowMajor34 = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;
  camera.K = Eigen::Map<const RowMajor3>(numbers(tree, "K", 9).data());
  camera.R = Eigen::Map<const RowMajor3>(numbers(tree, "R", 9).data());
  camera.P = Eigen::Map<const RowMajor34>(numbers(tree, "P", 12).data());
  return camera;
}

}  // namespace

Status validate(const StereoCalibration& c) {
  for (const auto& [camera, side] :
       {std::pair<const CameraModel&, std::string>(c.left, "left"),
        std::pair<const CameraModel&, std::string>(c.right, "right")}) {
    const Status status = validateOne(camera, side);
    if (!status) return status;
  }
  if (c.left.width != c.right.width || c.left.height != c.right.height) {
    return invalid("left and right camera differ in size");
  }
  if (std::abs(c.left.P(0, 0) - c.right.P(0, 0)) > kFocalTolerancePx) {
    return invalid("left and right P[0] differ: " + std::to_string(c.left.P(0, 0)) + " and " +
                   std::to_string(c.right.P(0, 0)));
  }
  if (!(c.right.P(0, 3) < 0.0)) {
    return invalid("right camera: P[3] = " + std::to_string(c.right.P(0, 3)) +
                   " must be negative (-focal length x baseline); 0 means a monocular calibration, "
                   "a positive value swapped cameras");
  }
  return Status::ok();
}

Eigen::Isometry3d Rig::rectifiedCameraPose(const StereoCalibration& calibration) const {
  Eigen::Isometry3d T_camera_rectified = Eigen::Isometry3d::Identity();
  T_camera_rectified.linear() = nearestRotation(calibration.left.R).transpose();
  return T_base_camera * T_camera_rectified;
}

Rig loadRig(const std::string& path) {
  const ParameterTree tree = readYaml(path);
  try {
    if (!tree.is_object()) throw ConfigurationError("not a rig file");
    const char* const key = "T_base_link_bumblebee_left_optical";
    const auto pose = tree.find(key);
    if (pose == tree.end()) throw ConfigurationError(std::string("key '") + key + "' is missing");
    const std::vector<double> t = numbers(*pose, "translation", 3);
    const std::vector<double> q = numbers(*pose, "rotation_xyzw", 4);
    const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
    if (std::abs(rotation.norm() - 1.0) > kRotationTolerance) {
      throw ConfigurationError(std::string("key '") + key +
                               ".rotation_xyzw' is not a unit quaternion");
    }
    Rig rig;
    rig.T_base_camera = makePose({t[0], t[1], t[2]}, rotation);
    if (tree.contains("left") && tree.contains("right")) {
      rig.cameras = StereoCalibration{loadCamera(tree["left"]), loadCamera(tree["right"])};
      const Status status = validate(*rig.cameras);
      if (!status) throw ConfigurationError(status.message());
    }
    return rig;
  } catch (const ConfigurationError& error) {
    throw ConfigurationError(path + ": " + error.what());
  }
}

}  // namespace scanner
