#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/node_handle.h>

#include <functional>
#include <string>

namespace scanner::bridge {

/// One diagnostic status, published every second of wall time: simulated time stops with the
/// player.
class Diagnostics {
 public:
  using Task = std::function<void(diagnostic_updater::DiagnosticStatusWrapper&)>;

  Diagnostics(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, const std::string& name,
              const Task& task)
      : updater_(nh, private_nh) {
    updater_.setHardwareID("scanner");
    updater_.add(name, task);
    timer_ = nh.createWallTimer(ros::WallDuration(1.0),
                                [this](const ros::WallTimerEvent&) { updater_.force_update(); });
  }

 private:
  diagnostic_updater::Updater updater_;
  ros::WallTimer timer_;
};

using DiagnosticStatus = diagnostic_updater::DiagnosticStatusWrapper;
inline constexpr unsigned char kDiagnosticOk = diagnostic_msgs::DiagnosticStatus::OK;
inline constexpr unsigned char kDiagnosticWarn = diagnostic_msgs::DiagnosticStatus::WARN;
inline constexpr unsigned char kDiagnosticError = diagnostic_msgs::DiagnosticStatus::ERROR;

}  // namespace scanner::bridge
