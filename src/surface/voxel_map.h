#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "scanner/core/cloud.h"
#include "scanner/surface/fuse.h"

namespace scanner::surface {

/// Weighted sums of the points of one voxel that face the same way. A voxel crossed by a thin sheet
/// has two of these.
struct VoxelSum {
  std::uint64_t key = 0;
  Eigen::Vector3f offset = Eigen::Vector3f::Zero();  ///< position relative to the voxel's centre
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  Eigen::Vector3f color = Eigen::Vector3f::Zero();
  float weight = 0.0F;
  std::uint32_t views = 0;  ///< views that contributed
};

/// Fused points while they are being worked on, structure of arrays.
struct FusedPoints {
  std::vector<Eigen::Vector3f> points;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Eigen::Vector3f> colors;
  std::vector<float> weights;  ///< sum of (reference_sigma / sigma)^2
  std::vector<std::uint32_t> views;
  std::size_t size() const { return points.size(); }
};

struct VoxelGridSettings {
  double voxel_m = 0.0;
  double cos_normal_angle = 0.5;
  double reference_sigma_m = 1.0;  ///< a point with this sigma has weight 1
  bool use_sigmas = false;
  bool use_colors = false;
};

/// Averages all views, in order, into voxels sorted by key. `unusable` counts points left out. The
/// views are reduced in blocks of fixed size, so memory holds a few reduced views at a time and the
/// sums do not depend on the number of threads.
FusedPoints fuseIntoVoxels(const std::vector<PosedCloud>& views, const VoxelGridSettings& settings,
                           int threads, std::size_t& unusable);

/// Keeps the points whose flag is set.
void keepOnly(FusedPoints& points, const std::vector<char>& keep);

}  // namespace scanner::surface
