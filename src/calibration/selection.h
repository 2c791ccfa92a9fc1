#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/stereo_fit.h"

/// Choice of the distortion model and of the views, by how calibrations fit views that they were
/// not made from.
namespace scanner::calibration {

/// A model fitted to all views, and to the views without one group at a time.
struct Candidate {
  StereoFit fit;
  std::vector<StereoFit> without;  ///< one per group: view i is in group i % groups
  std::vector<double> held_out;    ///< px^2 per view, under the fit without its group
  double corner_sigma_px = 0.0;

  double heldOutPx() const;
};

/// Standard deviation of a value from its values without one group at a time (delete-group
/// jackknife).
double jackknifeSigma(const std::vector<double>& values);

/// `fit` is of all views. Nothing when a fit without a group breaks down.
std::optional<Candidate> crossValidate(const Views& views, const Board& board, cv::Size size,
                                       const StereoFit& fit, int threads);

struct Choice {
  Candidate chosen;
  std::vector<ModelScore> scores;
};

/// See calibrateStereo(). kNoConvergence when no model can be taken.
Result<Choice> chooseModel(const Views& views, const Board& board, cv::Size size,
                           const StereoCalibrationOptions& options, int threads);

struct LeftOut {
  std::size_t index;  ///< of the view in `views`
  double miss_px;     ///< its error under the calibration from the others
  double others_px;   ///< theirs
};

/// The view that all others disagree with, if there is one.
std::optional<LeftOut> findOutlier(const Views& views, const Board& board, cv::Size size,
                                   const StereoFit& fit, const StereoCalibrationOptions& options,
                                   int threads);

}  // namespace scanner::calibration
