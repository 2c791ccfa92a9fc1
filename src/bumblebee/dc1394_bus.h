#pragma once

#include <dc1394/dc1394.h>

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "bumblebee/iidc.h"

/// What the FireWire transport needs besides streaming: libdc1394's context, device nodes, and
/// registers.
namespace scanner::bumblebee {

/// One character device of the kernel's FireWire stack ("/dev/fw1").
struct FireWireNode {
  std::string path;
  std::string problem;              ///< why it cannot be opened; else empty
  bool is_camera = false;           ///< by the unit in its configuration ROM (IIDC or Point Grey)
  std::string guid, vendor, model;  ///< as the kernel names them; may be empty
};
/// `sys`: where the kernel describes devices; it is readable without permission to the device.
std::vector<FireWireNode> fireWireNodes(const std::string& sys = "/sys/bus/firewire/devices");

/// libdc1394's own log goes nowhere; its last error or warning on this thread since the call before
/// is kept for the status line.
void captureDc1394Log();
std::string takeDc1394Log();
Status dc1394Status(dc1394error_t error, const std::string& what);

struct Dc1394Free {
  void operator()(dc1394_t* context) const { dc1394_free(context); }
  void operator()(dc1394camera_t* camera) const { dc1394_camera_free(camera); }
  void operator()(dc1394camera_list_t* list) const { dc1394_camera_free_list(list); }
};
using Dc1394Context = std::unique_ptr<dc1394_t, Dc1394Free>;
using Dc1394Camera = std::unique_ptr<dc1394camera_t, Dc1394Free>;

/// Registers of one camera. libdc1394 reads answers from the device's file without a lock, so all
/// calls that talk to the camera hold mutex().
class Dc1394Registers : public RegisterBus {
 public:
  explicit Dc1394Registers(dc1394camera_t* camera) : camera_(camera) {}
  Result<std::uint32_t> read(std::uint64_t offset) const override;
  Status write(std::uint64_t offset, std::uint32_t value) override;
  std::mutex& mutex() const { return mutex_; }

 private:
  dc1394camera_t* camera_;
  mutable std::mutex mutex_;
};

}  // namespace scanner::bumblebee
