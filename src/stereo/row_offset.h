#pragma once

#include "stereo/coarse.h"

namespace scanner::stereo {

/// By how much corresponding points of a pair that matches are off the same row.
struct RowOffset {
  int blocks = 0;          ///< that a measurement comes from; 0: none could be made
  double median_px = 0.0;  ///< px of the full size; positive: lower in the right image
  double worst_px = 0.0;   ///< of a plane through the blocks, where it is largest in the image
};

/// Least squares on the grey of both pictures, block by block, for a shift in x and y besides the
/// disparity that was found (Lucas and Kanade 1981), then a plane over the image through the shifts
/// in y: offset, rotation and difference of scale.
RowOffset measureRowOffset(const CoarsePair& pair, const CoarseMatch& match);

}  // namespace scanner::stereo
