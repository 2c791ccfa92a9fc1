#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "scanner/bumblebee/stereo_camera.h"
#include "scanner/core/options.h"

namespace scanner::bumblebee {

enum class TransportChoice { kAuto, kAravis, kUsb, kDc1394, kFile };

/// Block `bumblebee` of a configuration.
struct DriverOptions {
  TransportChoice transport = TransportChoice::kAuto;  ///< auto: the first camera that is found
  std::string address;              ///< serial number, or what `--list` prints; empty: the first
  int width_px = 0, height_px = 0;  ///< of one eye; 0: the largest
  double rate_hz = 1.82;
  bool auto_exposure = true;
  double exposure_s = 0.004;           ///< when not automatic
  double gain_db = 0.0;                ///< when not automatic
  double auto_exposure_max_s = 0.008;  ///< longer blurs a hand-held picture
  double auto_target = 0.35;           ///< mean of both eyes, share of full scale, linear
  double white_balance_blue = 0.0, white_balance_red = 0.0;  ///< 0: leave as the camera has it
  TransportOptions bus;
  /// From the end of the exposure until a frame has arrived, when nothing delays it: read-out and
  /// transfer; subtracted from stamps. Negative: computed from the speed of the bus
  /// (assumedLatency()).
  double latency_s = -1.0;
  double frame_timeout_s = 2.0;  ///< plus two frame periods: the camera counts as gone
  double retry_min_s = 0.25;
  double retry_max_s = 4.0;
};
void describe(OptionVisitor& v, DriverOptions& o);

enum class DriverState { kSearching, kConfiguring, kStreaming, kStopped };
const char* toString(DriverState state);

/// What stamps are made from, best first.
enum class StampSource {
  kDeviceClock,  ///< the camera's own clock, mapped to the host's
  kCounter,      ///< frame numbers times the period, mapped likewise
  kArrival,      ///< arrival of each frame less latency and half the exposure: jitters
};
const char* toString(StampSource source);

/// Time from the end of an exposure to the arrival of the frame as the bus dictates it: GigE Vision
/// 125 MB/s, USB 40 MB/s (USB 2.0), IEEE 1394 one packet of 1024 bytes per 100 Mbit/s and 125 us.
/// Sensors are taken to be read out while the frame is being sent. 0 for recordings and for Aravis'
/// fake camera, which have no wire.
double assumedLatency(const CameraIdentity& camera, const FrameFormat& format,
                      const TransportOptions& bus);

/// A pair ready to publish.
struct CapturedPair {
  StereoFrame frame;  ///< stamp: mid-exposure, host's wall clock, strictly increasing
  Time arrival;
  std::uint64_t number = 0;  ///< from the camera's counter, unwrapped: gaps are dropped frames
  double exposure_s = 0.0, gain_db = 0.0;  ///< in force
};

struct DriverStatistics {
  DriverState state = DriverState::kStopped;
  /// What went wrong last, one line; while streaming empty, or a setting that the camera did not
  /// take as asked.
  std::string problem;
  CameraIdentity camera;
  Capabilities capabilities;
  FrameFormat format;
  double rate_hz = 0.0;        ///< measured over the last seconds
  double bandwidth_Bps = 0.0;  ///< bytes per second, likewise
  std::uint64_t pairs = 0;     ///< given to the callback
  std::uint64_t dropped = 0;   ///< by the camera's counter, and damaged ones
  std::uint64_t damaged = 0;   ///< of these: came, but short or corrupt
  std::uint64_t lost_packets = 0;
  std::uint64_t connections = 0;  ///< times that streaming began
  StampSource stamps = StampSource::kArrival;
  double drift_ppm = 0.0;  ///< of the camera's clock (or counter) against the host's
  double arrival_jitter_s = 0.0;
  std::optional<double> temperature_c;
  double exposure_s = 0.0, gain_db = 0.0;
  double saturated_share[2] = {0.0, 0.0};  ///< of the last pair, left and right
  double mean_level[2] = {0.0, 0.0};       ///< 0..1
  std::string factory_calibration;         ///< Triclops text as the camera keeps it; empty: none
};

/// The state machine of one camera in a thread of its own: searching -> configuring -> streaming
/// (from the first whole frame), and back to searching with back-off when the camera goes away or
/// says nothing. A recording that ends (without file_repeat) leaves it kStopped. Thread-safe; the
/// callback is called from the driver's thread, one pair at a time, and may call back any method.
///
/// Stamps are mid-exposure: end of exposure mapped to the host's clock, less half the exposure that
/// the camera says is in force. For the one to three frames that a change of exposure is under way
/// they are wrong by at most half of that change.
class Driver {
 public:
  using Callback = std::function<void(const CapturedPair&)>;
  /// Starts at once. Throws ConfigurationError for options that cannot be.
  Driver(const DriverOptions& options, Callback callback);
  ~Driver();

  /// Exposure, gain, white balance, rate and auto-exposure from now on (the other options cannot
  /// change). Kept over reconnections. Status of the camera's answer; ok when none is connected;
  /// kOutOfRange when a value lies outside the camera's range (the nearest is in force then).
  /// Throws ConfigurationError as the constructor does.
  Status reconfigure(const DriverOptions& options);
  /// kOutOfRange while no camera is connected.
  Result<std::uint32_t> readRegister(std::uint64_t offset);
  Status writeRegister(std::uint64_t offset, std::uint32_t value);
  DriverStatistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::bumblebee
