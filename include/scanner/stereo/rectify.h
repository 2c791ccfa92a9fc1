#pragma once

#include <array>
#include <opencv2/core.hpp>

#include "scanner/core/camera.h"
#include "scanner/core/image.h"
#include "scanner/core/status.h"

namespace scanner::stereo {

/// One exposure after rectification: corresponding points are on the same row, and
/// x_left - x_right is the disparity.
struct RectifiedPair {
  Time stamp;
  cv::Mat left_gray;    ///< CV_8UC1
  cv::Mat right_gray;   ///< CV_8UC1, same size
  cv::Mat left_color;   ///< CV_8UC3 BGR; a grey camera's grey replicated
  cv::Mat left_valid;   ///< CV_8UC1, 0 where the raw image has no pixel; empty: valid everywhere
  cv::Mat right_valid;  ///< likewise for the right image
};

/// Removes lens distortion and misalignment (thesis table 3.1, "rectification").
///
/// Matching works on grey. From a Bayer pattern, grey is the 3x3 binomial of the raw mosaic,
/// (R + 2 G + B) / 4 at every site whatever its colour, so no demosaicing pattern gets into the
/// sub-pixel disparity; it is resampled with cubic convolution at float coordinates (a fixed-point
/// map moves pixels by up to 1/64 px). Colour is demosaiced and resampled bilinearly.
///
/// Immutable after construction; rectify() may be called from several threads.
class Rectifier {
 public:
  /// Throws ConfigurationError when scanner::validate(calibration) is not ok, or the distortion
  /// model or its number of coefficients is not known.
  explicit Rectifier(const StereoCalibration& calibration);

  /// kInvalidInput for an empty image, a size other than the calibration's, a pixel type that does
  /// not suit the format, or two eyes of different formats.
  Result<RectifiedPair> rectify(const StereoFrame& frame) const;

  const StereoCalibration& calibration() const { return calibration_; }

 private:
  struct Eye {
    cv::Mat x, y;               ///< CV_32FC1: raw position of each rectified pixel
    cv::Mat fixed, fixed_part;  ///< the same as CV_16SC2 + CV_16UC1 for cv::remap
    cv::Mat valid;              ///< CV_8UC1
  };
  static Eye makeEye(const CameraModel& camera);

  StereoCalibration calibration_;
  Eye left_, right_;
};

/// Grey for matching from a raw image, CV_32FC1 (see Rectifier). `image` must be well formed.
cv::Mat matchingGray(const Image& image);
/// Demosaiced colour, CV_8UC3 BGR. `image` must be well formed.
cv::Mat toBgr(const Image& image);

}  // namespace scanner::stereo
