#include "bumblebee/usb_registers.h"

#include <algorithm>
#include <array>

#include "bumblebee/iidc_registers.h"

namespace scanner::bumblebee {
namespace {

constexpr unsigned kTimeout_ms = 1000;
constexpr std::uint64_t kInitialRegisters = 0xFFFFF0000000;
constexpr std::uint64_t kRom = kInitialRegisters + 0x400;
constexpr std::uint32_t kRomQuadlets = 256;

struct ControlAddress {
  std::uint8_t request = 0;
  std::uint16_t value = 0, index = 0;
};

Result<ControlAddress> controlAddress(std::uint64_t address) {
  ControlAddress control;
  control.value = static_cast<std::uint16_t>(address);
  control.index = static_cast<std::uint16_t>(address >> 16);
  if (address % 4 == 0 && address >> 32 == 0xFFFF) {
    control.request = 0x7F;
  } else if (address % 4 == 0 && address >> 32 == 0xD000) {
    control.request = 0x80;
  } else {
    return Status(StatusCode::kInvalidInput, "no register is at this address");
  }
  return control;
}

Status answered(int result) {
  if (result == 4) return Status::ok();
  if (result >= 0) return {StatusCode::kIoError, "the camera's answer is too short"};
  if (result == LIBUSB_ERROR_PIPE) return {StatusCode::kIoError, "the camera refuses"};
  return usbStatus(result, "control transfer");
}

/// One entry of a directory: 8 bits of key, 24 of value; offsets count quadlets from the entry.
struct Entry {
  std::uint32_t key = 0, value = 0;
  std::uint32_t target = 0;  ///< quadlet that the value points to, when it is an offset
};

class RomReader {
 public:
  explicit RomReader(const UsbRegisters& registers) : registers_(registers) {}

  Result<std::uint32_t> quadlet(std::uint32_t index) const {
    if (index >= kRomQuadlets)
      return Status(StatusCode::kUnsupported, "configuration ROM points outside of itself");
    return registers_.readAddress(kRom + 4ULL * index);
  }

  Result<std::vector<Entry>> directory(std::uint32_t index) const {
    const auto header = quadlet(index);
    if (!header) return header.status();
    std::vector<Entry> entries;
    const std::uint32_t length = *header >> 16;
    for (std::uint32_t i = 1; i <= length; ++i) {
      const auto entry = quadlet(index + i);
      if (!entry) return entry.status();
      const std::uint32_t value = *entry & 0xFFFFFF;
      entries.push_back({*entry >> 24, value, index + i + value});
    }
    return entries;
  }

  /// Text of a leaf: length, eight bytes of character set, then the characters.
  std::string text(std::uint32_t index) const {
    std::string characters;
    const auto header = quadlet(index);
    if (!header) return characters;
    for (std::uint32_t i = 3; i <= *header >> 16; ++i) {
      const auto four = quadlet(index + i);
      if (!four) break;
      for (int shift = 24; shift >= 0; shift -= 8) {
        const char c = static_cast<char>(*four >> shift & 0xFF);
        if (c == '\0') return characters;
        if (c >= ' ' && c <= '~') characters += c;
      }
    }
    return characters;
  }

 private:
  const UsbRegisters& registers_;
};

Status noUnit() {
  return {StatusCode::kUnsupported, "its configuration ROM has no IIDC unit: no IIDC camera"};
}

bool isCamera(const std::vector<Entry>& unit) {
  constexpr std::uint32_t kSpecifier = 0x12, kTradeAssociation = 0xA02D, kPointGrey = 0xB09D;
  return std::any_of(unit.begin(), unit.end(), [](const Entry& entry) {
    return entry.key == kSpecifier &&
           (entry.value == kTradeAssociation || entry.value == kPointGrey);
  });
}

Status readUnit(const RomReader& rom, std::uint32_t directory, ConfigurationRom* camera) {
  constexpr std::uint32_t kCommandRegisters = 0x40, kVendorName = 0x81, kModelName = 0x82;
  const auto entries = rom.directory(directory);
  if (!entries) return entries.status();
  for (const Entry& entry : *entries) {
    if (entry.key == kCommandRegisters)
      camera->command_base = kInitialRegisters + 4ULL * entry.value;
    if (entry.key == kVendorName) camera->vendor = rom.text(entry.target);
    if (entry.key == kModelName) camera->model = rom.text(entry.target);
  }
  return camera->command_base == 0 ? noUnit() : Status::ok();
}

}  // namespace

Status usbStatus(int error, const std::string& what) {
  if (error >= 0) return Status::ok();
  std::string reason = libusb_strerror(error);
  if (error == LIBUSB_ERROR_NO_DEVICE) reason = "unplugged";
  if (error == LIBUSB_ERROR_ACCESS)
    reason = "no permission: install the udev rules file 60-scanner.rules and plug it in again";
  if (error == LIBUSB_ERROR_BUSY) reason = "busy: another program has the camera; close it";
  if (error == LIBUSB_ERROR_NO_MEM)
    reason = "the kernel grants too little memory: set usbcore.usbfs_memory_mb to 200 or more";
  return {StatusCode::kIoError, what + ": " + reason};
}

Result<std::uint32_t> UsbRegisters::readAddress(std::uint64_t address) const {
  const auto control = controlAddress(address);
  if (!control) return control.status();
  std::array<unsigned char, 4> bytes{};
  const auto status =
      answered(libusb_control_transfer(handle_, 0xC0, control->request, control->value,
                                       control->index, bytes.data(), bytes.size(), kTimeout_ms));
  if (!status) return status;
  return static_cast<std::uint32_t>(bytes[0]) | static_cast<std::uint32_t>(bytes[1]) << 8 |
         static_cast<std::uint32_t>(bytes[2]) << 16 | static_cast<std::uint32_t>(bytes[3]) << 24;
}

Status UsbRegisters::writeAddress(std::uint64_t address, std::uint32_t value) {
  const auto control = controlAddress(address);
  if (!control) return control.status();
  std::array<unsigned char, 4> bytes{
      static_cast<unsigned char>(value), static_cast<unsigned char>(value >> 8),
      static_cast<unsigned char>(value >> 16), static_cast<unsigned char>(value >> 24)};
  return answered(libusb_control_transfer(handle_, 0x40, control->request, control->value,
                                          control->index, bytes.data(), bytes.size(), kTimeout_ms));
}

Result<std::uint32_t> UsbRegisters::read(std::uint64_t offset) const {
  return readAddress(kInitialRegisters + iidc::kCommandBase + offset);
}

Status UsbRegisters::write(std::uint64_t offset, std::uint32_t value) {
  return writeAddress(kInitialRegisters + iidc::kCommandBase + offset, value);
}

Result<ConfigurationRom> readConfigurationRom(const UsbRegisters& registers) {
  constexpr std::uint32_t kUnit = 0xD1, kUnitDependent = 0xD4;
  const RomReader rom(registers);
  const auto header = rom.quadlet(0);
  if (!header) return header.status();
  const std::uint32_t bus_information = *header >> 24;
  if (bus_information < 4) return noUnit();
  const auto high = rom.quadlet(3);
  if (!high) return high.status();
  const auto low = rom.quadlet(4);
  if (!low) return low.status();
  ConfigurationRom camera;
  camera.guid = static_cast<std::uint64_t>(*high) << 32 | *low;
  const auto root = rom.directory(1 + bus_information);
  if (!root) return root.status();
  for (const Entry& entry : *root) {
    if (entry.key != kUnit) continue;
    const auto unit = rom.directory(entry.target);
    if (!unit) return unit.status();
    if (!isCamera(*unit)) continue;
    for (const Entry& dependent : *unit) {
      if (dependent.key != kUnitDependent) continue;
      if (auto status = readUnit(rom, dependent.target, &camera); !status) return status;
      if (camera.command_base != kInitialRegisters + iidc::kCommandBase)
        return Status(StatusCode::kUnsupported,
                      "its registers are in an unusual place: no Bumblebee");
      return camera;
    }
  }
  return noUnit();
}

}  // namespace scanner::bumblebee
