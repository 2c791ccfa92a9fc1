#pragma once

#include <cstddef>

/// Kernels of the normals, once per instruction set, each with the same bytes: sums in double in
/// the order of the window's rows and columns, no fused multiply-add.
namespace scanner::stereo::simd {

constexpr int kMaxNormalRadius = 15;
/// Floats that a plane must hold before and after its row.
constexpr std::size_t kNormalPadding = 16;   // >= kMaxNormalRadius
constexpr std::size_t kNormalOverrun = 192;  // a tile and a vector beyond the last pixel

/// One row of points, taken apart. Pixels without a point, and those beyond the image, are 0.
struct PointPlanes {
  float* x = nullptr;
  float* y = nullptr;
  float* z = nullptr;
  float* valid = nullptr;  ///< 1 or 0
};

/// Fills the planes from x, y, z of each pixel; a point whose z is NaN is not valid.
void splitPoints(const float* points, std::size_t width, const PointPlanes& planes);

struct NormalRow {
  const PointPlanes* rows = nullptr;  ///< 2 radius + 1 rows, the pixel's own in the middle
  const float* sigma = nullptr;       ///< of the depth, or null: 0
  int radius = 0;
  float min_points = 0.0f;
  float max_step_ratio = 0.0f;
  float max_step_sigmas = 0.0f;
  float* normals = nullptr;  ///< x, y, z of each pixel
};

void normalRow(const NormalRow& row, std::size_t width);

}  // namespace scanner::stereo::simd
