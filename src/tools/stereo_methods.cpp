#include "tools/stereo_methods.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "scanner/core/status.h"
#include "scanner/stereo/fill.h"
#include "scanner/stereo/match.h"
#include "tools/reference_matchers.h"

namespace scanner::tools {
namespace {

Reference referenceOf(const StereoMethod& method) {
  return method.block ? Reference::kBlock : Reference::kSemiGlobal;
}

stereo::RectifiedPair grayPair(const evaluation::StereoScene& scene) {
  stereo::RectifiedPair pair;
  cv::cvtColor(scene.left, pair.left_gray, cv::COLOR_BGR2GRAY);
  cv::cvtColor(scene.right, pair.right_gray, cv::COLOR_BGR2GRAY);
  pair.left_color = scene.left;
  return pair;
}

}  // namespace

StereoMethod stereoMethod(const std::string& name, int reference_window_px) {
  StereoMethod out;
  out.name = name;
  out.ours = name == "ours_block" || name == "ours_semi_global";
  out.block = name == "ours_block" || name == "bm";
  if (out.ours) {
    configure({}, "of all defaults", out);
    return out;
  }
  if (name != "bm" && name != "sgbm") {
    throw ConfigurationError("--methods: \"" + name +
                             "\" is none of ours_block, ours_semi_global, bm, sgbm");
  }
  out.window_px = reference_window_px;
  ReferenceOptions reference;
  reference.window_px = reference_window_px;
  out.settings = describeReference(referenceOf(out), reference);
  return out;
}

void configure(const stereo::MatcherOptions& options, const std::string& config,
               StereoMethod& method) {
  const bool block = method.block;
  method.options = options;
  method.options.method = block ? stereo::MatchMethod::kBlock : stereo::MatchMethod::kSemiGlobal;
  const int window = block ? options.block.window_px : options.semi_global.window_px;
  method.settings = std::string("scanner, method ") + (block ? "block" : "semi_global") +
                    ", window " + std::to_string(window) +
                    ", tests and refinement of the configuration " + config;
  if (options.interpolation.reach_px > 0.0) method.settings += ", holes filled";
}

StereoRun runStereo(const StereoMethod& method, const evaluation::StereoScene& scene, int threads,
                    int repetitions) {
  const stereo::RectifiedPair pair = grayPair(scene);
  stereo::MatcherOptions ours = method.options;
  ours.min_disparity_px = scene.min_disparity_px;
  ours.max_disparity_px = scene.max_disparity_px;
  ours.interpolation.reach_px = 0.0;  // afterwards: filling is in nobody's time
  ReferenceOptions reference;
  reference.min_disparity_px = scene.min_disparity_px;
  reference.max_disparity_px = scene.max_disparity_px;
  reference.window_px = method.window_px;

  StereoRun run;
  run.seconds = std::numeric_limits<double>::infinity();
  for (int i = 0; i < repetitions; ++i) {
    const auto start = std::chrono::steady_clock::now();
    if (method.ours) {
      DisparityImage image = stereo::match(pair, ours, threads);
      run.disparity = image.disparity_px;
      run.sigma = image.sigma_px;
    } else {
      run.disparity =
          matchReference(referenceOf(method), pair.left_gray, pair.right_gray, reference);
    }
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    run.seconds = std::min(run.seconds, taken.count());
  }
  const stereo::InterpolationOptions& interpolation = method.options.interpolation;
  if (method.ours && interpolation.reach_px > 0.0) {
    stereo::interpolate(pair.left_color, interpolation, threads, run.disparity, run.sigma);
  }
  const int disparities = scene.max_disparity_px - scene.min_disparity_px + 1;
  run.million_per_second =
      1e-6 * static_cast<double>(scene.truth.total()) * disparities / run.seconds;
  return run;
}

void fillRun(const evaluation::StereoScene& scene, int threads, StereoRun& run) {
  run.filled = stereo::fill(run.disparity, scene.left, threads);
}

}  // namespace scanner::tools
