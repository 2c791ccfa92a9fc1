#pragma once

#include <cstddef>
#include <cstdint>

/// Kernels of block matching, once per instruction set. Integers only, so every one of them gives
/// the same bytes. A cell is a disparity of a pixel; those of one pixel lie side by side,
/// ascending.
namespace scanner::stereo::simd {

/// Vectors of every instruction set divide this.
constexpr int kBlockAlignment = 32;
/// Cost of a cell that does not exist.
constexpr std::uint16_t kNoBlockCost = 65535;
/// Columns that are matched before the right image's best disparities are brought up to date.
constexpr int kBlockColumns = 16;

struct BlockLayout {
  int width = 0;          ///< pixels of a row
  int min_disparity = 0;  ///< of cell 0
  int count = 0;          ///< disparities
  int padded = 0;         ///< cells of a pixel: `count` rounded up to kBlockAlignment
  int radius = 0;         ///< of the window
  int shift = 0;     ///< the window's centre may lie this far to the left or right; 0: it may not
  bool cut = false;  ///< cut absolute differences at `limit`; otherwise they are below 128
  int limit = 0;
};

/// Sizes of the buffers of BlockRow, elements.
std::size_t columnSums(const BlockLayout& layout);
std::size_t windowSums(const BlockLayout& layout);
std::size_t costCells(const BlockLayout& layout);
std::size_t rightCells(const BlockLayout& layout);
std::size_t rightRowSize(const BlockLayout& layout);

/// One row of windows. Right rows are mirrored (element i belongs to column width - 1 - i), so that
/// ascending disparity reads ascending memory, and hold rightRowSize() elements.
struct BlockRow {
  const std::uint8_t* left_in = nullptr;  ///< image row that enters the window
  const std::uint8_t* right_in = nullptr;
  const std::uint8_t* left_out = nullptr;  ///< image row that leaves it
  const std::uint8_t* right_out = nullptr;
  std::uint16_t* columns = nullptr;     ///< sums over the window's height of each column, kept
  std::uint16_t* windows = nullptr;     ///< scratch: window sums of the last columns
  std::uint16_t* costs = nullptr;       ///< scratch: costs of the columns of one block
  int uniqueness = -1;                  ///< share of the best cost, in 1 / 65536; below 0: no test
  std::int16_t* best = nullptr;         ///< out: best cell of each pixel, or -1
  std::uint16_t* around = nullptr;      ///< out: 3 x width, costs of the cells before, at, after it
  std::uint8_t* ambiguous = nullptr;    ///< out: 1 where a distant cell is nearly as good
  std::uint16_t* right_cost = nullptr;  ///< out: least cost of each right pixel
  std::uint16_t* right_column = nullptr;  ///< out: the left column that it belongs to
};

/// Element of right_cost and right_column that belongs to right pixel x.
inline std::size_t rightElement(const BlockLayout& layout, int x) {
  return static_cast<std::size_t>(layout.width - 1 - layout.min_disparity - x);
}

/// Brings the column sums up to date, and nothing else.
void slideColumns(const BlockLayout& layout, const BlockRow& row);
/// The same, and matches the row.
void matchRow(const BlockLayout& layout, const BlockRow& row);

}  // namespace scanner::stereo::simd
