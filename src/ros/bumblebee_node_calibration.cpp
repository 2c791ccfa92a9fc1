#include "ros/bumblebee_node_calibration.h"

#include <ros/console.h>

#include <cctype>

#include "ros/recording_writer.h"
#include "scanner/core/se3.h"
#include "scanner/ros/conversions.h"

namespace scanner::bridge {
namespace {

constexpr const char* kNamePrefix = "bumblebee";

/// camera_info_manager takes letters, digits and '_' only.
std::string cameraName(const std::string& serial, const std::string& eye) {
  std::string name = kNamePrefix;
  if (!serial.empty()) name += "_" + serial;
  name += "_" + eye;
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  return name;
}

bool sameCalibration(const sensor_msgs::CameraInfo& a, const sensor_msgs::CameraInfo& b) {
  return a.width == b.width && a.height == b.height && a.D == b.D && a.K == b.K && a.R == b.R &&
         a.P == b.P && a.distortion_model == b.distortion_model && a.binning_x == b.binning_x &&
         a.binning_y == b.binning_y && a.roi == b.roi;
}

std::string size(std::uint32_t width, std::uint32_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

Status fits(const sensor_msgs::CameraInfo& info, const std::string& eye, int width_px,
            int height_px) {
  const auto width = static_cast<std::uint32_t>(width_px);
  const auto height = static_cast<std::uint32_t>(height_px);
  if (info.width == width && info.height == height) return Status::ok();
  return Status(StatusCode::kInvalidInput, "the " + eye +
                                               " camera's calibration is for images of " +
                                               size(info.width, info.height) +
                                               ", but the camera sends " + size(width, height));
}

/// kNotEnoughData when an eye is not calibrated.
Result<StereoCalibration> usable(const BumblebeeCalibration::Infos& infos, int width_px,
                                 int height_px) {
  const std::pair<const sensor_msgs::CameraInfo&, const char*> eyes[] = {{infos.first, "left"},
                                                                         {infos.second, "right"}};
  for (const auto& [info, eye] : eyes) {
    if (info.K[0] != 0.0) continue;
    return Status(StatusCode::kNotEnoughData,
                  "the " + std::string(eye) + " camera is not calibrated");
  }
  CameraModel models[2];
  for (int i = 0; i < 2; ++i) {
    const auto& [info, eye] = eyes[i];
    if (Status status = fits(info, eye, width_px, height_px); !status) return status;
    Result<CameraModel> model = fromRos(info);
    if (!model) return Status(model.status().code(), eye + (" " + model.status().message()));
    models[i] = *std::move(model);
  }
  const StereoCalibration calibration{models[0], models[1]};
  if (Status status = validate(calibration); !status) return status;
  return calibration;
}

void requireUrl(const std::string& key, const std::string& url) {
  const auto begins = [&url](const std::string& with) { return url.rfind(with, 0) == 0; };
  if (url.empty() || begins("file:///") || begins("file://${") || begins("package://")) return;
  throw ConfigurationError("option '" + key + "' = '" + url +
                           "' is no url that camera_info_manager takes (file:///..., "
                           "package://PACKAGE/...)");
}

}  // namespace

Eigen::Isometry3d rightInLeft(const StereoCalibration& calibration) {
  // Both rectified frames are parallel, the right one's origin a baseline along x.
  Eigen::Isometry3d T_left_rectified = Eigen::Isometry3d::Identity();
  T_left_rectified.linear() = nearestRotation(calibration.left.R).transpose();
  Eigen::Isometry3d T_rectified_right = Eigen::Isometry3d::Identity();
  T_rectified_right.linear() = nearestRotation(calibration.right.R);
  T_rectified_right.translation().x() = calibration.baseline();
  return T_left_rectified * T_rectified_right;
}

BumblebeeCalibration::BumblebeeCalibration(const ros::NodeHandle& nh,
                                           const BumblebeeNodeOptions& options)
    : nh_(nh), options_(options) {
  requireUrl("left_camera_info_url", options.left_camera_info_url);
  requireUrl("right_camera_info_url", options.right_camera_info_url);
  if (!options.rig.empty()) rig_ = loadRig(options.rig).cameras;
}

void BumblebeeCalibration::useCamera(const std::string& serial) {
  using camera_info_manager::CameraInfoManager;
  const std::lock_guard<std::mutex> lock(mutex_);
  if (left_ && serial == serial_) return;  // it came back
  serial_ = serial;
  judged_.reset();
  verdict_ = {};
  const std::string left = cameraName(serial, "left"), right = cameraName(serial, "right");
  if (left_) {
    left_->setCameraName(left);
    right_->setCameraName(right);
  } else {
    left_ = std::make_unique<CameraInfoManager>(ros::NodeHandle(nh_, "bumblebee/left"), left,
                                                options_.left_camera_info_url);
    right_ = std::make_unique<CameraInfoManager>(ros::NodeHandle(nh_, "bumblebee/right"), right,
                                                 options_.right_camera_info_url);
  }
  if (!rig_) return;
  left_->setCameraInfo(toRos(rig_->left, {}));
  right_->setCameraInfo(toRos(rig_->right, {}));
}

std::optional<BumblebeeCalibration::Infos> BumblebeeCalibration::infos(int width_px, int height_px,
                                                                       Time stamp) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!left_) return std::nullopt;
  Infos now(left_->getCameraInfo(), right_->getCameraInfo());
  const bool known = judged_ && width_px == judged_width_px_ && height_px == judged_height_px_ &&
                     sameCalibration(now.first, judged_->first) &&
                     sameCalibration(now.second, judged_->second);
  if (!known) judge(now, width_px, height_px, stamp);
  if (verdict_.state != State::kGood) return std::nullopt;
  return now;
}

void BumblebeeCalibration::judge(const Infos& infos, int width_px, int height_px, Time stamp) {
  const bool replaced = judged_ && !(sameCalibration(infos.first, judged_->first) &&
                                     sameCalibration(infos.second, judged_->second));
  if (rig_ && replaced) {
    ROS_WARN("the calibration was set while running; at the next start the one of %s holds again",
             options_.rig.c_str());
  }
  judged_ = infos;
  judged_width_px_ = width_px;
  judged_height_px_ = height_px;
  const Result<StereoCalibration> calibration = usable(infos, width_px, height_px);
  if (calibration) {
    verdict_ = {State::kGood, ""};
    const Eigen::Isometry3d T_left_right = rightInLeft(*calibration);
    static_tf_->send({toRos(T_left_right, stamp, Topics().camera_frame, kRightCameraFrame)});
    ROS_INFO("calibration: baseline %.4f m, focal length %.1f px", calibration->baseline(),
             calibration->focalLength());
    return;
  }
  const std::string& why = calibration.status().message();
  if (calibration.status().code() == StatusCode::kNotEnoughData) {
    verdict_ = {State::kUncalibrated, why};
    ROS_WARN("%s: images only, no camera_info", why.c_str());
  } else {
    verdict_ = {State::kRefused, why};
    ROS_ERROR("calibration refused, no camera_info is published: %s", why.c_str());
  }
}

BumblebeeCalibration::Verdict BumblebeeCalibration::verdict() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return verdict_;
}

}  // namespace scanner::bridge
