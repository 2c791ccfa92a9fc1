#pragma once

#include <string>

#include "scanner/core/image.h"
#include "scanner/stereo/rectify.h"

/// What is wrong with a pair of pictures, named so that the person who scans can put it right.
namespace scanner::stereo {

enum class TroubleKind {
  kNone,
  kEmpty,        ///< an image without pixels
  kBlack,        ///< lens cap, exposure far too short
  kSaturated,    ///< exposure far too long
  kBlank,        ///< covered, or nothing but a smooth surface in view
  kUneven,       ///< one eye much darker than the other
  kBlurred,      ///< out of focus, one eye or both
  kSamePicture,  ///< both eyes show one picture: a fault of wiring or of topics
  kSwapped,      ///< left and right are exchanged
  kRowsDiffer,   ///< corresponding points are not on the same row: wrong calibration
  kUnrelated,    ///< the pictures are not of one moment or one place
};

struct Trouble {
  TroubleKind kind = TroubleKind::kNone;
  /// No disparity of such a pair can be trusted, whatever a matcher makes of it.
  bool hopeless = false;
  std::string line;  ///< one line: what is seen, and the likely cause; empty without trouble

  explicit operator bool() const { return kind != TroubleKind::kNone; }
};

/// Trouble that the brightness of the pictures shows: black, saturated, blank, uneven. Reads a
/// sample of the pixels; well below a millisecond, for every frame.
Trouble inspectBrightness(const RectifiedPair& pair);

/// All trouble that shows in a rectified pair, from matches at a reduced size (320 px wide); about
/// 40 ms on one thread, several times that where little matches. For pairs that leave few pixels,
/// and for checks before work. Same answer on any number of threads and any instruction set.
///
/// What no pair of pictures can show: a baseline or a focal length that is wrong, and eyes that
/// took their pictures at different moments while the camera moved along its baseline. Images
/// CV_8UC1 of equal size, else kEmpty.
Trouble inspectPair(const RectifiedPair& pair, int threads);

/// The wiring fault that rectification hides: two raw images of the same pixels.
Trouble inspectRaw(const StereoFrame& frame);

/// The line of inspectPair().
std::string describeTrouble(const RectifiedPair& pair, int threads);

}  // namespace scanner::stereo
