#pragma once

#include <cstdint>
#include <optional>

#include "scanner/bumblebee/stereo_camera.h"

/// What the IIDC control registers of a Bumblebee mean (IIDC 1.31; Point Grey's register reference;
/// offsets in docs/drivers.md), over whichever bus reaches them.
namespace scanner::bumblebee {

/// Reads and writes quadlets of the command register space (offset 0 = 0xFFFFF0F00000).
/// Thread-safe.
class RegisterBus {
 public:
  virtual ~RegisterBus() = default;
  virtual Result<std::uint32_t> read(std::uint64_t offset) const = 0;
  virtual Status write(std::uint64_t offset, std::uint32_t value) = 0;
};

struct IidcSetup {
  FrameFormat format;
  std::uint32_t bytes_per_packet = 0;  ///< 1394 only
};
/// Switches the camera on and any stream off, then sets and reads back: Format7 mode 3, RAW16
/// (MONO16 for monochrome sensors), the whole sensor (0x1F28), the largest packet, the Bayer tile
/// (0x1040), the byte order (0x1048) and the embedded time stamp and counter (0x12F8, when the
/// camera has it). Frames have 2 * width * height bytes.
///
/// Register 0x1048 is set to 0x80000000, little-endian, as Point Grey's own examples do: the low
/// byte of a sample comes first and is the RIGHT eye's (docs/drivers.md has the evidence).
/// `eye_order` overrides how the bytes are read, not the register.
///
/// `width_px`, `height_px` 0: the whole sensor; another size than the sensor's is kUnsupported, and
/// so are registers of something that is no Bumblebee. kIoError names the register that could not
/// be reached.
Result<IidcSetup> configureIidc(RegisterBus& bus, int width_px, int height_px,
                                EyeOrder eye_order = EyeOrder::kAuto);

/// Ranges in seconds, dB and Hz from the absolute-value registers; a feature that has none counts
/// as absent, because nothing says what its steps mean. White balance: the camera's own steps.
Result<Capabilities> iidcCapabilities(const RegisterBus& bus);
/// Sets what is present in `controls` to manual. kUnsupported for a feature that is absent,
/// kInvalidInput with the range for a value outside of it; then nothing is written.
Status setIidcControls(RegisterBus& bus, const Controls& controls);
/// As in force; absent features stay empty.
Result<Controls> iidcControls(const RegisterBus& bus);
std::optional<double> iidcTemperatureC(const RegisterBus& bus);
Status startIidc(RegisterBus& bus);  ///< ISO_EN; also gates the bulk stream over USB
Status stopIidc(RegisterBus& bus);

/// Serial number (0x1F20); kIoError when it cannot be read.
Result<std::uint32_t> iidcSerialNumber(const RegisterBus& bus);

/// Embedded information at the head of a frame, high byte first: the cycle timer (7 bits seconds,
/// 13 bits cycles of 125 us, 12 bits of 24.576 MHz) when `embedded_timestamp`, then the frame
/// counter. A time that cannot be (cycle above 7999, offset above 3071) is left out, and both when
/// the frame is too short.
struct EmbeddedInfo {
  std::optional<Duration> cycle_time;  ///< 0..128 s, wraps
  std::optional<std::uint32_t> counter;
};
EmbeddedInfo readEmbeddedInfo(const std::uint8_t* bytes, std::size_t size,
                              const FrameFormat& format);

}  // namespace scanner::bumblebee
