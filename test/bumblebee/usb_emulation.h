#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "bumblebee/register_map.h"

namespace scanner::bumblebee {

/// A USB bus with one IIDC Bumblebee on it, as programs see it through usbdevfs, sysfs and libudev.
/// The test program that links this has its own open, close, ioctl, opendir, statfs and udev
/// functions, which stand before the libraries' own: the camera's node and sysfs files are answered
/// here, everything else is passed on. So libusb runs unchanged above it. The node can be polled as
/// the kernel's: POLLOUT when a transfer can be reaped, POLLERR when unplugged. One at a time.
class UsbEmulation {
 public:
  UsbEmulation();
  ~UsbEmulation();

  RegisterMap& registers();
  void unplug();
  void plug();  ///< with the next device number, as the kernel does
  void denyAccess(bool denied);
  void claimElsewhere(bool claimed);        ///< another program has the interface
  void limitTransfers(std::size_t number);  ///< usbfs memory is full with that many queued

  /// Completes the oldest queued bulk transfer with these bytes (an overflow when they are more).
  /// False when ISO_EN is off, nothing is queued, or the endpoint is halted.
  bool send(const std::vector<std::uint8_t>& bytes);
  bool stall();  ///< completes one transfer with a stall and halts the endpoint

  std::size_t queued() const;     ///< bulk transfers that the program waits for
  std::size_t unreaped() const;   ///< transfers of any kind that the kernel still has
  std::size_t openFiles() const;  ///< of the node
  int haltsCleared() const;
  int haltsClearedTooEarly() const;  ///< while transfers were queued

  class Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::bumblebee
