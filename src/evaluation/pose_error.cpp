#include "scanner/evaluation/pose_error.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "scanner/core/trajectory_io.h"

namespace scanner::evaluation {

namespace {

constexpr double kDegreesPerRadian = 180.0 / 3.14159265358979323846;

Statistics column(const std::vector<MotionRow>& rows, double MotionComponents::*member) {
  std::vector<double> values;
  values.reserve(rows.size());
  for (const MotionRow& row : rows) values.push_back(row.motion.*member);
  return summarize(values);
}

}  // namespace

MotionComponents motionComponents(const Eigen::Isometry3d& T) {
  const Eigen::Vector3d angles = rollPitchYaw(T.linear()) * kDegreesPerRadian;
  const Eigen::Vector3d t = T.translation();
  return {rotationAngle(T) * kDegreesPerRadian,
          angles.x(),
          angles.y(),
          angles.z(),
          t.norm(),
          t.x(),
          t.y(),
          t.z()};
}

MotionSummary summarize(const std::vector<MotionRow>& rows) {
  return {column(rows, &MotionComponents::arc_deg),   column(rows, &MotionComponents::roll_deg),
          column(rows, &MotionComponents::pitch_deg), column(rows, &MotionComponents::yaw_deg),
          column(rows, &MotionComponents::rho_m),     column(rows, &MotionComponents::x_m),
          column(rows, &MotionComponents::y_m),       column(rows, &MotionComponents::z_m)};
}

std::vector<MotionRow> relativePriorErrors(const std::vector<PriorPair>& pairs) {
  std::vector<MotionRow> rows;
  for (const PriorPair& pair : pairs) {
    const Eigen::Isometry3d error =
        pair.T_from_to_prior.inverse(Eigen::Isometry) * pair.T_from_to_registered;
    rows.push_back({pair.from, pair.to, motionComponents(error)});
  }
  return rows;
}

std::vector<MotionRow> absolutePriorErrors(const std::vector<PriorPair>& pairs) {
  std::vector<PriorPair> compounded;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    PriorPair pair = pairs[i];
    if (i > 0) {
      if (pair.from != pairs[i - 1].to) {
        throw ConfigurationError("absolutePriorErrors: pair " + std::to_string(i) +
                                 " starts at view " + std::to_string(pair.from) +
                                 ", but the one before ends at " + std::to_string(pairs[i - 1].to));
      }
      const PriorPair& last = compounded.back();
      pair.from = last.from;
      pair.T_from_to_prior = last.T_from_to_prior * pair.T_from_to_prior;
      pair.T_from_to_registered = last.T_from_to_registered * pair.T_from_to_registered;
    }
    compounded.push_back(pair);
  }
  return relativePriorErrors(compounded);
}

std::vector<MotionRow> motionsBetweenNeighbours(const Trajectory& trajectory) {
  std::vector<MotionRow> rows;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    const Eigen::Isometry3d& a = trajectory[i - 1].T_map_base;
    const Eigen::Isometry3d& b = trajectory[i].T_map_base;
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    motion.linear() = b.linear() * a.linear().transpose();
    motion.translation() = b.translation() - a.translation();
    rows.push_back({static_cast<int>(i) - 1, static_cast<int>(i), motionComponents(motion)});
  }
  return rows;
}

Result<PoseErrors> compareToTruth(const Trajectory& estimate, const Trajectory& truth,
                                  Duration max_gap) {
  PoseErrors errors;
  Eigen::Isometry3d T_truth_map = Eigen::Isometry3d::Identity();
  double position_squares = 0.0, rotation_squares = 0.0;
  for (const StampedPose& pose : estimate) {
    const Result<Eigen::Isometry3d> true_pose = poseAt(truth, pose.stamp, max_gap);
    if (!true_pose) {
      ++errors.skipped;
      continue;
    }
    if (errors.poses.empty()) {
      T_truth_map = *true_pose * pose.T_map_base.inverse(Eigen::Isometry);
    }
    const Eigen::Isometry3d error =
        true_pose->inverse(Eigen::Isometry) * (T_truth_map * pose.T_map_base);
    const double position = error.translation().norm();
    const double rotation = rotationAngle(error) * kDegreesPerRadian;
    errors.poses.push_back({pose.stamp, position, rotation});
    errors.position_max_m = std::max(errors.position_max_m, position);
    errors.rotation_max_deg = std::max(errors.rotation_max_deg, rotation);
    position_squares += position * position;
    rotation_squares += rotation * rotation;
  }
  if (errors.poses.empty()) {
    return Status(StatusCode::kNotEnoughData,
                  "none of " + std::to_string(estimate.size()) + " poses has a true pose");
  }
  const double n = static_cast<double>(errors.poses.size());
  errors.position_rmse_m = std::sqrt(position_squares / n);
  errors.rotation_rmse_deg = std::sqrt(rotation_squares / n);
  return errors;
}

}  // namespace scanner::evaluation
