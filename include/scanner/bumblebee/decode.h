#pragma once

#include <array>
#include <cstdint>

#include "scanner/bumblebee/stereo_camera.h"
#include "scanner/core/image.h"
#include "scanner/core/status.h"

namespace scanner::bumblebee {

/// Brightness of one eye's raw picture, from a quarter of its rows (two neighbours of every eight,
/// so that all colours of a Bayer tile count): cheap, and plenty for metering.
struct EyeStatistics {
  std::array<std::uint32_t, 256> histogram{};  ///< of raw values; a Bayer tile has two greens in
                                               ///< four, so this is close to luma
  double mean_level = 0.0;                     ///< 0..1, linear as the sensor
  double saturated_share = 0.0;                ///< of pixels at 255, 0..1
};

/// Largest side of one eye that is believed; more is a broken format.
inline constexpr int kLargestSide_px = 16384;

/// The two pictures of one raw frame, as the sensors gave them: Bayer or mono, 8 bit. They are not
/// demosaiced here: the stereo stage does that for each eye by itself, so that no colour bleeds
/// from one eye into the other.
struct DecodedPair {
  Image left, right;
  std::array<EyeStatistics, 2> statistics;  ///< left, right
};

/// Takes the interleaved bytes apart. Embedded information (FrameFormat::embedded_timestamp and
/// _counter: the first 4 or 8 bytes, 2 or 4 pixels of each eye) is covered by the pixels of the
/// same colour two rows below. Errors: the frame's own status when it is not ok; kInvalidInput for
/// a buffer that is missing or not of exactly 2 * width * height bytes, or a format that cannot be
/// (size, odd size of a Bayer picture); kUnsupported for pixels other than mono or Bayer.
/// Time is that of the memory traffic: below 1 ms for 1024x768. Thread-safe.
Result<DecodedPair> decodeFrame(const RawFrame& frame, const FrameFormat& format);

/// Ok when frames of this format can be decoded; else as decodeFrame().
Status checkFormat(const FrameFormat& format);
/// Bytes of a frame of a format that checkFormat() accepts.
std::size_t frameBytes(const FrameFormat& format);

}  // namespace scanner::bumblebee
