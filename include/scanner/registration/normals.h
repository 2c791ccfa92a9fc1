#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "scanner/core/cloud.h"

namespace scanner::registration {

/// Normals of unordered points from their `neighbours` nearest points (eigenvector of the smallest
/// eigenvalue of the scatter about the mean, eq. 4.1), turned towards `viewpoint` (same frame,
/// metres). NaN where neighbours are on a line or the point is not finite. neighbours >= 3.
void estimateNormalsKnn(PointCloud& cloud, std::size_t neighbours, const Eigen::Vector3d& viewpoint,
                        int threads);

/// The same, turned so that n . direction >= 0: for scanners far away in that direction.
void estimateNormalsTowards(PointCloud& cloud, std::size_t neighbours,
                            const Eigen::Vector3d& direction, int threads);

}  // namespace scanner::registration
