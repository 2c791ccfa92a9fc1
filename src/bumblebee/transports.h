#pragma once

#include <memory>
#include <string>
#include <vector>

#include "scanner/bumblebee/stereo_camera.h"

/// One pair of functions per transport, each in a file of its own name; stereo_camera.cpp
/// dispatches. list...() never fails: a bus that is absent has no cameras. open...() with an empty
/// address takes the first camera.
namespace scanner::bumblebee {

std::vector<CameraIdentity> listAravis();
Result<std::unique_ptr<StereoCamera>> openAravis(const std::string& address,
                                                 const TransportOptions& options);

std::vector<CameraIdentity> listUsb();
Result<std::unique_ptr<StereoCamera>> openUsb(const std::string& address,
                                              const TransportOptions& options);

std::vector<CameraIdentity> listDc1394();
Result<std::unique_ptr<StereoCamera>> openDc1394(const std::string& address,
                                                 const TransportOptions& options);

/// `address`: a folder of pictures (left and right, or interleaved 16-bit PNG; file_transport.h).
Result<std::unique_ptr<StereoCamera>> openFile(const std::string& address,
                                               const TransportOptions& options);

}  // namespace scanner::bumblebee
