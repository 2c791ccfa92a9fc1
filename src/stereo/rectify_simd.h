#pragma once

#include <cstddef>
#include <cstdint>

/// Kernels of rectification, once per instruction set. Integers only, so every one of them gives
/// the same bytes. A kernel may write up to kRectifyOverrun elements beyond `count`, and read as
/// far.
namespace scanner::stereo::simd {

constexpr std::size_t kRectifyOverrun = 64;
constexpr int kPhaseBits = 10;  ///< positions are in steps of 1/1024 px
constexpr int kPhases = 1 << kPhaseBits;

/// Grey of the mosaic, whatever the colour of the site: 3x3 binomial, in sixteenths.
void binomialRow(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* below,
                 std::size_t count, std::uint16_t* gray);
void scaleMonoRow(const std::uint8_t* mono, std::size_t count, std::uint16_t* gray);
/// ITU-R BT.601 luma in sixteenths, and the colour in four bytes.
void splitBgrRow(const std::uint8_t* bgr, std::size_t count, std::uint16_t* gray,
                 std::uint8_t* bgrx);
/// Sixteenths to whole grey levels.
void roundGrayRow(const std::uint16_t* gray, std::size_t count, std::uint8_t* to);

/// Green at every site of the row rows[2] (Hamilton and Adams): along the direction of smaller
/// change, with the second difference of the site's own colour. Reads two pixels to either side.
void greenRow(const std::uint8_t* const rows[5], std::size_t count, bool green_first,
              std::int16_t* green);
/// Twice the difference of the row's other colour and green, interpolated along the row. Reads one
/// pixel to either side.
void chromaRow(const std::uint8_t* raw, const std::int16_t* green, std::size_t count,
               std::int16_t* chroma);
/// Colour of a row from its green and the chroma of its own and of the neighbouring rows.
void mixRow(const std::int16_t* green, const std::int16_t* above, const std::int16_t* own,
            const std::int16_t* below, std::size_t count, bool red_row, std::uint8_t* bgrx);

/// Where a row of the rectified image lies in padded planes of the raw one.
struct ResampleRow {
  const std::int32_t* index = nullptr;   ///< of the pixel left of and above the position, rounded
                                         ///< down, less one pixel and one row
  const std::uint32_t* phase = nullptr;  ///< of x, and of y times 2^16
  std::size_t stride = 0;                ///< pixels
};

/// Weights of four taps for each phase, in 1/2^14, as two pairs of 16 bits.
struct CubicWeights {
  std::int32_t first[kPhases];
  std::int32_t second[kPhases];
};

void cubicGrayRow(const ResampleRow& row, const CubicWeights& weights, const std::uint16_t* gray,
                  std::size_t count, std::uint8_t* to);
/// Bilinear; black where `valid` is 0.
void bilinearColorRow(const ResampleRow& row, const std::uint8_t* bgrx, const std::uint8_t* valid,
                      std::size_t count, std::uint8_t* to_bgrx);

/// Exact: nothing is written beyond 3 * count.
void packBgrRow(const std::uint8_t* bgrx, std::size_t count, std::uint8_t* bgr);
void replicateGrayRow(const std::uint8_t* gray, std::size_t count, std::uint8_t* bgr);

}  // namespace scanner::stereo::simd
