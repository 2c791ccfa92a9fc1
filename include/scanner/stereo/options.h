#pragma once

#include "scanner/core/options.h"

/// Options of the stereo stage, YAML block `stereo`. Defaults are the published settings (thesis
/// table 3.1 and section 4.2-4.3) wherever the thesis gives a value.
namespace scanner::stereo {

enum class MatchMethod { kBlock, kSemiGlobal };
enum class EdgeEnhancement { kBandPass, kSobel, kNone };
enum class SemiGlobalPaths { kFive, kEight };

/// Where the fraction of a pixel comes from.
enum class SubpixelRefinement {
  kNone,      ///< whole pixels
  kCostFit,   ///< two lines of equal slope through the costs, which are not drawn to whole pixels
  kGradient,  ///< least squares on the image gradient, continuous (refine.h has the derivation)
};

/// Sum of absolute differences over a square window, winner takes all (thesis table 2.1, 3.1).
struct BlockMatcherOptions {
  bool low_pass = true;
  int window_px = 13;
  int shift_px = 3;
  EdgeEnhancement edge_enhancement = EdgeEnhancement::kBandPass;
  int edge_mask_px = 9;
  int edge_limit = 31;
};

/// Semi-global matching: a cost per pixel and disparity, plus smoothness along image paths. The
/// cost is the number of bits in which the census transforms of the two windows differ, plus cut
/// differences of grey and gradient, all on one scale: one bit of the census. So are the penalties.
struct SemiGlobalOptions {
  int window_px = 5;
  int gray_limit = 6;
  int gradient_limit = 6;
  SemiGlobalPaths paths = SemiGlobalPaths::kFive;
  int small_step_penalty = 12;
  int large_step_penalty = 40;
  int edge_step_penalty = 14;
  int edge_contrast = 32;
};

struct RefinementOptions {
  SubpixelRefinement subpixel_refinement = SubpixelRefinement::kGradient;
  int window_px = 5;
  int smoothing_px = 9;
  int final_smoothing_px = 5;
  int iterations = 2;
  double max_correction_px = 1.0;
  double prefilter_sigma_px = 0.0;
  double image_noise = 1.0;
  double noise_gain = 0.38;
  double step_gain = 0.66;
  double roughness_gain = 0.64;
  double floor_px = 0.028;
  double tail_px = 0.4;
};

/// Every test can be switched off on its own. A pixel that fails one has no disparity.
struct ValidationOptions {
  bool texture = true;
  double texture_threshold = 1.0;
  bool uniqueness = true;
  double uniqueness_percent = 5.0;
  bool back_and_forth = true;
  double back_and_forth_tolerance_px = 1.0;
  bool residual = true;
  double max_residual_share = 0.4;
  bool precision = true;
  double max_sigma_px = 0.45;
  bool surface = true;
  double surface_step_px = 1.0;
  int surface_size_px = 200;
};

/// Guesses for pixels without disparity, for dense pictures. Surfaces are measured without them.
struct InterpolationOptions {
  double reach_px = 0.0;
  double sigma_px = 1.0;
};

struct MatcherOptions {
  MatchMethod method = MatchMethod::kBlock;
  int min_disparity_px = 100;
  int max_disparity_px = 330;
  BlockMatcherOptions block;
  SemiGlobalOptions semi_global;
  RefinementOptions refinement;
  ValidationOptions validation;
  InterpolationOptions interpolation;
};

enum class RangeMode { kFixed, kAutomatic };

/// Which disparities a frame is searched for (range_tracker.h).
struct RangeOptions {
  RangeMode mode = RangeMode::kFixed;
  int margin_px = 8;
  int memory_frames = 2;
  double min_matched_share = 0.02;
};

/// Bounds on the depth, besides those that the disparity range sets.
struct DepthOptions {
  double min_depth_m = 0.05;
  double max_depth_m = 100.0;
};

/// Normals from the image neighbourhood (thesis section 4.2).
struct NormalOptions {
  int window_px = 5;
  int min_points = 13;
  double max_step_ratio = 0.01;
  double max_step_sigmas = 3.0;
};

/// Removal of the ground and of outliers (thesis section 4.3), in the world frame.
struct ConditioningOptions {
  bool remove_ground = true;
  double ground_resolution_m = 0.015;
  double ground_sigmas = 2.0;
  /// Candidate bins that follow the lowest one without a gap are ground too. The published rule
  /// takes the lowest bin alone, and leaves a slab where the ground falls on the border of two
  /// bins.
  bool ground_spans_bins = false;
  double ground_max_share = 0.8;
  bool remove_outliers = true;
  double outlier_sigmas = 2.0;
  int min_points = 500;
};

struct StereoOptions {
  MatcherOptions matcher;
  RangeOptions range;
  DepthOptions depth;
  NormalOptions normals;
  ConditioningOptions conditioning;
};

void describe(OptionVisitor& v, BlockMatcherOptions& o);
void describe(OptionVisitor& v, SemiGlobalOptions& o);
void describe(OptionVisitor& v, RefinementOptions& o);
void describe(OptionVisitor& v, ValidationOptions& o);
void describe(OptionVisitor& v, InterpolationOptions& o);
void describe(OptionVisitor& v, MatcherOptions& o);
void describe(OptionVisitor& v, RangeOptions& o);
void describe(OptionVisitor& v, DepthOptions& o);
void describe(OptionVisitor& v, NormalOptions& o);
void describe(OptionVisitor& v, ConditioningOptions& o);
void describe(OptionVisitor& v, StereoOptions& o);

/// Checks what bounds on single values cannot: odd windows, min below max. Throws
/// ConfigurationError naming the option ("stereo.matcher.block.window_px"), its value and the
/// limit. match(), estimateNormals() and StereoProcessor call it for their part.
void validate(const MatcherOptions& o);
void validate(const DepthOptions& o);
void validate(const NormalOptions& o);
void validate(const ConditioningOptions& o);
void validate(const StereoOptions& o);

}  // namespace scanner::stereo
