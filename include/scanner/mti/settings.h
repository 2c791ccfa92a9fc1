#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "scanner/core/status.h"
#include "scanner/mti/message.h"

/// What a host asks of an MTi and how its answers read (MT0100P; MTi User Manual and MT Low Level
/// Communication documentation for later generations). Functions without state; thread-safe.
///
/// Functions that make a request throw ConfigurationError for a value that the protocol cannot
/// carry. Functions that read an answer give kInvalidInput when the message is not the answer to
/// that request or its length cannot be, kUnsupported when the device answered with an Error.
namespace scanner::mti {

enum class OrientationReset : std::uint8_t;  // scanner/mti/driver.h

// ---- any request -----------------------------------------------------------------------------

/// A request without data: a plain command (GoToConfig, Reset, ...), or the question for a setting.
Message request(MessageId id);

enum class AnswerKind {
  kAcknowledgement,  ///< identifier of the request + 1
  kError,            ///< the device refused something
  kOther,            ///< data, WakeUp, the answer to another request
};
AnswerKind answerKind(const Message& answer, MessageId request);
/// What an Error message says; kInvalidInput when it is none.
Result<ErrorCode> parseError(const Message& answer);
/// One line ("the baud rate is not possible"); the number for codes that are not documented.
std::string describe(ErrorCode code);

// ---- line ------------------------------------------------------------------------------------

/// All rates of SetBaudrate, bit/s, in the order in which trying them finds a device soonest.
const std::vector<int>& baudRates();
/// Identifier <-> bit/s. 921600 is written 0x80, which all generations know; 0x0A is read as well.
std::optional<std::uint8_t> baudRateIdentifier(int bits_per_second);
std::optional<int> baudRateOf(std::uint8_t identifier);
/// Holds from the next power-on or Reset; some devices change at once, so a host tries both.
Message setBaudRate(int bits_per_second);
Result<int> parseBaudRate(const Message& answer);

// ---- what it is ------------------------------------------------------------------------------

/// DeviceID: four bytes, eight with the latest generation.
Result<std::uint64_t> parseDeviceId(const Message& answer);
/// Eight hexadecimal digits, sixteen when it needs them.
std::string deviceIdText(std::uint64_t device_id);

struct FirmwareRevision {
  int major = 0;
  int minor = 0;
  int revision = 0;
  std::optional<std::uint32_t> build;  ///< devices since the MTi-10/100 series
};
Result<FirmwareRevision> parseFirmwareRevision(const Message& answer);
std::string toString(const FirmwareRevision& firmware);
/// Plain text, padding removed (ReqProductCode; not every old device knows it).
Result<std::string> parseProductCode(const Message& answer);

// ---- legacy output (MTData) ------------------------------------------------------------------

/// SetPeriod counts in 1/115200 s. The nearest period; nothing below 1.76 Hz or above 512 Hz.
std::optional<std::uint16_t> periodOfRate(double rate_hz);
double rateOfPeriod(std::uint16_t period);  ///< Hz; 0 for a period of 0
Message setPeriod(std::uint16_t period);
Message setOutputMode(std::uint16_t mode);
Message setOutputSettings(std::uint32_t settings);
/// Samples left out after each one sent; 0xFFFF: only when asked with ReqData.
Message setOutputSkipFactor(std::uint16_t skip);
/// 0 ignore; 1 count on when a sample was missed (factory); 2 also send an Error; 3 also go to
/// configuration.
Message setErrorMode(std::uint16_t mode);
Message setHeading(double heading_rad);
/// Codes of MT0100P 4.6.
Message resetOrientation(OrientationReset reset);

/// The value in the answer to a question for a setting of one, two or four bytes (SetPeriod,
/// SetOutputMode, SetOutputSettings, SetOutputSkipFactor, SetErrorMode), high byte first.
Result<std::uint32_t> parseNumber(const Message& answer, MessageId request, std::size_t bytes);

/// The answer to ReqConfiguration: 98 bytes about the bus, then 20 about each device on it; an MTi
/// is alone on it, so 118. Devices since the MTi-10/100 answer the same layout, filled in for
/// legacy output; what MTData2 carries is asked with SetOutputConfiguration.
struct DeviceConfiguration {
  std::uint32_t master_id = 0;
  std::uint16_t period = 0;  ///< 1/115200 s
  std::uint16_t skip_factor = 0;
  std::uint16_t sync_in_mode = 0;
  std::uint16_t sync_in_skip_factor = 0;
  std::uint32_t sync_in_offset = 0;  ///< ticks of 29.4912 MHz
  struct Device {
    std::uint32_t id = 0;
    std::uint16_t data_length = 0;  ///< of an MTData message, bytes
    std::uint16_t output_mode = 0;
    std::uint32_t output_settings = 0;
  };
  std::vector<Device> devices;  ///< at least one

  double rateHz() const;  ///< of the messages: 0 when they are sent on request only
};
Result<DeviceConfiguration> parseConfiguration(const Message& answer);
/// The inverse, for emulated devices. Throws ConfigurationError without a device.
Message encodeConfiguration(const DeviceConfiguration& configuration);

// ---- orientation filter ----------------------------------------------------------------------

/// The filter of the first MTi (table 3.2 of the thesis). Not in MT0100P; the set message is
/// that of a public client of that time, question and answer those of the vendor's old library: MID
/// 0xA0, first byte 0 = gain, 1 = weighting of the magnetometer ("rho"), then a float, then one
/// byte that says whether to store it; the question is the first byte alone, the answer repeats it
/// before the float. Later firmware answers Error 4 (message invalid) and knows filter scenarios
/// instead (below). Never seen with a real device, so a refusal must not keep a driver from
/// measuring.
enum class FilterParameter : std::uint8_t { kGain = 0, kWeighting = 1 };
/// Gain in Hz, above 0.01 up to 50 (factory: 1); weighting 0 to below 10 (factory: 1).
Message setFilterParameter(FilterParameter parameter, double value, bool store);
Message requestFilterParameter(FilterParameter parameter);
Result<double> parseFilterParameter(const Message& answer, FilterParameter parameter);

/// Firmware with the later filter has scenarios ("human", "machine", ...).
struct FilterScenario {
  std::uint8_t type = 0;  ///< what SetCurrentScenario takes
  std::uint8_t version = 0;
  std::string label;
};
Result<std::vector<FilterScenario>> parseFilterScenarios(const Message& answer);
Message setFilterScenario(std::uint8_t type);

// ---- output since the MTi-10/100 (MTData2) ---------------------------------------------------

/// One entry of SetOutputConfiguration.
struct OutputSelection {
  std::uint16_t identifier = 0;  ///< XDI with format and frame: namespace xdi in mt_data2.h
  std::uint16_t rate_hz = 0;     ///< kEveryMessage: with every packet
};
inline constexpr std::uint16_t kEveryMessage = 0xFFFF;
/// At most 32 entries; none asks for the present ones. {{0, 0}} makes the device speak MTData.
/// The answer carries what the device made of it: rates are rounded to what it can do.
Message setOutputConfiguration(const std::vector<OutputSelection>& selections);
Result<std::vector<OutputSelection>> parseOutputConfiguration(const Message& answer);

}  // namespace scanner::mti
