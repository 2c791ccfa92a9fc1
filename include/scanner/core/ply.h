#pragma once

#include <string>

#include "scanner/core/mesh.h"
#include "scanner/core/status.h"

namespace scanner {

/// Binary little-endian PLY with x y z, and nx ny nz, red green blue, sigma where present. Written
/// to a temporary file beside `path` and renamed, so that `path` is whole or untouched. Same input,
/// same bytes.
Status writePly(const std::string& path, const PointCloud& cloud);
Status writePly(const std::string& path, const Mesh& mesh);

/// Reads ASCII or binary PLY. Unknown elements and properties are skipped; a Stanford range grid is
/// read as the points it names. Faces with more than three corners are fanned.
Result<Mesh> readPly(const std::string& path);

/// Writes `content` to a temporary file beside `path`, then renames it.
Status writeFileAtomically(const std::string& path, const std::string& content);

}  // namespace scanner
