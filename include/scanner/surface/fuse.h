#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "scanner/core/cloud.h"
#include "scanner/surface/options.h"

namespace scanner::surface {

/// A registered view: its cloud, and where it is. `cloud` is not owned and must not be null.
struct PosedCloud {
  const PointCloud* cloud = nullptr;
  Eigen::Isometry3d T_map_cloud = Eigen::Isometry3d::Identity();
};

struct FusionStatistics {
  std::size_t input_points = 0;
  std::size_t unusable_points = 0;  ///< not finite, without a normal, or too far to index
  std::size_t voxels = 0;           ///< voxel averages before filtering
  std::size_t unsupported = 0;      ///< removed: too few views for how well the place is covered
  std::size_t isolated = 0;         ///< removed: too few neighbours
  std::size_t contradicted = 0;     ///< removed: normal at odds with nearly all around it
  std::size_t thinned = 0;          ///< removed: closer than thinning_voxels to a better point
  std::size_t output_points = 0;
  double voxel_m = 0.0;    ///< as used
  double spacing_m = 0.0;  ///< median nearest-neighbour distance within the views
  double noise_m = 0.0;    ///< median noise along the normal within the views
};

/// Fuses registered views into one cloud of one layer in the map frame, with normals, colours when
/// every view has them, and sigmas (standard error of the mean) when every view has them.
///
/// Points are averaged in a voxel grid, weighted by 1/sigma^2; only points whose normals agree
/// average together, so the two sides of a thin sheet stay apart. Averages that few views support
/// although the place is covered by more, isolated ones, and those whose normal contradicts their
/// surroundings are dropped. What remains is projected
/// along its normal onto a local weighted least-squares surface (moving least squares, Levin 1998;
/// Alexa et al. 2003), so that the noise of single views averages out over voxel borders too, and
/// is thinned to an even spacing.
///
/// Empty when no view holds a finite point with a finite normal. Throws ConfigurationError for a
/// null cloud, a pose that is not finite or threads < 1. Output order is fixed by the data alone
/// and does not depend on `threads`. Reentrant.
PointCloud fuse(const std::vector<PosedCloud>& views, const FusionOptions& options, int threads,
                FusionStatistics* statistics = nullptr);

}  // namespace scanner::surface
