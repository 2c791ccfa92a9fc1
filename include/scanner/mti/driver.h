#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "scanner/core/options.h"
#include "scanner/core/status.h"
#include "scanner/core/time.h"

/// The MTi on its serial line, as one object: finds it, configures it, keeps it running, gives
/// stamped samples.
namespace scanner::mti {

/// What ResetOrientation can do (MT0100P 4.6; thesis appendix A).
enum class OrientationReset : std::uint8_t {
  kStore = 0,    ///< keep the current resets without power
  kHeading = 1,  ///< x-z plane of the sensor becomes north
  kGlobal = 2,   ///< the current orientation becomes the identity
  kObject = 3,   ///< z up, x forward: the frame of what it is strapped to; rotates calibrated data
  kAlign = 4,    ///< object, then heading
};

enum class OrientationFormat { kQuaternion, kMatrix, kEuler };
enum class StartReset { kNone, kHeading, kObject, kAlign };

/// Block `mti` of a configuration.
struct DriverOptions {
  std::string port = "auto";  ///< serial port; auto: the first MTi that answers
  int baud_rate = 460800;     ///< wanted; the device is found at any rate and moved to this one
  bool two_stop_bits = false;
  bool low_latency = true;  ///< ask a USB adapter not to collect bytes
  double rate_hz = 100.0;
  OrientationFormat orientation = OrientationFormat::kMatrix;
  bool magnetic_field = true;
  bool temperature = true;
  StartReset start_reset = StartReset::kNone;  ///< when measuring begins for the first time
  double filter_gain_hz = 1.0;    ///< of the device's own orientation filter (thesis table 3.2)
  double filter_weighting = 1.0;  ///< of the magnetometer in it
  bool configure = true;          ///< false: take the stream as the device is set
  double answer_timeout_s = 0.5;
  double silence_timeout_s = 1.0;  ///< without a sample: the device counts as gone
  double retry_min_s = 0.25;       ///< between attempts to open, doubled up to
  double retry_max_s = 4.0;
  double extra_latency_s = 0.0;  ///< of the adapter, above what protocol and baud rate explain
};
void describe(OptionVisitor& v, DriverOptions& o);

/// One measurement, the same from every generation of devices.
struct Sample {
  Time stamp;    ///< when it was measured, on the host's wall clock; strictly increasing
  Time arrival;  ///< when its last byte was read
  std::uint64_t number = 0;  ///< from the device's counter, unwrapped: gaps are lost samples
  std::optional<Eigen::Vector3d> angular_velocity;  ///< rad/s, sensor frame
  std::optional<Eigen::Vector3d> acceleration;      ///< m/s^2, gravity included, sensor frame
  std::optional<Eigen::Vector3d> magnetic_field;    ///< 1 = about the earth's field, sensor frame
  std::optional<Eigen::Quaterniond> orientation;    ///< R_enu_sensor, whatever the device's frame
  std::optional<double> temperature_c;
};

enum class DriverState {
  kSearching,  ///< no port, or nothing that answers on it; tries again with back-off
  kConfiguring,
  kMeasuring,
  kStopped,
};
const char* toString(DriverState state);

struct DriverStatistics {
  DriverState state = DriverState::kStopped;
  std::string problem;  ///< what went wrong last, one line; empty while measuring
  std::string notes;    ///< what could not be had as configured ("rate limited to ..."), one line
  std::string port;
  std::string device_id;  ///< eight hexadecimal digits
  std::string firmware;
  std::string protocol;  ///< MTData or MTData2
  int baud_rate = 0;
  double rate_hz = 0.0;        ///< measured over the last seconds
  std::uint64_t samples = 0;   ///< given to the callback
  std::uint64_t lost = 0;      ///< by the device's counter, rejected ones included
  std::uint64_t rejected = 0;  ///< whole messages with a value that cannot be
  std::uint64_t checksum_errors = 0;
  std::uint64_t skipped_bytes = 0;
  std::uint64_t connections = 0;  ///< times that measuring began
  double drift_ppm = 0.0;         ///< device clock against host clock
  double arrival_jitter_s = 0.0;  ///< what stamps on arrival would have
};

/// The state machine of one MTi in a thread of its own. Searching -> configuring -> measuring; a
/// cable that is pulled, silence, errors and garbage lead back to searching, with back-off, for as
/// long as the object lives. Thread-safe.
///
/// Stamps: sample counter, clock model, and the latency that MT0100P gives (1.97 ms of computing,
/// then the bytes on the line) taken off. The first 0.2 s after measuring began go into the clock
/// model alone and are not given to the callback. A device that sends no counter is stamped on
/// arrival, which the notes say.
class Driver {
 public:
  /// Called from the driver's thread, in order of stamps. Must not throw.
  using Callback = std::function<void(const Sample&)>;
  /// Starts at once. Throws ConfigurationError for options that cannot be.
  Driver(const DriverOptions& options, Callback callback);
  ~Driver();

  /// Waits for the acknowledgement. kStore leaves measurement for a moment. kInvalidInput when the
  /// device refuses or the call comes from the callback, kOutOfRange when none is measuring,
  /// kIoError when it does not answer.
  Status resetOrientation(OrientationReset reset);
  DriverStatistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// What is connected.
struct FoundDevice {
  std::string port;
  std::string description;               ///< product of the USB adapter, or empty
  std::optional<std::string> device_id;  ///< when it was probed and is an MTi
  std::string firmware;
  int baud_rate = 0;
  std::string problem;  ///< why it could not be probed ("no permission: ...")
};
/// Serial ports that could carry an MTi, the likeliest first: Xsens, FTDI, other USB adapters,
/// built-in ports. Where there is a name that survives replugging (/dev/serial/by-id), it is that.
/// Opens nothing. Port "auto" tries all but the built-in ones.
std::vector<FoundDevice> listPorts();
/// Opens the port and asks at all baud rates; leaves the device as it was. One that measures stops
/// for as long as it answers, about a tenth of a second.
FoundDevice probe(const std::string& port, const DriverOptions& options = {});

}  // namespace scanner::mti
