#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

/// Transport `file`: a folder of pictures, played at TransportOptions::file_rate_hz on a monotonic
/// clock. (A recorded bag is played by replay.launch or `rosbag play`, not by this transport.)
///
/// What a folder may hold, in this order of preference:
///  - left/NAME and right/NAME (any extension of .png .jpg .jpeg .bmp .pgm .tif .tiff);
///  - pairs side by side whose names differ in "left" and "right" (chair01_left.jpg, left01.png);
///  - interleaved 16-bit PNGs (low byte left, high byte right), the other pictures.
/// Frames are played in the order of their names, numbers by value (left2 before left10).
///
/// A picture with one channel is mono, unless its file's or folder's name has "bayer_rggb8" or the
/// like in it. A colour picture is sampled as an RGGB Bayer tile, so that the raw format stays the
/// one of a camera. The first pair that can be read settles size and format; one of another size,
/// of another kind, unreadable or without its other eye is a damaged frame with its reason.
///
/// The player's clock counts as the camera's: RawFrame::device_time is frame number / rate since
/// start(), the counter counts frames from 1. A reader that is slow gets every frame, later.
namespace scanner::bumblebee {

/// How the status of the end of a folder begins (kIoError).
inline constexpr char kEndOfRecording[] = "end of recording";

/// The files of one frame: left and right, or one interleaved picture. An empty one is missing.
struct FramePaths {
  std::filesystem::path left, right, interleaved;
};
/// Frames of a folder in playing order; empty when there are none.
std::vector<FramePaths> findFrames(const std::filesystem::path& folder);

}  // namespace scanner::bumblebee
