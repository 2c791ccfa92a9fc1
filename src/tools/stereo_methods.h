#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "scanner/evaluation/stereo_evaluation.h"
#include "scanner/stereo/options.h"

/// What evaluate_stereo compares.
namespace scanner::tools {

struct StereoMethod {
  std::string name;                ///< as on the command line
  bool ours = false;               ///< through scanner::stereo::match, or OpenCV's
  bool block = false;              ///< block or semi-global matching
  int window_px = 0;               ///< of OpenCV's; 0: their default
  stereo::MatcherOptions options;  ///< of ours, but for the range
  std::string settings;            ///< one line
};

/// ours_block, ours_semi_global, bm, sgbm. `reference_window_px`: of OpenCV's, 0: their default.
/// Ours have the default options. Throws ConfigurationError for another name.
StereoMethod stereoMethod(const std::string& name, int reference_window_px);

/// Gives one of ours the options, but for method and range, of the configuration named `config`.
void configure(const stereo::MatcherOptions& options, const std::string& config,
               StereoMethod& method);

struct StereoRun {
  cv::Mat disparity;                ///< CV_32FC1, px, NaN = none
  cv::Mat sigma;                    ///< CV_32FC1, px; empty for OpenCV's
  cv::Mat filled;                   ///< CV_32FC1, px; empty before fillRun()
  double seconds = 0.0;             ///< wall time without filling holes, best of the repetitions
  double million_per_second = 0.0;  ///< pixels times disparities of the scene's range
};

/// Searches the scene's range.
StereoRun runStereo(const StereoMethod& method, const evaluation::StereoScene& scene, int threads,
                    int repetitions);

/// Fills the disparity, the same way for every method, so that what is compared is the matching.
void fillRun(const evaluation::StereoScene& scene, int threads, StereoRun& run);

}  // namespace scanner::tools
