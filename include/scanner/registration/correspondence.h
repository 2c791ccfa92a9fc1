#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "scanner/registration/indexed_cloud.h"
#include "scanner/registration/options.h"

namespace scanner::registration {

/// A moving sample and the reference sample it was matched to.
struct Correspondence {
  std::uint32_t moving = 0;   ///< index into Moving::samples
  Eigen::Vector3d reference;  ///< matched point, reference frame, metres
  Eigen::Vector3d normal;     ///< its normal, reference frame
  double distance = 0.0;      ///< point to point, at the transform it was found with, metres
  double sigma = 0.0;         ///< root of the sum of both depth variances, metres; 0 if unknown
};

/// Whether two unit normals may belong together: their angle is below theta_c, or, in the printed
/// form of eq. 4.10, 2 acos|n1 . n2| < theta_c (which halves the angle and ignores the sign).
bool compatible(const Eigen::Vector3f& n1, const Eigen::Vector3f& n2,
                const CorrespondenceOptions& options);

/// Closest compatible point (thesis 4.5) of every moving sample placed by T_ref_mov, nearer than
/// `max_distance_m` (0: any distance). In the order of the samples; samples without a partner are
/// left out. The result does not depend on `threads`.
std::vector<Correspondence> findCorrespondences(const Reference& reference, const Moving& moving,
                                                const Eigen::Isometry3d& T_ref_mov,
                                                const CorrespondenceOptions& options,
                                                double max_distance_m, int threads);

/// Pairs not further apart than `factor` times the median distance (thesis 4.5); factor 0 keeps
/// all. A median of (near) zero keeps the pairs of that distance only.
std::vector<Correspondence> rejectDistant(std::vector<Correspondence> pairs, double factor);

}  // namespace scanner::registration
