#pragma once

#include <cstddef>

#include "scanner/core/mesh.h"

namespace scanner::bridge {

/// Coarser copy for display: vertices of one cell of a grid of `cell_m` become their mean, faces
/// that collapse go (Rossignac and Borrel 1993). Deterministic.
Mesh clustered(const Mesh& mesh, double cell_m);

/// The mesh itself, or clustered so that about `max_faces` remain.
Mesh previewMesh(const Mesh& mesh, std::size_t max_faces);

}  // namespace scanner::bridge
