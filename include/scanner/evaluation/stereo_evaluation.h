#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "scanner/core/status.h"

/// Disparity maps against known ones, as the Middlebury stereo pages do it (Scharstein and Szeliski
/// 2002; version 2 and 3 of the table).
namespace scanner::evaluation {

/// A rectified pair with its disparity. All images have the size of `left`.
struct StereoScene {
  std::string name;   ///< of its folder
  std::string group;  ///< of the folder above
  cv::Mat left;       ///< CV_8UC3 BGR
  cv::Mat right;      ///< CV_8UC3 BGR
  cv::Mat truth;      ///< CV_32FC1, px, x_left - x_right; NaN where unknown
  cv::Mat all;     ///< CV_8UC1, 255 where the disparity counts: it is known, and not in the border
  cv::Mat nonocc;  ///< likewise, part of `all`: and the right eye sees the point
  cv::Mat disc;    ///< likewise, part of `nonocc`: and it is close to a depth step
  bool nonocc_derived = false;  ///< the scene has no such mask: nonOccluded() made it
  bool disc_derived = false;    ///< likewise: nearDepthSteps() made it
  int min_disparity_px = 0;     ///< range to search, both ends included
  int max_disparity_px = 0;
  bool in_version2_table = false;  ///< one of the four that version 2 of the table is made of
};

/// Reads one scene. The layouts are those of the Middlebury sets, found by their file names:
///
///   left, right          truth               in the file is
///   im0.png, im1.png     disp0GT.pfm         pixels, inf where unknown       2014, version 3
///                        (or disp0.pfm)      (mask0nocc.png: 255 nonocc, 128 occluded)
///   view1.png, view5.png disp1.png           px x 1110 / height: 1, 2 or 3    2005 and 2006
///   imL.png, imR.png     disp2.png           px x 1500 / height: 1, 2 or 4    2003: Teddy, Cones
///     (or im2, im6)      disp2.pgm           px x 8                           2001: Venus, ...
///                        truedisp.pgm        px x 16                          Tsukuba
///
/// 0 is unknown in all but the PFM. Masks nonocc.png, all.png, disc.png are used where present
/// (white: in the region). The range to search is 0 to ndisp - 1 of calib.txt; 0 to 255 / scale
/// without; and what the table prescribes for its four scenes (16, 20, 60, 60 disparities). The
/// border of 18 px of Tsukuba is in its masks.
///
/// A text file `scene.txt` beside the pictures overrides all that, and describes other layouts. One
/// `key = value` a line, `#` starts a comment: left, right, truth, truth_right, nonocc, all, disc
/// (file names), scale (of an 8- or 16-bit truth), min_disparity, max_disparity (px), border (px,
/// ignored round the picture).
///
/// kIoError for a file that is absent or cannot be decoded, kInvalidInput for one of another size
/// or a value that makes no sense; one line naming the file.
Result<StereoScene> readStereoScene(const std::string& folder);

/// Folders of scenes: `folder` itself, or those in it at any depth, by name. kIoError when `folder`
/// is absent, kNotEnoughData when it has none.
Result<std::vector<std::string>> findStereoScenes(const std::string& folder);

/// Pixels of `truth` that the right eye sees: 255, others 0. `right_truth` is the truth of the
/// right image: then a pixel counts when it says the same within 1 px at one of the two columns
/// next to the match. Empty: `truth` is carried into the right image, where the nearest surface
/// hides those more than 1 px of disparity behind it. A match outside the image is not seen.
cv::Mat nonOccluded(const cv::Mat& truth, const cv::Mat& right_truth);

/// Pixels within a square of `width_px` round a place where horizontally or vertically neighbouring
/// disparities differ by `gap_px` or more, or round a pixel of `occluded` (CV_8UC1): 255, others 0.
///
/// The published mask of Tsukuba comes out of this, to 11 pixels of 15790, with kStepGap and
/// kStepWidth.
cv::Mat nearDepthSteps(const cv::Mat& truth, const cv::Mat& occluded, double gap_px, int width_px);
constexpr double kStepGap = 2.0;
constexpr int kStepWidth = 9;

/// A pixel is bad when it is off by more than this, px. A difference of rounding (1e-4 px) is not.
constexpr std::array<double, 4> kBadThresholds{0.5, 1.0, 2.0, 4.0};
using BadShares = std::array<double, kBadThresholds.size()>;

/// How good a disparity map is in one region. Shares are 0..1; NaN: of nothing.
struct RegionMeasures {
  std::size_t pixels = 0;  ///< of the region
  std::size_t valid = 0;   ///< of these, with a disparity
  double density = 0.0;    ///< valid / pixels
  BadShares bad_valid{};   ///< of the valid pixels
  BadShares bad_all{};     ///< of all, a pixel without disparity counted bad
  BadShares bad_filled{};  ///< of all, by the filled map
  double inlier_rms_px = std::numeric_limits<double>::quiet_NaN();  ///< of errors below 1 px
  double median_px = std::numeric_limits<double>::quiet_NaN();  ///< of the absolute error, valid
};

/// `truth`, `disparity`, `filled`: CV_32FC1, NaN = none; `filled` may be empty (its shares are
/// NaN). `region`: CV_8UC1. Throws std::invalid_argument when sizes or types disagree.
RegionMeasures measureDisparity(const cv::Mat& truth, const cv::Mat& region,
                                const cv::Mat& disparity, const cv::Mat& filled);

/// Mean of each share and figure, every scene with the same weight; NaNs are left out.
RegionMeasures meanMeasures(const std::vector<RegionMeasures>& scenes);

/// Share of bad pixels among the `count` valid ones of a region of smallest `sigma` (ties: by
/// place, row by row). NaN when there are fewer, or none.
double badShareOfBest(const cv::Mat& truth, const cv::Mat& region, const cv::Mat& disparity,
                      const cv::Mat& sigma, std::size_t count, double threshold_px);

}  // namespace scanner::evaluation
