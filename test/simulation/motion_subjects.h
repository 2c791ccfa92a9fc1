#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "scanner/core/se3.h"
#include "scanner/simulation/motion.h"

/// Subjects of the size of the scenes, and a rig like the published one.
namespace scanner::simulation::test {

inline Eigen::Isometry3d publishedMounting() {
  Eigen::Matrix3d R;  // thesis eq. 5.1, camera to sensor; signs so that the camera is upright
  R << -0.0407, -0.0330, 0.9986, -0.9991, -0.0107, -0.0411, 0.0120, -0.9994, -0.0326;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = nearestRotation(R);
  T.translation() << 0.047, 0.060, -0.063;
  return T;
}

inline MotionSubject statue() {
  return {{Eigen::Vector3d(-0.22, -0.18, 0.0), Eigen::Vector3d(0.22, 0.18, 0.75)},
          publishedMounting(),
          "orbit"};
}

/// The scene `artwork` is a little slimmer.
inline MotionSubject slimStatue() {
  return {{Eigen::Vector3d(-0.19, -0.165, 0.0), Eigen::Vector3d(0.185, 0.167, 0.762)},
          publishedMounting(),
          "orbit"};
}

inline MotionSubject pole() {
  return {{Eigen::Vector3d(-0.28, -0.28, 0.0), Eigen::Vector3d(0.28, 0.28, 1.9)},
          publishedMounting(),
          "passes"};
}

/// A motion that rests, or turns and shakes steadily: for sensors whose input must be known.
class SteadyMotion : public Motion {
 public:
  explicit SteadyMotion(double duration_s) : duration_s_(duration_s) {}

  double duration() const override { return duration_s_; }
  MotionState at(double time_s) const override {
    MotionState state;
    state.T_map_base.linear() = expSo3(turn_rate * time_s).toRotationMatrix();
    state.angular_velocity = turn_rate;
    const double phase = 6.283185307179586 * shake_hz * time_s;
    state.acceleration = shake * std::sin(phase);  // position is of no interest here
    return state;
  }

  Eigen::Vector3d turn_rate = Eigen::Vector3d::Zero();  ///< rad/s
  Eigen::Vector3d shake = Eigen::Vector3d::Zero();      ///< m/s^2
  double shake_hz = 1.0;

 private:
  double duration_s_;
};

}  // namespace scanner::simulation::test
