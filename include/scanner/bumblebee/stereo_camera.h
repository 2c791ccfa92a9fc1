#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "scanner/core/image.h"
#include "scanner/core/status.h"
#include "scanner/core/time.h"

/// A stereo camera that sends both eyes in one interleaved picture, over whichever bus.
namespace scanner::bumblebee {

enum class Transport {
  kAravis,  ///< GenICam: GigE Vision and USB3 Vision
  kUsb,     ///< IIDC over USB, on libusb
  kDc1394,  ///< IEEE 1394, on libdc1394
  kFile,    ///< recorded pictures or a bag's raw images
};
const char* toString(Transport transport);

/// A camera as the bus names it.
struct CameraIdentity {
  Transport transport = Transport::kAravis;
  std::string address;  ///< what open() takes: Aravis device id, USB bus.address, GUID, folder
  std::string vendor, model, serial, firmware;
  std::string problem;  ///< why it could not be asked ("no permission: ..."); else empty
};

/// Closed interval of a control; absent capability: nullopt in Capabilities.
struct ControlRange {
  double min = 0.0, max = 0.0;
};

struct Capabilities {
  int width_px = 0, height_px = 0;  ///< of one eye
  std::optional<ControlRange> exposure_s, gain_db, rate_hz;
  std::optional<ControlRange> white_balance;  ///< unit of the bus: u/b and v/r of IIDC, or a ratio
  bool registers = false;                     ///< IIDC control registers can be read and written
  bool frame_counter = false;                 ///< RawFrame::counter is the camera's own
  bool device_clock = false;                  ///< RawFrame::device_time is the camera's own
  bool temperature = false;
};

/// Values that a user may change while streaming. Absent: leave as it is.
struct Controls {
  std::optional<double> exposure_s, gain_db, rate_hz;
  std::optional<double> white_balance_blue, white_balance_red;
};

/// Which byte of a pair belongs to the left eye. Register 0x1048 decides it on IIDC cameras.
enum class ByteOrder { kLeftFirst, kRightFirst };

/// How the bytes of a frame are to be read; fixed while streaming.
struct FrameFormat {
  int width_px = 0, height_px = 0;  ///< of one eye; a frame has 2 * width * height bytes
  ByteOrder order = ByteOrder::kLeftFirst;
  PixelFormat pixels = PixelFormat::kBayerRggb8;  ///< of one eye: Bayer tile or kMono8
  bool embedded_timestamp = false;                ///< register 0x12F8: first 4 bytes of the frame
  bool embedded_counter = false;                  ///< the next 4
};

/// At what moment a camera's own stamp is taken.
enum class StampMoment { kStartOfExposure, kEndOfExposure, kStartOfTransmission };

/// One frame as it came from the bus, both eyes byte by byte. The bytes are shared and immutable.
struct RawFrame {
  std::shared_ptr<const std::vector<std::uint8_t>> bytes;
  /// Ok; or why it must not be used (short transfer, packets lost, wrong size): counted as dropped.
  Status status;
  Time arrival;  ///< host's wall clock (system_clock) when the frame was complete
  std::optional<std::uint64_t> counter;  ///< camera's frame number as sent, wraps after counter_max
  std::uint64_t counter_max = 0;
  std::uint64_t counter_first = 0;  ///< the number after counter_max (GigE Vision: 1)
  std::optional<Duration>
      device_time;  ///< camera's own clock at `moment`, unwrapped by the transport
  StampMoment moment = StampMoment::kStartOfExposure;
};

/// Counted by the transport since start().
struct TransportStatistics {
  std::uint64_t frames = 0;        ///< complete
  std::uint64_t incomplete = 0;    ///< short, packets missing, corrupt
  std::uint64_t overruns = 0;      ///< no buffer was free
  std::uint64_t lost_packets = 0;  ///< where the bus knows
  std::uint64_t bytes = 0;
};

/// One open camera. Methods are called from one thread, but setControls(), registers and
/// temperature() may be called from another while grab() waits. Every failure is a Status with one
/// clear line: kIoError when the camera is gone or busy or there is no permission (the line says
/// which), kUnsupported for a format it does not have, kInvalidInput for a value it refuses.
/// The destructor stops and closes.
class StereoCamera {
 public:
  virtual ~StereoCamera() = default;

  virtual CameraIdentity identity() const = 0;
  virtual Capabilities capabilities() const = 0;
  /// Before start(): the size of one eye (0: the largest), frame rate, packet size, byte order ...
  /// as far as the transport has them. Returns how frames will look.
  virtual Result<FrameFormat> configure(int width_px, int height_px, const Controls& controls) = 0;
  virtual Status start() = 0;
  /// The next frame, in order; a damaged one has RawFrame::status not ok. kOutOfRange when none
  /// came in time (try again), kIoError when the camera is gone (close it).
  virtual Result<RawFrame> grab(Duration timeout) = 0;
  virtual void stop() = 0;

  virtual Status setControls(const Controls& controls) = 0;
  virtual Result<Controls> controls() const = 0;
  virtual Result<std::uint32_t> readRegister(std::uint64_t offset) const = 0;
  virtual Status writeRegister(std::uint64_t offset, std::uint32_t value) = 0;
  virtual std::optional<double> temperatureC() const { return std::nullopt; }
  virtual TransportStatistics statistics() const = 0;
};

/// What the transports can find. Slow (network discovery takes a second).
std::vector<CameraIdentity> listCameras();
std::vector<CameraIdentity> listCameras(Transport transport);

/// Which byte of a pair the driver takes for the left eye's, when the camera does not say it.
enum class EyeOrder {
  kAuto,  ///< as the transport knows it (IIDC: what register 0x1048 was set to; docs/drivers.md)
  kLeftFirst,
  kRightFirst,
};

/// What opening needs to know besides the address.
struct TransportOptions {
  int buffers = 8;
  int packet_bytes = 0;  ///< GigE Vision; 0: the largest that gets through
  int iso_speed_mbps = 400;
  EyeOrder eye_order = EyeOrder::kAuto;  ///< IIDC only; change it when left and right are swapped
  double file_rate_hz = 1.82;
  bool file_repeat = false;
};
/// Opens the camera at `address`; empty: the first that the transport finds.
Result<std::unique_ptr<StereoCamera>> openCamera(Transport transport, const std::string& address,
                                                 const TransportOptions& options);

}  // namespace scanner::bumblebee
