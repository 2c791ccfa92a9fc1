#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "scanner/core/se3.h"
#include "scanner/core/status.h"
#include "scanner/registration/correspondence.h"

namespace scanner::registration {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// The motion T with T * from[i] closest to to[i] in the least-squares sense, det(R) = +1 whatever
/// the noise (Umeyama, PAMI 1991; Horn 1987). Weights may be empty. kNotEnoughData for fewer than 3
/// pairs; points on one line leave the rotation about it free (the smallest is not guaranteed).
Result<Eigen::Isometry3d> alignPointToPoint(const std::vector<Eigen::Vector3d>& from,
                                            const std::vector<Eigen::Vector3d>& to);

enum class Variant { kFull, kTranslational };

/// One linearised point-to-plane step and what it says about the geometry.
struct PlaneStep {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();  ///< left-multiplies T_ref_mov
  /// Sum of J^T w J over the pairs; tangent [translation; rotation] of a motion about `centre`,
  /// reference frame, metres and rad.
  Matrix6 normal_matrix = Matrix6::Zero();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double weight = 0.0;            ///< sum of the weights
  double min_eigenvalue = 0.0;    ///< per unit weight, rotations scaled by the data's radius: 0..1
  int degenerate_directions = 0;  ///< directions that were left alone
};

/// Minimises sum w (n . (T x - q))^2 over a small motion T; `placed[i]` is the moving point of
/// pairs[i] in the reference frame. Directions whose eigenvalue per unit weight is below
/// `degenerate_below` get no motion, so that they keep the prior instead of sliding (Zhang and
/// Singh, ICRA 2016). Weights: variance of the pair (sigma_weights) and robust kernel on the
/// residuals.
PlaneStep solvePointToPlane(const std::vector<Correspondence>& pairs,
                            const std::vector<Eigen::Vector3d>& placed, Variant variant,
                            const IcpOptions& options);

struct IcpResult {
  Eigen::Isometry3d T_ref_mov = Eigen::Isometry3d::Identity();
  bool accepted = false;
  Status status;  ///< why not accepted: kNoConvergence, kNoOverlap, kOutOfRange, kNotEnoughData
  int iterations = 0;
  double mean_distance_m = 0.0;        ///< point to point, kept pairs
  double mean_plane_distance_m = 0.0;  ///< point to tangent plane, kept pairs
  std::size_t pairs = 0;               ///< compatible pairs of the last matching
  std::size_t inliers = 0;             ///< of these, kept by the rejection
  double overlap = 0.0;                ///< share of moving samples that lie on the reference, 0..1
  double accept_mean_m = 0.0;          ///< threshold that was applied
  /// Information of T_ref_mov for the tangent of pose_graph.h, from the point-to-plane geometry of
  /// the kept pairs, as of 100 independent pairs (samples of a smooth surface are far from
  /// independent), or with the acceptance threshold as standard deviation when it stopped there.
  /// Positive definite: free directions get a weak floor.
  Matrix6 information = Matrix6::Identity();
  double min_eigenvalue = 0.0;
  int degenerate_directions = 0;
};

/// ICP of `moving` against `reference`, started at `T_start`. Options say metric, when to stop and
/// what is accepted; deviation limits are measured from `T_prior`. Iterations: match, reject,
/// solve. With StopRule::kAtThreshold it ends, accepted, at the first iteration after which the
/// mean distance of the kept pairs is within the threshold (thesis 2.3, 4.5); with kAtConvergence
/// it goes on until the update vanishes or the iteration limit, then matches once more and judges.
/// The result does not depend on `threads`.
IcpResult icp(const Reference& reference, const Moving& moving, const Eigen::Isometry3d& T_start,
              const Eigen::Isometry3d& T_prior, Variant variant, const IcpOptions& options,
              const CorrespondenceOptions& correspondence, int threads);

}  // namespace scanner::registration
