#pragma once

#include <libusb-1.0/libusb.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "bumblebee/iidc.h"

/// Registers of an IIDC camera on USB: the address space of IEEE 1394, read and written a quadlet
/// at a time by vendor control transfers.
namespace scanner::bumblebee {

struct UsbFree {
  void operator()(libusb_context* context) const { libusb_exit(context); }
  void operator()(libusb_device_handle* handle) const { libusb_close(handle); }
};
using UsbContext = std::unique_ptr<libusb_context, UsbFree>;
using UsbHandle = std::unique_ptr<libusb_device_handle, UsbFree>;

/// Ok for what is not negative; else kIoError with what to do about it where that is known.
Status usbStatus(int error, const std::string& what);

class UsbRegisters : public RegisterBus {
 public:
  /// The handle must outlive this.
  explicit UsbRegisters(libusb_device_handle* handle) : handle_(handle) {}
  Result<std::uint32_t> read(std::uint64_t offset) const override;
  Status write(std::uint64_t offset, std::uint32_t value) override;

  /// Anywhere in the two spaces that cameras answer for: 0xFFFF........ and 0xD000.........
  Result<std::uint32_t> readAddress(std::uint64_t address) const;
  Status writeAddress(std::uint64_t address, std::uint32_t value);

 private:
  libusb_device_handle* handle_;
};

/// What the configuration ROM (IEEE 1212) says of an IIDC unit.
struct ConfigurationRom {
  std::uint64_t guid = 0;
  std::string vendor, model;
  std::uint64_t command_base = 0;  ///< address of the command registers
};
/// kUnsupported for a ROM without an IIDC (or Point Grey) unit or one that contradicts itself.
Result<ConfigurationRom> readConfigurationRom(const UsbRegisters& registers);

}  // namespace scanner::bumblebee
