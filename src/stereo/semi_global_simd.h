#pragma once

#include <cstddef>
#include <cstdint>

/// Kernels of semi-global matching, once per instruction set. Integers only, so every one of them
/// gives the same bytes. Cells of one pixel lie side by side, disparity ascending.
namespace scanner::stereo::simd {

/// Vectors of every instruction set divide this.
constexpr int kCellAlignment = 64;
/// Cost and path cost of a disparity that does not exist.
constexpr std::uint8_t kNoCost = 255;
/// Cost of a disparity whose match lies outside the right image: between that of a right match in a
/// noisy picture and that of a wrong one. The paths carry a surface on to where one eye alone sees
/// it, instead of taking whichever accidental match still lies inside.
constexpr std::uint8_t kOutsideCost = 15;
constexpr int kMaxCensusPlanes = 8;

/// Geometry that all kernels share.
struct CellLayout {
  int width = 0;          ///< pixels of a row
  int min_disparity = 0;  ///< of cell 0
  int count = 0;          ///< disparities
  int padded = 0;         ///< cells of a pixel: `count` rounded up to kCellAlignment
};

/// Descriptors of one row in both eyes. Right rows are mirrored (element i belongs to column
/// width - 1 - i) so that ascending disparity reads ascending memory, and go on for
/// min_disparity + padded elements past the left border of the image.
struct CostRow {
  const std::uint8_t* left_census[kMaxCensusPlanes] = {};
  const std::uint8_t* right_census[kMaxCensusPlanes] = {};
  int census_planes = 0;
  const std::uint8_t* left_value[2] = {};  ///< compared by their absolute difference
  const std::uint8_t* right_value[2] = {};
  int limit[2] = {};                            ///< of that difference
  const std::uint8_t* right_outside = nullptr;  ///< 0 inside the image, 255 past it
  const std::uint8_t* padding = nullptr;        ///< `padded` cells: 0 up to `count`, kNoCost after
  std::uint8_t* cost = nullptr;                 ///< out, width x padded
};

/// One family of parallel paths. Every path has a slot of slotStride() bytes, cells of kNoCost
/// around, that is updated in place while the sweep goes from row to row.
struct PathFamily {
  std::uint8_t* cells = nullptr;  ///< first slot
  std::uint8_t* least = nullptr;  ///< least cell of each slot
};

inline std::size_t slotStride(const CellLayout& layout) {
  return static_cast<std::size_t>(layout.padded) + kCellAlignment;
}

/// The paths of one row, and what they are summed into.
struct SweepRow {
  int direction = 1;       ///< of the horizontal path: +1 left to right, -1 right to left
  std::size_t step = 0;    ///< rows swept before this one in the strip
  bool from_above = true;  ///< besides the horizontal path, the three from the row before
  const std::uint8_t* cost = nullptr;
  const std::uint8_t* gray = nullptr;
  const std::uint8_t* previous_gray = nullptr;  ///< row before in the order of the sweep
  int small_step = 0;
  const std::uint8_t* large_step = nullptr;  ///< 256 penalties by difference of grey
  PathFamily horizontal;                     ///< one slot
  PathFamily vertical[3];  ///< predecessor at column x - 1, x, x + 1; `width` slots each
  const std::uint16_t* sums_in = nullptr;  ///< width x padded, or none
  std::uint16_t* sums_out = nullptr;       ///< width x padded, may be sums_in
};

/// Best disparity of each left and right pixel from the sums of all paths. A left pixel whose best
/// match lies outside the right image has none.
struct Selection {
  int paths = 0;
  int uniqueness_percent = -1;           ///< below 0: no test
  std::int16_t* index = nullptr;         ///< best cell, kNone or kAmbiguous
  std::uint16_t* around = nullptr;       ///< 3 x width: sums of the cells before, at and after it
  std::uint16_t* right_sum = nullptr;    ///< mirrored, width + min_disparity + padded
  std::uint16_t* right_index = nullptr;  ///< the like; best cell of each right pixel
};
constexpr std::int16_t kNone = -1;
constexpr std::int16_t kAmbiguous = -2;

void costRow(const CellLayout& layout, const CostRow& row);
/// Selects where `selection` is given, in the same pass; from right to left only. Of equal sums,
/// left pixels take the smallest disparity and right pixels the largest.
void sweepRow(const CellLayout& layout, const SweepRow& row, const Selection* selection);

}  // namespace scanner::stereo::simd
