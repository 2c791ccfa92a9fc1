#include "scanner/stereo/options.h"

#include <string>

namespace scanner::stereo {
namespace {

void requireOdd(int value, const char* name) {
  if (value % 2 == 1) return;
  throw ConfigurationError(std::string("stereo.") + name + " = " + std::to_string(value) +
                           " must be odd");
}

}  // namespace

void describe(OptionVisitor& v, BlockMatcherOptions& o) {
  v.option("low_pass", o.low_pass, "smooth both images (3x3) before matching");
  v.option("window_px", o.window_px, {5, 51}, "px",
           "side of the square window that the absolute differences are summed over; odd");
  v.option("shift_px", o.shift_px, {0, 25}, "px",
           "the window may also lie this far to the left or right of its pixel, where that fits "
           "better: keeps edges of depth in place; 0 is off");
  v.choice<EdgeEnhancement>(
      "edge_enhancement", o.edge_enhancement,
      {{"band_pass", EdgeEnhancement::kBandPass},
       {"sobel", EdgeEnhancement::kSobel},
       {"none", EdgeEnhancement::kNone}},
      "filter before matching: band_pass subtracts the mean of the edge mask, sobel takes the "
      "horizontal gradient");
  v.option("edge_mask_px", o.edge_mask_px, {5, 255}, "px",
           "side of the mask of the band-pass filter; odd");
  v.option(
      "edge_limit", o.edge_limit, {1, 63}, "",
      "filtered grey values (quarter grey levels for band_pass) are cut at plus and minus this; "
      "differences also at 65534 / window_px^2 and 127");
}

void describe(OptionVisitor& v, SemiGlobalOptions& o) {
  v.option("window_px", o.window_px, {3, 7}, "px",
           "side of the window of the census transform; odd");
  v.option("gray_limit", o.gray_limit, {0, 50}, "census bits",
           "most that half the difference of the grey levels adds to the cost; 0 is off");
  v.option("gradient_limit", o.gradient_limit, {0, 50}, "census bits",
           "most that twice the difference of the slopes, in grey levels per pixel, adds to the "
           "cost; 0 is off");
  v.choice<SemiGlobalPaths>(
      "paths", o.paths, {{"five", SemiGlobalPaths::kFive}, {"eight", SemiGlobalPaths::kEight}},
      "directions that smoothness is summed along: five come from left, right and above; eight "
      "take twice the time and more memory");
  v.option("small_step_penalty", o.small_step_penalty, {1, 100}, "census bits",
           "cost of a step of 1 px between neighbours: slanted surfaces");
  v.option("large_step_penalty", o.large_step_penalty, {2, 100}, "census bits",
           "cost of a larger step; above small_step_penalty");
  v.option("edge_step_penalty", o.edge_step_penalty, {1, 100}, "census bits",
           "the least that a larger step costs, where the grey changes much");
  v.option("edge_contrast", o.edge_contrast, {1, 255}, "grey levels",
           "change of grey between neighbours at which large_step_penalty would have gone to 0");
}

void describe(OptionVisitor& v, RefinementOptions& o) {
  v.choice<SubpixelRefinement>(
      "subpixel_refinement", o.subpixel_refinement,
      {{"none", SubpixelRefinement::kNone},
       {"cost_fit", SubpixelRefinement::kCostFit},
       {"gradient", SubpixelRefinement::kGradient}},
      "none: whole pixels; cost_fit: two lines of equal slope through the costs; "
      "gradient: least squares on the image gradient");
  v.option("window_px", o.window_px, {3, 51}, "px", "side of the least-squares window; odd");
  v.option(
      "smoothing_px", o.smoothing_px, {1, 31}, "px",
      "side of the window that each step's start is averaged over, planes kept; odd, 1 is off");
  v.option("final_smoothing_px", o.final_smoothing_px, {1, 31}, "px",
           "side of the window that the result is averaged over, planes kept; odd, 1 is off");
  v.option("iterations", o.iterations, {1, 10}, "", "least-squares steps");
  v.option("max_correction_px", o.max_correction_px, {0.1, 5.0}, "px",
           "pixels that move further from their match are dropped");
  v.option("prefilter_sigma_px", o.prefilter_sigma_px, {0.0, 3.0}, "px",
           "Gaussian on the images before the least squares, against aliasing; 0 is off");
  v.option("image_noise", o.image_noise, {0.0, 50.0}, "grey levels",
           "least noise of the difference of the filtered images, for sigma");
  v.option("noise_gain", o.noise_gain, {0.0, 100.0}, "",
           "for sigma: part of a window's noise that is left after smoothing");
  v.option("step_gain", o.step_gain, {0.0, 100.0}, "",
           "for sigma: part of the mean square over the window of what the last step moved");
  v.option(
      "roughness_gain", o.roughness_gain, {0.0, 100.0}, "",
      "for sigma: part of the mean square over the window of what the last smoothing took off");
  v.option("floor_px", o.floor_px, {0.0, 1.0}, "px",
           "error that more texture does not lessen: alignment of the two images");
  v.option("tail_px", o.tail_px, {0.01, 100.0}, "px",
           "for sigma: where the three parts make this, wrong pixels among them add as much again");
}

void describe(OptionVisitor& v, ValidationOptions& o) {
  v.option("texture", o.texture, "drop pixels without texture");
  v.option("texture_threshold", o.texture_threshold, {0.0, 60.0}, "grey levels",
           "least mean absolute value of the filtered image over the window");
  v.option("uniqueness", o.uniqueness, "drop pixels whose second-best match is nearly as good");
  v.option("uniqueness_percent", o.uniqueness_percent, {0.0, 100.0}, "%",
           "by how much the second-best match must be worse");
  v.option("back_and_forth", o.back_and_forth,
           "drop pixels whose match in the right image leads back to another pixel");
  v.option("back_and_forth_tolerance_px", o.back_and_forth_tolerance_px, {0.0, 10.0}, "px",
           "difference of the two disparities that is let through");
  v.option("residual", o.residual,
           "drop pixels whose surroundings do not look alike in both images at the refined "
           "disparity (needs subpixel_refinement gradient)");
  v.option("max_residual_share", o.max_residual_share, {0.0, 1.0}, "",
           "part of the window's variance that may remain, besides noise");
  v.option("precision", o.precision,
           "drop pixels whose disparity is too uncertain (needs "
           "subpixel_refinement gradient)");
  v.option("max_sigma_px", o.max_sigma_px, {0.01, 10.0}, "px",
           "largest standard deviation of a disparity");
  v.option("surface", o.surface, "drop small pieces of surface");
  v.option("surface_step_px", o.surface_step_px, {0.0, 100.0}, "px",
           "neighbours whose disparities differ by no more belong to one surface");
  v.option("surface_size_px", o.surface_size_px, {1, 10000000}, "px",
           "pixels that a surface must cover; a quarter of it after the later tests");
}

void describe(OptionVisitor& v, InterpolationOptions& o) {
  v.option("reach_px", o.reach_px, {0.0, 10000.0}, "px",
           "pixels without disparity this near to one that has some take a guess from their "
           "surroundings: for dense pictures, not for measuring; slow; 0 is off");
  v.option("sigma_px", o.sigma_px, {0.01, 100.0}, "px",
           "standard deviation of a guess, for each pixel that it lies from a match");
}

void describe(OptionVisitor& v, MatcherOptions& o) {
  v.choice<MatchMethod>("method", o.method,
                        {{"block", MatchMethod::kBlock}, {"semi_global", MatchMethod::kSemiGlobal}},
                        "block: absolute differences over a window; semi_global: with smoothness");
  v.option("min_disparity_px", o.min_disparity_px, {0, 2000}, "px",
           "least disparity searched: the far end");
  v.option("max_disparity_px", o.max_disparity_px, {1, 2000}, "px",
           "largest disparity searched: the near end; below the image's width");
  v.group("block", o.block, "method block");
  v.group("semi_global", o.semi_global, "method semi_global");
  v.group("refinement", o.refinement, "fraction of a pixel");
  v.group("validation", o.validation, "tests that drop pixels");
  v.group("interpolation", o.interpolation, "guesses where no disparity is left");
}

void describe(OptionVisitor& v, RangeOptions& o) {
  v.choice<RangeMode>("mode", o.mode,
                      {{"fixed", RangeMode::kFixed}, {"automatic", RangeMode::kAutomatic}},
                      "fixed: every frame is searched from min_disparity_px to max_disparity_px; "
                      "automatic: within these, what a quick look at the frame and the last frames "
                      "show");
  v.option("margin_px", o.margin_px, {0, 200}, "px",
           "searched beyond what was seen, on either end");
  v.option("memory_frames", o.memory_frames, {0, 100}, "",
           "earlier frames whose disparities stay in the range; 0: every frame for itself");
  v.option("min_matched_share", o.min_matched_share, {0.0, 1.0}, "",
           "a quick look that matches less of the picture is not trusted: the whole range");
}

void describe(OptionVisitor& v, DepthOptions& o) {
  v.option("min_depth_m", o.min_depth_m, {1e-3, 1e4}, "m", "nearer points are dropped");
  v.option("max_depth_m", o.max_depth_m, {1e-3, 1e4}, "m", "further points are dropped");
}

void describe(OptionVisitor& v, NormalOptions& o) {
  v.option("window_px", o.window_px, {3, 31}, "px",
           "side of the window that a plane is fitted to; odd");
  v.option("min_points", o.min_points, {3, 961}, "", "points that the window must hold");
  v.option("max_step_ratio", o.max_step_ratio, {1e-4, 1.0}, "",
           "a neighbour may differ in depth by this part of the depth per pixel of distance");
  v.option("max_step_sigmas", o.max_step_sigmas, {0.0, 100.0}, "",
           "and by this many standard deviations of the depth");
}

void describe(OptionVisitor& v, ConditioningOptions& o) {
  v.option("remove_ground", o.remove_ground, "drop the ground plane");
  v.option("ground_resolution_m", o.ground_resolution_m, {1e-4, 10.0}, "m",
           "bin of the histogram of heights; the ground is dropped within plus and minus this");
  v.option("ground_sigmas", o.ground_sigmas, {0.0, 100.0}, "",
           "a bin this many standard deviations above the median count may be the ground");
  v.option("ground_spans_bins", o.ground_spans_bins,
           "candidate bins next to the lowest one belong to the ground (eq. 4.4 takes one bin)");
  v.option("ground_max_share", o.ground_max_share, {0.0, 1.0}, "",
           "a level that holds more of the points is the subject, not the ground; 1 is off");
  v.option("remove_outliers", o.remove_outliers, "drop points far from the median in x or y");
  v.option("outlier_sigmas", o.outlier_sigmas, {0.1, 100.0}, "",
           "how far, in standard deviations of the axis");
  v.option("min_points", o.min_points, {3, 100000000}, "",
           "a view with fewer points is not registered");
}

void describe(OptionVisitor& v, StereoOptions& o) {
  v.group("matcher", o.matcher, "disparity");
  v.group("range", o.range, "which of the matcher's disparities each frame is searched for");
  v.group("depth", o.depth, "bounds on the depth");
  v.group("normals", o.normals, "surface normals");
  v.group("conditioning", o.conditioning, "ground and outliers");
}

void validate(const MatcherOptions& o) {
  requireOdd(o.block.window_px, "matcher.block.window_px");
  requireOdd(o.block.edge_mask_px, "matcher.block.edge_mask_px");
  requireOdd(o.semi_global.window_px, "matcher.semi_global.window_px");
  requireOdd(o.refinement.window_px, "matcher.refinement.window_px");
  requireOdd(o.refinement.smoothing_px, "matcher.refinement.smoothing_px");
  requireOdd(o.refinement.final_smoothing_px, "matcher.refinement.final_smoothing_px");
  if (o.min_disparity_px < 0 || o.min_disparity_px >= o.max_disparity_px) {
    throw ConfigurationError(
        "stereo.matcher.min_disparity_px = " + std::to_string(o.min_disparity_px) +
        " must be at least 0 and below max_disparity_px = " + std::to_string(o.max_disparity_px));
  }
  if (o.semi_global.small_step_penalty >= o.semi_global.large_step_penalty) {
    throw ConfigurationError(
        "stereo.matcher.semi_global.small_step_penalty = " +
        std::to_string(o.semi_global.small_step_penalty) +
        " must be below large_step_penalty = " + std::to_string(o.semi_global.large_step_penalty));
  }
}

void validate(const DepthOptions& o) {
  if (o.min_depth_m > 0.0 && o.min_depth_m < o.max_depth_m) return;
  throw ConfigurationError(
      "stereo.depth.min_depth_m = " + std::to_string(o.min_depth_m) +
      " must be positive and below max_depth_m = " + std::to_string(o.max_depth_m));
}

void validate(const NormalOptions& o) {
  requireOdd(o.window_px, "normals.window_px");
  if (o.min_points >= 3 && o.min_points <= o.window_px * o.window_px) return;
  throw ConfigurationError("stereo.normals.min_points = " + std::to_string(o.min_points) +
                           " must be at least 3 and fit into the window of " +
                           std::to_string(o.window_px * o.window_px) + " pixels");
}

void validate(const ConditioningOptions& o) {
  if (o.ground_resolution_m > 0.0) return;
  throw ConfigurationError("stereo.conditioning.ground_resolution_m = " +
                           std::to_string(o.ground_resolution_m) + " must be positive");
}

void validate(const StereoOptions& o) {
  validate(o.matcher);
  validate(o.depth);
  validate(o.normals);
  validate(o.conditioning);
}

}  // namespace scanner::stereo
