#include "scanner/ros/odometry_buffer.h"

#include <algorithm>
#include <cmath>

#include "scanner/core/se3.h"
#include "scanner/ros/conversions.h"

namespace scanner::bridge {

nav_msgs::Odometry toRos(const inertial::OdometryState& state,
                         const Eigen::Vector3d& angular_velocity, const std::string& frame_id,
                         const std::string& child_frame_id) {
  nav_msgs::Odometry message;
  message.header = makeHeader(state.stamp, frame_id);
  message.child_frame_id = child_frame_id;
  message.pose =
      withCovariance(state.T_odom_base, state.position_sigma_m, state.rotation_sigma_rad);
  const Eigen::Vector3d v = state.T_odom_base.linear().transpose() * state.velocity;
  message.twist.twist.linear.x = v.x();
  message.twist.twist.linear.y = v.y();
  message.twist.twist.linear.z = v.z();
  message.twist.twist.angular.x = angular_velocity.x();
  message.twist.twist.angular.y = angular_velocity.y();
  message.twist.twist.angular.z = angular_velocity.z();
  return message;
}

Result<inertial::OdometryState> fromRos(const nav_msgs::Odometry& message) {
  Result<Eigen::Isometry3d> T = fromRos(message.pose.pose);
  if (!T) return T.status();
  const auto& v = message.twist.twist.linear;
  inertial::OdometryState state;
  state.stamp = fromRos(message.header.stamp);
  state.T_odom_base = *T;
  state.velocity = T->linear() * Eigen::Vector3d(v.x, v.y, v.z);
  if (!state.velocity.allFinite()) {
    return Status(StatusCode::kInvalidInput, "odometry: the velocity is not finite");
  }
  state.position_sigma_m = std::sqrt(std::max(0.0, message.pose.covariance[0]));
  state.rotation_sigma_rad = std::sqrt(std::max(0.0, message.pose.covariance[21]));
  return state;
}

bool OdometryBuffer::add(inertial::OdometryState state) {
  if (!states_.empty()) {
    if (state.stamp <= states_.back().stamp) return false;
    if (state.stamp - states_.back().stamp > max_gap_) ++segment_;
  }
  state.segment = segment_;
  states_.push_back(state);
  return true;
}

Result<inertial::OdometryState> OdometryBuffer::at(Time stamp) const {
  if (states_.empty() || states_.back().stamp < stamp) {
    return Status(StatusCode::kNotEnoughData, "odometry has not reached the frame yet");
  }
  const auto after =
      std::lower_bound(states_.begin(), states_.end(), stamp,
                       [](const inertial::OdometryState& s, Time t) { return s.stamp < t; });
  if (after->stamp == stamp) return *after;
  if (after == states_.begin()) {
    return Status(StatusCode::kOutOfRange, "the frame is older than the odometry");
  }
  const auto before = std::prev(after);
  if (before->segment != after->segment) {
    return Status(StatusCode::kOutOfRange, "the frame lies in a gap of the odometry");
  }
  const double s = toSeconds(stamp - before->stamp) / toSeconds(after->stamp - before->stamp);
  inertial::OdometryState state = *before;
  state.stamp = stamp;
  state.T_odom_base = interpolate(before->T_odom_base, after->T_odom_base, s);
  state.velocity = (1.0 - s) * before->velocity + s * after->velocity;
  state.position_sigma_m = std::max(before->position_sigma_m, after->position_sigma_m);
  state.rotation_sigma_rad = std::max(before->rotation_sigma_rad, after->rotation_sigma_rad);
  return state;
}

void OdometryBuffer::forgetBefore(Time stamp) {
  while (states_.size() > 1 && states_[1].stamp <= stamp) states_.pop_front();
}

}  // namespace scanner::bridge
