#pragma once

#include <cstddef>

#include "scanner/core/image.h"
#include "scanner/stereo/options.h"
#include "scanner/stereo/rectify.h"

namespace scanner::stereo {

/// What each test removed, in pixels of the left image.
struct MatchStatistics {
  std::size_t pixels = 0;
  std::size_t untextured = 0;      ///< too little texture
  std::size_t ambiguous = 0;       ///< another disparity is nearly as good
  std::size_t matched = 0;         ///< with a disparity after these two tests
  std::size_t outside = 0;         ///< best match at or beyond the edge of the right image or range
  std::size_t back_and_forth = 0;  ///< left and right disparity disagree
  std::size_t refinement = 0;      ///< sub-pixel step did not settle, or left too much residual
  std::size_t precision = 0;       ///< sigma above the limit
  std::size_t surface = 0;         ///< on a piece that is too small
  std::size_t interpolated = 0;    ///< without disparity after all tests, and given a guess
  std::size_t valid = 0;
  std::size_t working_memory_bytes = 0;  ///< that the matcher may use at most
};

/// Disparity of the left image by the chosen method, validated and refined (thesis 2.1, table 3.1).
/// Columns on the left whose search range leaves the right image keep the part of the range that is
/// inside; a best match outside is no match. Throws ConfigurationError for options out of range or
/// a range wider than the image, std::invalid_argument for images of unequal size or wrong type.
///
/// Same bytes for any `threads` (>= 1) and any instruction set.
DisparityImage match(const RectifiedPair& pair, const MatcherOptions& options, int threads,
                     MatchStatistics* statistics = nullptr);

}  // namespace scanner::stereo
