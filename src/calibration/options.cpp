#include <cmath>

#include "scanner/calibration/stereo_calibration.h"

namespace scanner::calibration {

void validate(const Board& board) {
  if (board.columns < 3 || board.rows < 3) {
    throw ConfigurationError("board of " + std::to_string(board.columns) + "x" +
                             std::to_string(board.rows) +
                             " inner corners: at least 3x3 are needed");
  }
  if (!std::isfinite(board.square_m) || board.square_m <= 0.0) {
    throw ConfigurationError("side of a square = " + std::to_string(board.square_m) +
                             " m must be positive");
  }
  if (!std::isfinite(board.square_height_m) || board.square_height_m < 0.0) {
    throw ConfigurationError("height of a square = " + std::to_string(board.square_height_m) +
                             " m must not be negative");
  }
}

const char* toString(Distortion distortion) {
  switch (distortion) {
    case Distortion::kAutomatic:
      return "automatic";
    case Distortion::kK1:
      return "k1";
    case Distortion::kK1K2:
      return "k1_k2";
    case Distortion::kK1K2P1P2:
      return "k1_k2_p1_p2";
    case Distortion::kK1K2P1P2K3:
      return "k1_k2_p1_p2_k3";
    case Distortion::kRationalP1P2:
      return "rational";
  }
  return "unknown";
}

void describe(OptionVisitor& v, StereoCalibrationOptions& o) {
  v.choice<Distortion>("distortion", o.distortion,
                       {{"automatic", Distortion::kAutomatic},
                        {"k1", Distortion::kK1},
                        {"k1_k2", Distortion::kK1K2},
                        {"k1_k2_p1_p2", Distortion::kK1K2P1P2},
                        {"k1_k2_p1_p2_k3", Distortion::kK1K2P1P2K3},
                        {"rational", Distortion::kRationalP1P2}},
                       "lens distortion; automatic takes the simplest that held-out views support");
  v.option("corner_window_share", o.corner_window_share, {0.05, 0.45}, "squares",
           "half the window that a corner is refined in, by the smallest square in the picture");
  v.option("min_views", o.min_views, {3, 1000}, "", "fewer different views are refused");
  v.option("min_tilt_deg", o.min_tilt_deg, {1.0, 90.0}, "deg",
           "largest angle between two boards; less is refused");
  v.option("min_coverage", o.min_coverage, {0.0, 1.0}, "",
           "share of either picture inside the hull of all corners; less is refused");
  v.option("min_gain_sigmas", o.min_gain_sigmas, {0.0, 20.0}, "sigma",
           "a richer distortion model must lower the held-out error by this many standard errors");
  v.option("min_gain", o.min_gain, {0.0, 0.9}, "",
           "and by this share; five times as much for the rational model");
  v.option("outlier_factor", o.outlier_factor, {1.5, 100.0}, "",
           "a view is left out when it misses the calibration from the others by this many times "
           "their error");
  v.option("outlier_min_px", o.outlier_min_px, {0.0, 100.0}, "px", "and by this");
  v.option("max_left_out_share", o.max_left_out_share, {0.0, 0.5}, "",
           "when more views than this share would be left out, the whole is refused");
  v.option("kept_share", o.kept_share, {0.5, 1.0}, "",
           "share of each raw picture that should stay in the rectified one");
  v.option("max_focal_change", o.max_focal_change, {0.0, 0.5}, "",
           "the rectified focal length stays this close to the original, even if less is kept");
}

}  // namespace scanner::calibration
