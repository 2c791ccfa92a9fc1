#pragma once

#include "bumblebee/aravis_support.h"
#include "scanner/bumblebee/stereo_camera.h"

/// The GenICam features of a camera, in the units of this project. Aravis' tree of features is not
/// thread-safe: one caller at a time.
namespace scanner::bumblebee::aravis {

/// What the camera has now, of the largest picture. Ranges that make no sense count as absent.
Capabilities readCapabilities(ArvCamera* camera);

/// Checks all values, then sets those that are there. Automatics of a control that is set are
/// switched off. kUnsupported for a control that the camera has not, kInvalidInput outside its
/// range.
Status applyControls(ArvCamera* camera, const Capabilities& capabilities, const Controls& controls);
/// Those that the camera has.
Result<Controls> readControls(ArvCamera* camera, const Capabilities& capabilities);
std::optional<double> readTemperature(ArvCamera* camera);

/// 16 bit a sample, one eye in each byte. kUnsupported names the formats that the camera has.
Status selectStereoFormat(ArvCamera* camera);
/// The upper left part of the picture; 0: all of it. kInvalidInput names what the camera takes.
Status selectSize(ArvCamera* camera, int width_px, int height_px);
/// Of one eye, as the camera says (PixelColorFilter); RGGB, that of the Bumblebees in colour, when
/// it does not.
PixelFormat readTile(ArvCamera* camera);
/// `bytes` 0: the largest that gets through where the camera can try, else as it is set.
Status selectPacketSize(ArvCamera* camera, int bytes);

std::string readText(ArvCamera* camera, const char* feature);

}  // namespace scanner::bumblebee::aravis
