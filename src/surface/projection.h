#pragma once

#include "scanner/surface/options.h"
#include "surface/voxel_map.h"

namespace scanner::surface {

/// One round of moving least squares: every point moves along the mean normal of its surroundings
/// onto a weighted least-squares plane or quadric of them (weights: support times a bell of the
/// distance), and takes its normal from there. All points move at once.
void projectOntoLocalSurface(FusedPoints& points, double radius_m, int degree,
                             double cos_normal_angle, int threads);

}  // namespace scanner::surface
