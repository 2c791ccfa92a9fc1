#pragma once

#include <cstddef>
#include <vector>

#include "scanner/core/cloud.h"
#include "scanner/core/mesh.h"
#include "scanner/core/status.h"
#include "scanner/surface/options.h"

namespace scanner::surface {

struct BallPivotStatistics {
  double spacing_m = 0.0;          ///< mean distance to the six nearest neighbours
  std::vector<double> radii_m;     ///< balls that were rolled
  std::vector<std::size_t> faces;  ///< faces added by each ball
  std::size_t seeds = 0;           ///< seed triangles started from
};

/// Mean distance of a point to those of its six nearest neighbours that are elsewhere, metres;
/// median over about 20000 evenly chosen points. 0 when no two points differ. Points must be
/// finite.
double meanSpacing(const PointCloud& cloud);

/// Triangulates oriented points by ball pivoting (Bernardini, Mittleman, Rushmeier, Silva and
/// Taubin, IEEE TVCG 5(4), 1999; thesis 4.7): a ball resting on three points rolls over the edges
/// of what was triangulated so far until it touches a next point. The radius comes from the mean
/// spacing unless given; larger balls then continue at the open boundary.
///
/// A face joins points whose normals agree with its own; points facing the other way neither join
/// nor block the ball, so thin sheets get their two sides. No edge gets more than two faces. Faces
/// are counter-clockwise seen from where the normals point. All points are kept as vertices, in
/// their order, with their attributes (clean() drops the unreferenced ones).
///
/// kNotEnoughData: fewer than three points, or no triangle fits. kInvalidInput: a position or
/// normal that is not finite, no normals, or all points in one place. Deterministic; reentrant.
Result<Mesh> ballPivot(const PointCloud& cloud, const BallPivotOptions& options, int threads = 1,
                       BallPivotStatistics* statistics = nullptr);

/// As above with explicit ball radii (metres, ascending, positive); throws ConfigurationError for
/// an empty or unordered list.
Result<Mesh> ballPivotWithRadii(const PointCloud& cloud, const std::vector<double>& radii_m,
                                const BallPivotOptions& options, int threads = 1,
                                BallPivotStatistics* statistics = nullptr);

}  // namespace scanner::surface
