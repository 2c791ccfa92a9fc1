#include "ros/device_bring_up.h"

#include <ros/init.h>
#include <ros/service.h>
#include <sensor_msgs/SetCameraInfo.h>
#include <std_srvs/Trigger.h>

#include <string>

#include "scanner/ros/conversions.h"

namespace scanner::bridge {
namespace {

const ros::WallDuration kPoll(0.1);

/// kOutOfRange while the driver does not offer the service yet.
Status setCameraInfo(const ros::NodeHandle& nh, const std::string& eye, const CameraModel& camera) {
  const std::string name = nh.resolveName("bumblebee/" + eye + "/set_camera_info");
  if (!ros::service::exists(name, false)) {
    return Status(StatusCode::kOutOfRange, "no service " + name);
  }
  sensor_msgs::SetCameraInfo request;
  request.request.camera_info = toRos(camera, makeHeader(Time(), "bumblebee_" + eye + "_optical"));
  if (!ros::service::call(name, request)) {
    return Status(StatusCode::kIoError, name + " gave no answer");
  }
  if (request.response.success) return Status::ok();
  return Status(StatusCode::kIoError, name + ": " + request.response.status_message);
}

Status startScan(const ros::NodeHandle& nh) {
  const std::string name = nh.resolveName("registration_node/start");
  std_srvs::Trigger trigger;
  if (!ros::service::call(name, trigger)) {
    return Status(StatusCode::kIoError, name + " gave no answer");
  }
  if (trigger.response.success) return Status::ok();
  return Status(StatusCode::kIoError, name + ": " + trigger.response.message);
}

}  // namespace

Status bringUp(const ros::NodeHandle& nh, const StereoCalibration& calibration, bool start_scan,
               double patience_s, SimulatedDevices& devices) {
  const ros::WallTime begin = ros::WallTime::now();
  bool calibrated = false;
  while (!calibrated || !devices.settled()) {
    if (!ros::ok()) return Status(StatusCode::kIoError, "interrupted");
    if (patience_s > 0.0 && (ros::WallTime::now() - begin).toSec() > patience_s) {
      return Status(StatusCode::kNotEnoughData,
                    calibrated ? "the drivers did not read both devices"
                               : "the camera's driver did not offer set_camera_info");
    }
    if (!calibrated) {
      Status given = setCameraInfo(nh, "left", calibration.left);
      if (given) given = setCameraInfo(nh, "right", calibration.right);
      if (!given && given.code() != StatusCode::kOutOfRange) return given;
      calibrated = given.isOk();
    }
    // Drivers that know their calibration already need no service; without a scan to finish, nobody
    // waits for one.
    if (patience_s == 0.0 && devices.settled()) break;
    kPoll.sleep();
  }
  if (start_scan) {
    if (Status started = startScan(nh); !started) return started;
  }
  devices.allowMotion();
  return Status::ok();
}

}  // namespace scanner::bridge
