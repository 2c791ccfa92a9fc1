#include "inertial/velocity_solver.h"

#include <Eigen/Cholesky>
#include <cmath>

namespace scanner::inertial {

namespace {

// Above this speed, "standing still" is taken for a smooth motion that looks like it.
constexpr double kHoldSpeed = 0.05;  // m/s
// How well a velocity of zero holds while standing still, and how well the velocity of the
// band-passed stream is known (thesis table 5.3: 9.9 cm over 0.55 s).
constexpr double kStillVelocitySigma = 0.005;  // m/s
constexpr double kStreamVelocitySigma = 0.18;  // m/s

// First anchor of the window that ends at `index`: same segment, inside the history.
std::size_t windowStart(const History& history, const InertialOptions& options,
                        const std::vector<Anchor>& anchors, std::size_t index) {
  std::size_t first = index;
  const auto limit = static_cast<std::size_t>(options.velocity_window_views);
  while (first > 0 && index - first + 1 < limit) {
    const Anchor& before = anchors[first - 1];
    if (!before.solved || before.segment != anchors[index].segment) break;
    if (before.stamp < history.entries().front().stamp) break;
    --first;
  }
  return first;
}

// Displacement and velocity, from rest, between two neighbouring poses without constant error. Both
// ends say how odom lies in map; half way between serves the interval best.
Motion betweenPoses(const History& history, const InertialOptions& options, const Anchor& a,
                    const Anchor& b) {
  const Eigen::Matrix3d R = a.R_map_odom.slerp(0.5, b.R_map_odom).toRotationMatrix();
  const Eigen::Vector3d gravity(0.0, 0.0, -options.gravity_mps2);
  return history.integrate(a.stamp, b.stamp, Eigen::Vector3d::Zero(), R, gravity, false);
}

// With T the time from pose j to the last pose K, and S, V displacement and velocity integrated
// over it from rest:
//   p_K = p_j + v_j T + S + 1/2 c T^2,   v_K = v_j + V + c T
// hence  p_j + S - V T = p_K - v_K T + 1/2 c T^2,  linear in p_K, v_K, c, alike for the three axes.
// Where the sensor stood still, v_j = 0 gives  V = v_K - c T  besides: a long wait before the first
// motion then tells the acceleration error instead of leaving it to the velocity.
void solveVelocity(const History& history, const InertialOptions& options,
                   const std::vector<Anchor>& anchors, std::size_t first, Anchor& last) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d B = Eigen::Matrix3d::Zero();
  const double bias = options.acceleration_bias_sigma_mps2;
  A(2, 2) = 1.0 / (bias * bias);  // c is zero unless the poses say otherwise

  const auto addRow = [&](const Anchor& pose, const Motion& to_last) {
    const double T = toSeconds(last.stamp - pose.stamp);
    const double pose_sigma = options.registration_sigma_m;
    const double noise = options.acceleration_noise;
    const double variance = pose_sigma * pose_sigma + noise * noise * T * T * T / 3.0;
    const Eigen::Vector3d row(1.0, -T, 0.5 * T * T);
    const Eigen::Vector3d value =
        pose.T_map_base.translation() + to_last.displacement - to_last.velocity * T;
    A += row * row.transpose() / variance;
    B += row * value.transpose() / variance;
    if (T > 0.0 && pose.still && pose.hold_when_still) {
      const Eigen::Vector3d velocity_row(0.0, 1.0, -T);
      const double v = kStillVelocitySigma * kStillVelocitySigma + noise * noise * T;
      A += velocity_row * velocity_row.transpose() / v;
      B += velocity_row * to_last.velocity.transpose() / v;
    }
  };

  Motion to_last;  // from the pose at hand to the last, from rest
  const Anchor* next = &last;
  addRow(last, to_last);
  for (std::size_t j = anchors.size(); j-- > first;) {
    const Motion step = betweenPoses(history, options, anchors[j], *next);
    to_last.displacement += step.displacement + step.velocity * toSeconds(last.stamp - next->stamp);
    to_last.velocity += step.velocity;
    addRow(anchors[j], to_last);
    next = &anchors[j];
  }
  last.covariance = A.ldlt().solve(Eigen::Matrix3d::Identity());
  const Eigen::Matrix3d x = last.covariance * B;
  last.velocity_map = x.row(1).transpose();
  last.acceleration_map = x.row(2).transpose();
}

}  // namespace

void solveAnchor(const History& history, const InertialOptions& options,
                 std::vector<Anchor>& anchors, std::size_t index) {
  Anchor anchor = anchors[index];
  const HistoryEntry here = history.at(anchor.stamp);
  anchor.segment = here.segment;
  const Eigen::Quaterniond R_map_base(anchor.T_map_base.linear());
  anchor.R_map_odom = (R_map_base * here.R_odom_base.conjugate()).normalized();
  anchor.position_odom = here.position;
  anchor.still = here.still;
  anchors[index].segment = here.segment;

  const std::size_t first = windowStart(history, options, anchors, index);
  if (first < index) {
    anchor.position_odom =
        carryForward(history, options, anchors[index - 1], anchor.stamp).displacement;
    const std::vector<Anchor> window(anchors.begin() + static_cast<std::ptrdiff_t>(first),
                                     anchors.begin() + static_cast<std::ptrdiff_t>(index));
    solveVelocity(history, options, window, 0, anchor);
    anchor.hold_when_still = anchor.velocity_map.norm() < kHoldSpeed;
  } else {
    anchor.velocity_map = here.still ? Eigen::Vector3d(Eigen::Vector3d::Zero())
                                     : Eigen::Vector3d(anchor.R_map_odom * here.velocity);
    anchor.acceleration_map.setZero();
    const double pose = options.registration_sigma_m;
    const double velocity = here.still ? kStillVelocitySigma : kStreamVelocitySigma;
    const double bias = options.acceleration_bias_sigma_mps2;
    anchor.covariance = Eigen::Vector3d(pose * pose, velocity * velocity, bias * bias).asDiagonal();
    anchor.hold_when_still = true;
  }
  anchor.solved = true;
  anchors[index] = anchor;
}

Motion carryForward(const History& history, const InertialOptions& options, const Anchor& anchor,
                    Time stamp) {
  const Eigen::Vector3d constant =
      anchor.acceleration_map - Eigen::Vector3d(0.0, 0.0, options.gravity_mps2);
  Motion m =
      history.integrate(anchor.stamp, stamp, anchor.velocity_map,
                        anchor.R_map_odom.toRotationMatrix(), constant, anchor.hold_when_still);
  const Eigen::Quaterniond R_odom_map = anchor.R_map_odom.conjugate();
  m.displacement = anchor.position_odom + R_odom_map * m.displacement;
  m.velocity = R_odom_map * m.velocity;
  return m;
}

double carriedSigma(const InertialOptions& options, const Anchor& anchor, double t) {
  const Eigen::Vector3d row(1.0, t, 0.5 * t * t);
  const double noise = options.acceleration_noise;
  return std::sqrt(row.dot(anchor.covariance * row) + noise * noise * t * t * t / 3.0);
}

}  // namespace scanner::inertial
