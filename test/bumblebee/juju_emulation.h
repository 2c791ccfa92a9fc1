#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "bumblebee/register_map.h"

namespace scanner::bumblebee {

/// A FireWire bus with one Bumblebee2 on it, as programs see it through the kernel's character
/// devices. The test program that links this has its own open, close, read, ioctl, mmap and
/// opendir, which stand before the C library's for every shared library in it: /dev/fw0 (the
/// controller) and /dev/fw1 (the camera) are answered here, everything else is passed on. So
/// libdc1394 runs unchanged above it. One at a time.
class JujuEmulation {
 public:
  JujuEmulation();
  ~JujuEmulation();

  RegisterMap& registers();
  std::uint64_t guid() const;

  /// Node files of the camera and of the controller.
  void unplug();
  void plug();
  void removeController();
  void denyAccess(bool denied);
  /// The generation of the bus changes, as it does when something is plugged in elsewhere.
  void resetBus();
  /// Isochronous allocations that fail from now on; a bus reset ends it unless `permanent`.
  void fillBus(bool permanent);

  /// Sends a frame whose first packet went out `age_us` ago. False when the camera does not send
  /// (ISO_EN, no context) or there is no free buffer.
  bool sendFrame(const std::vector<std::uint8_t>& bytes, std::int64_t age_us);
  std::int64_t lastStart() const;  ///< of the frame sent last, us since the epoch

  std::size_t freeBuffers() const;   ///< queued by the program and not yet filled
  std::size_t openFiles() const;     ///< of the emulated nodes
  std::size_t isoResources() const;  ///< allocated now
  std::size_t mappedBytes() const;   ///< of DMA buffers
  int busResetsAsked() const;        ///< by the program

  class Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::bumblebee
