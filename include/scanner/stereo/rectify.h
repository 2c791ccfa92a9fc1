#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

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
/// sub-pixel disparity; from colour it is the luma of ITU-R BT.601. It keeps sixteenths of a grey
/// level until it is resampled, with cubic convolution (Keys 1981) at positions in steps of
/// 1/1024 px; outside the raw image the edge is repeated, so that no false edge appears there.
/// Colour is demosaiced (Hamilton and Adams) and resampled bilinearly, black outside; a grey
/// camera's colour is its rectified grey. A camera that is rectified already keeps its bytes.
///
/// The maps take 9 bytes a pixel and eye, a call another 8 bytes a pixel while it runs. Same bytes
/// for any number of threads and every instruction set.
/// Immutable after construction; rectify() may be called from several threads.
class Rectifier {
 public:
  /// Throws ConfigurationError when scanner::validate(calibration) is not ok, or the distortion
  /// model or its number of coefficients is not known.
  explicit Rectifier(const StereoCalibration& calibration);

  /// kInvalidInput for an empty image, a size other than the calibration's, a pixel type that does
  /// not suit the format, or two eyes of different formats.
  Result<RectifiedPair> rectify(const StereoFrame& frame, int threads = 1) const;

  const StereoCalibration& calibration() const { return calibration_; }

 private:
  /// Where each rectified pixel lies in the raw image, in the form that the kernels take.
  struct Eye {
    std::vector<std::int32_t> index;   ///< into the padded planes of the raw image
    std::vector<std::uint32_t> phase;  ///< fractions of x and, times 2^16, of y
    cv::Mat valid;                     ///< CV_8UC1
    bool identity = false;             ///< every pixel stays where it is
  };
  static Eye makeEye(const CameraModel& camera);
  /// The grey, and the colour when that is not null.
  static cv::Mat rectifyEye(const Eye& eye, const Image& image, int threads, cv::Mat* color);

  StereoCalibration calibration_;
  Eye left_, right_;
};

}  // namespace scanner::stereo
