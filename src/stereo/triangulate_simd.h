#pragma once

#include <cstddef>
#include <cstdint>

/// Kernels of triangulation, once per instruction set, each with the same bytes.
namespace scanner::stereo::simd {

/// One row of the disparity image and what its points need.
struct TriangulateRow {
  const float* disparity_px = nullptr;
  const float* sigma_px = nullptr;
  const double* column = nullptr;  ///< (u - cx) / f of each pixel
  double row = 0.0;                ///< (v - cy) / fy
  double offset_px = 0.0;          ///< of the disparity of a point at infinity
  double focal_baseline = 0.0;     ///< f B, px m
  double min_depth_m = 0.0;
  double max_depth_m = 0.0;
  float* points = nullptr;  ///< x, y, z of each pixel
  float* sigmas = nullptr;
};

void triangulateRow(const TriangulateRow& row, std::size_t width);

/// Blue, green, red to red, green, blue.
void swapRedAndBlue(const std::uint8_t* from, std::size_t pixels, std::uint8_t* to);

}  // namespace scanner::stereo::simd
