#pragma once

#include <Eigen/Core>
#include <vector>

#include "scanner/core/mesh.h"
#include "scanner/core/status.h"

namespace scanner::evaluation {

/// Points of a surface. Normals are of the faces, or of the points, or absent.
struct SurfaceSamples {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> normals;
};

/// kNotEnoughData for a model without points, kInvalidInput for a face index out of range.
Status checkModel(const Mesh& model);

/// About `count` points spread evenly over the faces: equal steps of area, and within a face a
/// low-discrepancy sequence that `seed` shifts. A mesh without faces gives every n-th of its
/// points. Faces and points that are not finite are left out. The indices of the faces must be in
/// range.
SurfaceSamples sampleSurface(const Mesh& mesh, std::size_t count, int seed);

}  // namespace scanner::evaluation
