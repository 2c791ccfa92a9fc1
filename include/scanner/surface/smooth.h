#pragma once

#include "scanner/core/mesh.h"
#include "scanner/surface/options.h"

namespace scanner::surface {

/// Moves vertices to reduce noise; connectivity, colours and boundary vertices stay as they are,
/// normals of the moved vertices are recomputed. Methods (thesis 4.7):
///  * laplacian: towards the mean of the neighbours; shrinks;
///  * hc_laplacian: with the correction of Vollmer, Mencl and Mueller (Computer Graphics Forum
///    18(3), 1999), keeps the volume;
///  * two_step: face normals are averaged with their neighbours, then vertices are fitted to them
///    (Belyaev and Ohtake 2003); keeps edges sharper than `feature_angle_deg`.
/// Deterministic; reentrant.
Mesh smooth(Mesh mesh, const SmoothingOptions& options);

/// Area-weighted vertex normals from the faces; vertices without a face keep theirs, or get NaN.
void recomputeNormals(Mesh& mesh);

}  // namespace scanner::surface
