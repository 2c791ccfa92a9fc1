#pragma once

#include <cstdint>

/// Row kernels of the sub-pixel refinement. One row of floats each; every row that is read or
/// written has kRowPad floats of room on both sides, and NaN means: no disparity. Lanes never mix,
/// so the bytes are the same on every instruction set.
namespace scanner::stereo::simd {

constexpr int kRowPad = 64;

/// Window sums of the least-squares problem e = g delta + gain r + offset.
enum RefineTerm { kCount, kG, kR, kE, kGG, kGR, kRR, kGE, kRE, kEE, kRefineTerms };

/// Mean over the pairs of pixels of one surface that lie opposite each other, `radius` to each
/// side: along the row, or across the 2 radius + 1 rows whose middle one is the centre.
void smoothAlong(const float* in, int width, int radius, float* out);
void smoothAcross(const float* const* rows, int width, int radius, float* out);

/// Gradient, warped right grey and difference of every pixel at its own disparity, multiplied out.
/// `right` is NaN where it must not be used. Pixels that have no disparity, or whose match lies
/// outside, give zeros.
void warpRow(const float* disparity, const float* left, const float* right, int width,
             float* const* terms);

/// Sums of `term_count` terms over a column of the window: `rows[term * window + i]` are the rows.
void sumAcross(const float* const* rows, int term_count, int window, int width, float* const* sums);

struct SolveRow {
  const float* const* sums = nullptr;  ///< kRefineTerms rows, summed across
  const float* disparity = nullptr;    ///< start of the step
  int width = 0;
  int window = 0;
  float min_count = 0.0f;
  float max_step = 0.0f;
  float noise_variance = 0.0f;      ///< least variance of L - R, grey levels^2
  float max_residual = 0.0f;        ///< most of it, besides ...
  float max_residual_share = 0.0f;  ///< ... this part of the contrast
  float* next = nullptr;            ///< disparity after the step
  float* variance = nullptr;        ///< or nullptr: what the noise makes of the step, px^2;
                                    ///< NaN where the residual is above its limit
  float* step = nullptr;            ///< with variance: the step, px
};

/// The window's solution of every pixel; NaN where the window holds too little.
void solveRow(const SolveRow& row);

/// What the last step and the last smoothing moved: `terms` are whether the pixel counts, the
/// square of the step, the square of the change.
void roughnessRow(const float* step, const float* before, const float* after, int width,
                  float* const* terms);
constexpr int kRoughnessTerms = 3;

struct FinishRow {
  const float* const* sums = nullptr;  ///< kRoughnessTerms rows, summed across
  const float* variance = nullptr;     ///< of solveRow
  const float* start = nullptr;        ///< disparity of the matcher
  const float* refined = nullptr;
  int width = 0;
  int window = 0;
  float noise_gain = 0.0f, step_gain = 0.0f, roughness_gain = 0.0f;
  float floor_variance = 0.0f;  ///< px^2
  float inverse_tail = 0.0f;    ///< 1 / tail_px^2
  float max_correction = 0.0f;  ///< px
  float* disparity = nullptr;   ///< result, NaN where it is given up
  float* sigma = nullptr;       ///< likewise
};

void finishRow(const FinishRow& row);

}  // namespace scanner::stereo::simd
