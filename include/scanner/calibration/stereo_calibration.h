#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "scanner/core/camera.h"
#include "scanner/core/options.h"
#include "scanner/core/status.h"

/// Intrinsics and extrinsics of a stereo camera from pictures of a flat chessboard: Zhang, "A
/// flexible new technique for camera calibration", PAMI 2000: corners, first guess and lens model
/// by OpenCV, the bundle adjustment our own (the minimum of cv::stereoCalibrate, the same bytes on
/// every run), with the choice of the distortion model, the search for bad views and the
/// uncertainty on top.
///
/// All functions are pure, may be called from several threads and give the same bytes on any number
/// of threads.
namespace scanner::calibration {

/// A chessboard counted in inner corners: 5x7 squares have 4x6. Board frame: x along a row of
/// corners, y along a column, origin at the first corner, z = 0.
struct Board {
  int columns = 0;        ///< corners in a row, at least 3
  int rows = 0;           ///< rows, at least 3
  double square_m = 0.0;  ///< side of one square, along a row
  /// Along a column; 0: the same. Printers stretch paper: calibrateStereo() warns when the cameras
  /// seem to have oblong pixels, for no usual sensor has.
  double square_height_m = 0.0;

  double squareHeight() const { return square_height_m > 0.0 ? square_height_m : square_m; }
};

/// Throws ConfigurationError for less than 3x3 corners or a side of a square that is not possible.
void validate(const Board& board);

/// Lens distortion, in the order of complexity. All are special cases of OpenCV's model and are
/// written as plumb_bob (k1 k2 p1 p2 k3) or rational_polynomial (and k4 k5 k6).
enum class Distortion {
  kAutomatic,   ///< the simplest that the pictures support, see calibrateStereo()
  kK1,          ///< k1
  kK1K2,        ///< k1 k2
  kK1K2P1P2,    ///< and decentring
  kK1K2P1P2K3,  ///< plumb_bob in full
  /// k1 k2 over k4 k5, and decentring. Not k3 and k6: a third pair fits poles beside zeros, rings
  /// of nonsense that no corner happens to see.
  kRationalP1P2,
};

/// "k1", "k1_k2", "k1_k2_p1_p2", "k1_k2_p1_p2_k3", "rational", "automatic".
const char* toString(Distortion distortion);

struct StereoCalibrationOptions {
  Distortion distortion = Distortion::kAutomatic;
  double corner_window_share = 0.35;
  int min_views = 5;
  double min_tilt_deg = 15.0;
  double min_coverage = 0.15;
  double min_gain_sigmas = 2.0;
  double min_gain = 0.02;
  double outlier_factor = 4.0;
  double outlier_min_px = 0.3;
  double max_left_out_share = 0.25;
  double kept_share = 0.95;
  double max_focal_change = 0.15;
};

void describe(OptionVisitor& v, StereoCalibrationOptions& o);

/// One board seen by both eyes: corner i of `left` is corner i of `right`, columns * rows of each,
/// row by row, raw pixels (centre of the first pixel is 0, 0).
struct BoardObservation {
  std::string name;
  std::vector<cv::Point2f> left, right;
};

/// Corners of one picture (CV_8UC1), row by row, to sub-pixel; empty when the whole board is not
/// seen. OpenCV's corner finder (then its sector-based one, where that fails), refined by
/// cornerSubPix with a window in proportion to the smallest square in the picture: measured on the
/// Bumblebee2's boards this leaves 0.09 px where the sector-based finder alone leaves 0.12 px.
std::vector<cv::Point2f> detectBoard(const cv::Mat& gray, const Board& board,
                                     const StereoCalibrationOptions& options);

/// Brings the corners of the right eye into the order of the left eye. A finder starts at any end
/// of a board that looks the same turned by 180 degrees (or, square, by 90), and in each eye on its
/// own; between two eyes of a rig the board turns by far less. Mirrored orders are undone too.
void alignCornerOrder(const Board& board, BoardObservation& observation);

/// detectBoard() on both eyes and alignCornerOrder(). kNotEnoughData, naming the eye, when one does
/// not show the whole board; kInvalidInput for pictures that are not CV_8UC1 or differ in size.
Result<BoardObservation> detectBoards(const std::string& name, const cv::Mat& left,
                                      const cv::Mat& right, const Board& board,
                                      const StereoCalibrationOptions& options);

/// How one view fits. Residuals are measured minus projected, pixels.
struct ViewReport {
  std::string name;
  bool used = false;
  double left_rms_px = 0.0;   ///< root mean square length of the corner residuals
  double right_rms_px = 0.0;  ///< likewise
  double max_px = 0.0;        ///< longest of both eyes
  double held_out_px = 0.0;   ///< RMS of both eyes under a calibration without this view
  std::string note;           ///< why it was left out, or what is remarkable; else empty
  Eigen::Isometry3d T_camera_board = Eigen::Isometry3d::Identity();  ///< raw left camera
  std::vector<cv::Point2f> left, right;                              ///< corners
  std::vector<cv::Point2f> left_residual, right_residual;
};

/// One candidate of the choice of the distortion model.
struct ModelScore {
  Distortion distortion = Distortion::kK1;
  double rms_px = 0.0;           ///< over the views it was fitted to
  double held_out_px = 0.0;      ///< over views it was not fitted to; 0: not tried
  double corner_sigma_px = 0.0;  ///< uncertainty of the rays at the picture's corners
  std::string verdict;           ///< "chosen", or why not
};

/// A parameter with its standard deviation (delete-group jackknife over the views, so that errors
/// which the corners of one view share are in it).
struct Parameter {
  std::string name;  ///< "left fx", "baseline" ...
  double value = 0.0;
  double sigma = 0.0;
  std::string unit;  ///< "px", "mm", "deg" or empty
};

struct ViewDiversity {
  int distinct = 0;             ///< views that differ by 5 deg or 5 % of the distance
  double tilt_deg = 0.0;        ///< largest angle between two boards' normals
  double left_coverage = 0.0;   ///< share of the picture inside the hull of all corners
  double right_coverage = 0.0;  ///< likewise
};

/// |y_left - y_right| of the corners after rectification, pixels.
struct EpipolarError {
  double mean_px = 0.0, p95_px = 0.0, max_px = 0.0;
};

struct StereoCalibrationReport {
  StereoCalibration calibration;
  Board board;
  Distortion distortion = Distortion::kK1;
  double rms_px = 0.0;  ///< over all corners of both eyes of the used views
  double held_out_px = 0.0;
  EpipolarError epipolar;
  ViewDiversity diversity;
  Eigen::Isometry3d T_right_left = Eigen::Isometry3d::Identity();  ///< raw cameras
  double rectified_alpha = 0.0;   ///< of cv::stereoRectify; 0: every rectified pixel is a picture's
  double left_kept_share = 0.0;   ///< of the raw picture, inside the rectified one
  double right_kept_share = 0.0;  ///< likewise
  std::vector<ViewReport> views;  ///< all, in the order given
  std::vector<ModelScore> models;  ///< tried, simplest first
  std::vector<Parameter> parameters;
  std::vector<std::string> warnings;  ///< one line each

  const Parameter& parameter(const std::string& name) const;  ///< throws std::out_of_range
  std::size_t usedViews() const;
};

/// Calibrates from boards seen by both eyes.
///
/// Model: taken is the simplest distortion model whose error on *held-out* views (12 groups at
/// most; the board's pose is the only thing fitted to them) no richer one lowers by `min_gain` and
/// by `min_gain_sigmas` standard errors of the views' paired log ratios; the rational model must do
/// five and two times as well. A model whose radial function turns back inside the picture is never
/// taken.
///
/// Views: a view is left out, and said so, when a calibration without it (of the full polynomial,
/// and of the rational model) fits the others and misses it by `outlier_factor` times their error
/// and by `outlier_min_px`.
///
/// Rectification: the smallest alpha (cv::stereoRectify) that keeps `kept_share` of both pictures,
/// while the rectified focal length stays within `max_focal_change` of the original.
///
/// Fails with one line that says what to do: kNotEnoughData for too few views, or too alike (tilt,
/// position, coverage); kInvalidInput for corners of wrong number or not finite, swapped eyes, or
/// views that do not fit one rigid pair; kNoConvergence when no model fits. Throws
/// ConfigurationError for a board, size or thread count that make no sense.
Result<StereoCalibrationReport> calibrateStereo(const std::vector<BoardObservation>& observations,
                                                const Board& board, cv::Size image_size,
                                                const StereoCalibrationOptions& options,
                                                int threads);

}  // namespace scanner::calibration
