#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "scanner/core/se3.h"
#include "scanner/core/status.h"
#include "scanner/core/time.h"
#include "scanner/evaluation/statistics.h"

namespace scanner::evaluation {

/// A rigid motion in the columns of thesis tables 5.2-5.6: arc length of the rotation, its roll,
/// pitch and yaw (R = Rz Ry Rx), length of the translation and its components.
struct MotionComponents {
  double arc_deg = 0.0;
  double roll_deg = 0.0;
  double pitch_deg = 0.0;
  double yaw_deg = 0.0;
  double rho_m = 0.0;
  double x_m = 0.0;
  double y_m = 0.0;
  double z_m = 0.0;
};

MotionComponents motionComponents(const Eigen::Isometry3d& T);

/// One row of a table: the views it is about (their indices) and the motion.
struct MotionRow {
  int from = -1;
  int to = -1;
  MotionComponents motion;
};

/// The last three rows of a table: median, mean and sigma of every column.
struct MotionSummary {
  Statistics arc_deg, roll_deg, pitch_deg, yaw_deg, rho_m, x_m, y_m, z_m;
};

MotionSummary summarize(const std::vector<MotionRow>& rows);

/// What the inertial sensor said about the motion between two views, and what registration found.
struct PriorPair {
  int from = -1;
  int to = -1;
  Eigen::Isometry3d T_from_to_prior = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_from_to_registered = Eigen::Isometry3d::Identity();
};

/// Error of the prior, pair by pair (tables 5.3, 5.5): T_prior^-1 T_registered, the motion that was
/// missing, in the frame that the prior gave the later view. rho is how far off its position was.
std::vector<MotionRow> relativePriorErrors(const std::vector<PriorPair>& pairs);

/// The same with priors and registered motions compounded from the first view on (tables 5.4, 5.6).
/// Throws ConfigurationError unless every pair starts at the view where the one before it ended.
std::vector<MotionRow> absolutePriorErrors(const std::vector<PriorPair>& pairs);

/// Motion of base_link between neighbouring poses as seen from the map (table 5.2): R_next R^T and
/// p_next - p. `from` and `to` are positions in the trajectory, from 0.
std::vector<MotionRow> motionsBetweenNeighbours(const Trajectory& trajectory);

/// Distance of one pose from the truth.
struct PoseErrorRow {
  Time stamp;
  double position_m = 0.0;
  double rotation_deg = 0.0;
};

struct PoseErrors {
  double position_rmse_m = 0.0;
  double position_max_m = 0.0;
  double rotation_rmse_deg = 0.0;
  double rotation_max_deg = 0.0;
  std::vector<PoseErrorRow> poses;  ///< those compared, in order; the first is zero by alignment
  int skipped = 0;                  ///< poses at whose time there is no truth
};

/// Errors after one rigid alignment of the first pose that has a truth. The truth is interpolated
/// at the stamps of the estimate, over gaps of at most `max_gap`. kNotEnoughData when no pose has
/// one.
Result<PoseErrors> compareToTruth(const Trajectory& estimate, const Trajectory& truth,
                                  Duration max_gap = fromSeconds(0.1));

}  // namespace scanner::evaluation
