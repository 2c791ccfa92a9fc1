#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "scanner/core/time.h"

namespace scanner {

/// Rigid motions are Eigen::Isometry3d named T_a_b, and map b to a: p_a = T_a_b * p_b.
using Twist = Eigen::Matrix<double, 6, 1>;  ///< [translation part v (m); rotation part w (rad)]

/// Skew-symmetric matrix: skew(a) * b = a x b.
Eigen::Matrix3d skew(const Eigen::Vector3d& v);

/// Exponential and logarithm of SO(3), rotation vector in rad. logSo3 returns a vector no longer
/// than pi. Both are accurate at zero and logSo3 at pi.
Eigen::Quaterniond expSo3(const Eigen::Vector3d& w);
Eigen::Vector3d logSo3(const Eigen::Quaterniond& q);

/// Exponential and logarithm of SE(3) (Barfoot, State Estimation for Robotics, eq. 7.85-7.95).
Eigen::Isometry3d expSe3(const Twist& xi);
Twist logSe3(const Eigen::Isometry3d& T);

/// Angle between two orientations in rad, 2 acos|q1.q2| (thesis eq. 4.11), computed so that small
/// angles keep their precision.
double angleBetween(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);
/// Angle of the rotation part in rad, 0..pi.
double rotationAngle(const Eigen::Isometry3d& T);

/// Geodesic between two poses: linear in translation, slerp in rotation. s in [0, 1].
Eigen::Isometry3d interpolate(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double s);

/// Nearest rotation in the Frobenius norm with det = +1 (thesis eq. 3.7).
Eigen::Matrix3d nearestRotation(const Eigen::Matrix3d& m);

/// Roll, pitch, yaw in rad of R = Rz(yaw) Ry(pitch) Rx(roll).
Eigen::Vector3d rollPitchYaw(const Eigen::Matrix3d& R);

bool isFinite(const Eigen::Isometry3d& T);
Eigen::Isometry3d makePose(const Eigen::Vector3d& translation, const Eigen::Quaterniond& rotation);

struct StampedPose {
  Time stamp;
  Eigen::Isometry3d T_map_base = Eigen::Isometry3d::Identity();
};

/// Poses of base_link in map by time, strictly increasing stamps.
using Trajectory = std::vector<StampedPose>;

}  // namespace scanner
