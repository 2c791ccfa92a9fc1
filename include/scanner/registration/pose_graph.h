#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "scanner/core/status.h"
#include "scanner/registration/icp.h"

namespace scanner::registration {

/// A measured relative pose. The error of an estimate, and so the tangent that `information`
/// belongs to, is
///   e = [ R_i^T (t_j - t_i) - t_ij ;  2 vec(q_ij^-1 q_i^-1 q_j) ],
/// i.e. translation in frame i (metres), then the rotation vector of the remaining rotation in
/// frame j (rad, to first order).
struct PoseGraphEdge {
  int from = 0;
  int to = 0;
  Eigen::Isometry3d T_from_to = Eigen::Isometry3d::Identity();
  Matrix6 information = Matrix6::Identity();
  bool loop = false;  ///< gets a robust loss and may be dropped
};

struct PoseGraphSummary {
  double initial_cost = 0.0;
  double final_cost = 0.0;
  int iterations = 0;
  std::vector<std::size_t> dropped;  ///< loop edges (indices) that contradict the rest
};

/// Error e of an edge, as defined above.
Twist edgeError(const PoseGraphEdge& edge, const Eigen::Isometry3d& T_map_from,
                const Eigen::Isometry3d& T_map_to);

/// Least squares over all edges; `poses[fixed]` stays. Loop edges get a Cauchy loss of scale
/// `loop_sigmas`; those whose error stays beyond three times that are dropped and the rest is
/// solved again. Single-threaded, hence deterministic. kInvalidInput for an edge to a pose that is
/// not there or not finite, kNoConvergence when the solver fails; `poses` are then left as they
/// were. Poses without an edge stay.
Result<PoseGraphSummary> optimizePoseGraph(const std::vector<PoseGraphEdge>& edges,
                                           std::size_t fixed, double loop_sigmas,
                                           std::vector<Eigen::Isometry3d>& poses);

}  // namespace scanner::registration
