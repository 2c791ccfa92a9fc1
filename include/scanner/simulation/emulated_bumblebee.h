#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "scanner/core/image.h"
#include "scanner/core/status.h"
#include "scanner/simulation/sensor.h"

namespace scanner::simulation {

/// A Bumblebee behind GigE Vision on a local interface (Aravis' fake camera): frames are Mono16,
/// the byte of the left eye in the low half of every sample, the right eye's in the high half.
/// Exposure and gain that a client sets reach the frame source. Thread-safe.
///
/// What a client sees: model "Bumblebee2", Width x Height of the camera (a smaller region with
/// OffsetX, OffsetY is cut out), Mono16, AcquisitionFrameRate (frames are taken at multiples of its
/// period in wall-clock time), ExposureTimeAbs in microseconds, GainRaw in dB, 0..10. Time stamps
/// are the wall clock at the start of the exposure, exactly on that grid; a frame is sent when its
/// exposure has ended; frame numbers of the stream begin at 65401 after
/// power-on and wrap from 65535 to 1. A format that the camera does not have (Mono8 ...) is not
/// streamed: nothing comes. src/simulation/emulated_bumblebee.cpp lists what the fake camera lacks.
class EmulatedBumblebee {
 public:
  struct Options {
    std::string interface = "127.0.0.1";  ///< IPv4 address of a local interface, or its name
    std::string serial = "SIM0001";       ///< at most 15 characters
    int width_px = 1024;                  ///< at most 2048
    int height_px = 768;
    double lost_packets = 0.0;  ///< share of the stream's packets that never arrive
    double rate_hz = 15.0;      ///< until a client sets another
    Exposure exposure;          ///< until a client sets another
  };
  /// Called when the camera takes frame `number` (from 0, counted since power-on) with the settings
  /// now in force. Returns left and right 8-bit single-channel pictures of the camera's size; else,
  /// or when it throws, the frame is refused. Called from the camera's only thread: a source that
  /// takes longer than some 0.5 s lets the client's control requests time out.
  using FrameSource = std::function<StereoFrame(std::uint64_t number, const Exposure& exposure)>;

  /// Powered on at once. Throws ConfigurationError when the interface cannot be served (there is
  /// one camera for each address: UDP port 3956), or for an option out of its bounds.
  EmulatedBumblebee(const Options& options, FrameSource source);
  ~EmulatedBumblebee();

  /// Start of the exposure of the frame that is being taken (wall clock, as its time stamp says).
  /// For the frame source, while it is called.
  Time frameTime() const;
  /// From the next frame on. Every packet is lost or not by itself, and never sent again.
  void setLostPackets(double share);
  /// The cable out: the device vanishes from the network. Waits for the frame that is being taken.
  /// plug() brings it back, powered on anew with the settings of the options; it throws as the
  /// constructor does.
  void unplug();
  void plug();
  /// Since power-on.
  std::uint64_t framesTaken() const;
  /// Frames that were not sent: a format the camera does not have, or the source failed.
  std::uint64_t framesRefused() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Two 8-bit pictures (CV_8UC1) as one 16-bit one (CV_16UC1), and back as left, right. Throws
/// ConfigurationError when sizes or types do not fit.
cv::Mat interleave(const cv::Mat& left, const cv::Mat& right);
std::pair<cv::Mat, cv::Mat> deinterleave(const cv::Mat& interleaved);

}  // namespace scanner::simulation
