#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "scanner/calibration/stereo_calibration.h"

/// What calibrate_stereo reads and writes. Files that cannot be read or written throw
/// ConfigurationError naming them.
namespace scanner::calibration {

/// Two files that show the same moment.
struct PicturePair {
  std::string name;   ///< path inside the folder with the side left out: "*01.jpg"
  std::string left;   ///< path
  std::string right;  ///< path
};

struct PictureFolder {
  std::vector<PicturePair> pairs;     ///< by name, numbers in their order
  std::vector<std::string> unpaired;  ///< pictures without a partner, or of no side
};

/// Finds pairs by their names: a side is one of the words left/right, l/r, cam0/cam1 anywhere in
/// the path below `folder`, set off by anything but small letters: left01.jpg, 01_right.png,
/// board-l.png, left/01.png, imageLeft3.tif. Looks three folders deep.
PictureFolder findPicturePairs(const std::string& folder);

/// Called after each pair with how many are done.
using Progress = std::function<void(std::size_t done, std::size_t total, const std::string& name)>;

struct DetectedBoards {
  cv::Size image_size;
  std::vector<BoardObservation> observations;
  std::vector<PicturePair> pairs;    ///< of the observations, in the same order
  std::vector<std::string> skipped;  ///< one line for each pair without a board in both eyes
};

/// Reads pairs and finds their boards. kNotEnoughData when no board is found at all (if a board of
/// another size is seen, the message says so, as with squares counted instead of corners);
/// kInvalidInput when pictures differ in size.
Result<DetectedBoards> detectBoards(const std::vector<PicturePair>& pairs, const Board& board,
                                    const StereoCalibrationOptions& options, int threads,
                                    const Progress& progress);

/// Reads the block `calibration` of a configuration file.
StereoCalibrationOptions loadCalibrationOptions(const std::string& path);

/// Writes a rig file (docs/conventions.md). `existing`: a rig file whose other entries are kept;
/// empty: base_link is set level at the camera, x forward and z up. Readable by scanner::loadRig.
void writeRig(const std::string& path, const StereoCalibrationReport& report,
              const std::string& existing);

/// Report for people and for programs (JSON).
std::string reportText(const StereoCalibrationReport& report);
std::string reportJson(const StereoCalibrationReport& report);

/// Both pictures (CV_8UC3 or CV_8UC1, raw) rectified side by side under level lines.
cv::Mat rectifiedPicture(const cv::Mat& left, const cv::Mat& right,
                         const StereoCalibration& calibration);

/// All corners of both eyes with their residuals, 100 times enlarged: green of used views, red of
/// those left out; the hull of the corners is the part of the picture that was calibrated.
cv::Mat residualPicture(const StereoCalibrationReport& report);

}  // namespace scanner::calibration
