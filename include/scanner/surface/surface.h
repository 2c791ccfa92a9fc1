#pragma once

#include <vector>

#include "scanner/core/mesh.h"
#include "scanner/core/status.h"
#include "scanner/surface/ball_pivot.h"
#include "scanner/surface/clean.h"
#include "scanner/surface/fuse.h"
#include "scanner/surface/holes.h"
#include "scanner/surface/options.h"
#include "scanner/surface/smooth.h"
#include "scanner/surface/statistics.h"

namespace scanner::surface {

/// What each step of buildSurface() did, and how long it took (wall clock).
struct SurfaceStatistics {
  FusionStatistics fusion;
  BallPivotStatistics ball_pivot;
  CleaningStatistics cleaning;
  HoleStatistics holes;
  MeshStatistics model;
  double fusion_s = 0.0;
  double ball_pivot_s = 0.0;
  double cleaning_s = 0.0;
  double holes_s = 0.0;
  double smoothing_s = 0.0;
  double total_s = 0.0;
};

/// Fused cloud to mesh: ballPivot, clean, fillHoles, smooth, as the options say. Errors of
/// ballPivot(); kNotEnoughData when cleaning leaves nothing.
Result<Mesh> meshCloud(const PointCloud& fused, const SurfaceOptions& options, int threads,
                       SurfaceStatistics* statistics = nullptr);

/// fuse(), then meshCloud(). Mesh in the map frame, with normals and the colours of the views.
/// `fused`, when given, receives the fused cloud. kNotEnoughData when there are no views or nothing
/// usable in them. The bytes of the mesh do not depend on `threads`. Reentrant.
Result<Mesh> buildSurface(const std::vector<PosedCloud>& views, const SurfaceOptions& options,
                          int threads, SurfaceStatistics* statistics = nullptr,
                          PointCloud* fused = nullptr);

}  // namespace scanner::surface
