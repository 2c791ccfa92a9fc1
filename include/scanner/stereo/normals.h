#pragma once

#include "scanner/core/cloud.h"
#include "scanner/stereo/options.h"

namespace scanner::stereo {

/// Fills cloud.cloud.normals: the eigenvector of the smallest eigenvalue of the scatter matrix of
/// the valid points in the window round each pixel, about their mean (thesis section 4.2, eq. 4.1;
/// the thesis leaves the mean in, which only holds for points round the origin), unit length,
/// towards the camera at the origin.
///
/// NaN where the point itself is NaN, fewer than `min_points` are valid, the points do not span a
/// plane, or the window straddles a depth step: a neighbour further in depth than
/// max_step_ratio * Z per pixel of distance + max_step_sigmas * sigma. Same bytes for any
/// `threads`.
void estimateNormals(OrganizedCloud& cloud, const NormalOptions& options, int threads);

}  // namespace scanner::stereo
