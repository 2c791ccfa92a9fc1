#pragma once

#include <geometry_msgs/Vector3.h>
#include <nav_msgs/Odometry.h>

#include <deque>
#include <string>

#include "scanner/inertial/odometry.h"

namespace scanner::bridge {

/// Pose in `frame_id`, twist in the child frame as REP-147 and nav_msgs ask for (the state's
/// velocity is in odom), sigmas as diagonal covariance of the pose. `angular_velocity` in
/// base_link, rad/s.
nav_msgs::Odometry toRos(const inertial::OdometryState& state,
                         const Eigen::Vector3d& angular_velocity, const std::string& frame_id,
                         const std::string& child_frame_id);
/// kInvalidInput for NaN. `stationary` and `segment` are not carried by the message.
Result<inertial::OdometryState> fromRos(const nav_msgs::Odometry& message);

/// The latest odometry, to be asked for any stamp in between. Not thread-safe.
class OdometryBuffer {
 public:
  /// States further apart than `max_gap` have an unknown motion between them.
  explicit OdometryBuffer(Duration max_gap) : max_gap_(max_gap) {}

  /// False (and ignored) when the stamp is not after the newest one.
  bool add(inertial::OdometryState state);
  /// By interpolation. kNotEnoughData: not there yet, ask again. kOutOfRange: will never come
  /// (before the first state, or in a gap).
  Result<inertial::OdometryState> at(Time stamp) const;
  /// Forgets what is older than `stamp`, but for one state.
  void forgetBefore(Time stamp);
  void clear() { states_.clear(); }
  std::size_t size() const { return states_.size(); }

 private:
  Duration max_gap_;
  int segment_ = 0;
  std::deque<inertial::OdometryState> states_;
};

}  // namespace scanner::bridge
