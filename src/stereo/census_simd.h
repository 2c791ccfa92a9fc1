#pragma once

#include <cstdint>

namespace scanner::stereo::simd {

/// Census transform of one row (Zabih and Woodfill 1994): a bit per neighbour of the window, set
/// where it is darker than the centre; row by row, eight bits to a plane.
struct CensusRow {
  const std::uint8_t* const* rows = nullptr;  ///< window_height rows at column 0; readable from
                                              ///< -radius to width + radius + kRowSlack
  int width = 0;
  int radius_x = 0, radius_y = 0;
  bool mirrored = false;                  ///< the image is: take the window's columns right to left
  std::uint8_t* const* planes = nullptr;  ///< out, writable up to width + kRowSlack
};
constexpr int kRowSlack = 64;

/// Planes that a window needs.
constexpr int censusPlanes(int radius_x, int radius_y) {
  return ((2 * radius_x + 1) * (2 * radius_y + 1) - 1 + 7) / 8;
}

void censusRow(const CensusRow& row);

}  // namespace scanner::stereo::simd
