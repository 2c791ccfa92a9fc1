#pragma once

#include <string>

#include "scanner/core/mesh.h"
#include "scanner/core/status.h"

namespace scanner::surface {

/// Writes a mesh; the extension, in any case, chooses the format:
///  * .ply  binary PLY of core (normals, colours, sigmas);
///  * .obj  Wavefront with normals, and colours as `v x y z r g b` (0..1), as MeshLab reads them;
///  * .stl  binary, geometry only;
///  * .glb  glTF 2.0 with normals and linear vertex colours; glTF is y up, so a node turns our z
///  up.
/// Files appear whole or not at all; same mesh, same bytes. kUnsupported for another extension,
/// kInvalidInput for a face index out of range or a position that is not finite, kIoError.
Status writeMesh(const std::string& path, const Mesh& mesh);

}  // namespace scanner::surface
