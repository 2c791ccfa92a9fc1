#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "scanner/core/image.h"

namespace scanner::stereo {

/// A raw picture made ready for resampling: grey and colour of every pixel, with the edge repeated
/// round it.
struct RawPlanes {
  static constexpr int kPadding = 4;  ///< pixels on every side that may be read
  std::size_t stride = 0;             ///< pixels from row to row
  std::vector<std::uint16_t> gray;    ///< in sixteenths of a grey level
  std::vector<std::uint8_t> bgrx;     ///< four bytes a pixel; empty when not wanted, or grey

  static std::size_t strideFor(int width);
  /// Of pixel (u, v), each from -kPadding to below the size plus kPadding.
  std::size_t index(int u, int v) const {
    return static_cast<std::size_t>(v + kPadding) * stride + static_cast<std::size_t>(u + kPadding);
  }
};

/// Grey is what the matching works on (see Rectifier), colour is demosaiced: green along the
/// direction of smaller change (Hamilton and Adams, US patent 5629734, expired), red and blue by
/// their difference from green. `image` must be well formed. Same bytes for any `threads`.
RawPlanes makePlanes(const Image& image, bool color, int threads);

}  // namespace scanner::stereo
