#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "scanner/core/cloud.h"

namespace scanner {

/// Indexed triangle mesh. Faces are counter-clockwise seen from outside.
struct Mesh {
  PointCloud vertices;
  std::vector<std::array<std::uint32_t, 3>> faces;
};

}  // namespace scanner
