#pragma once

#include <arv.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "scanner/bumblebee/stereo_camera.h"
#include "scanner/core/status.h"
#include "scanner/core/time.h"

/// What the files of the Aravis transport share. Never included by others: arv.h brings all of
/// GLib.
namespace scanner::bumblebee::aravis {

struct Unref {
  void operator()(gpointer object) const { g_object_unref(object); }
};
template <typename T>
using Object = std::unique_ptr<T, Unref>;

struct Free {
  void operator()(gpointer memory) const { g_free(memory); }
};

/// The GError of a call, freed in the end.
class Error {
 public:
  Error() = default;
  ~Error() { g_clear_error(&error_); }
  Error(const Error&) = delete;
  Error& operator=(const Error&) = delete;

  /// For one call at a time.
  GError** out() {
    g_clear_error(&error_);
    return &error_;
  }
  explicit operator bool() const { return error_ != nullptr; }
  /// `doing`: "exposure", "start". Silence is kIoError, a refusal kInvalidInput; ok if none.
  Status status(const std::string& doing) const;

 private:
  GError* error_ = nullptr;
};

/// What is at an address, asked with one register of GigE Vision's bootstrap.
struct ProbeResult {
  bool answers = false;
  std::string local_address;  ///< of the interface that leads there; empty: no route
};
/// Asks `tries` times and waits `patience` for each answer; returns at once when the host says that
/// nobody listens. Reads a register that tells the camera nothing about who controls it.
ProbeResult probeGigE(const std::string& address, int tries, Duration patience);

/// Frees later, in a thread of its own, what belongs to a camera that is gone: Aravis waits 2.5 s
/// for the acknowledgement of each farewell, and the way back to work must not. The thread ends
/// with the program, having done what was left.
void freeLater(std::function<void()> job);

/// USB3 Vision cameras that this user may not open: Aravis' discovery passes over them. `devices`
/// and `nodes` are for tests.
std::vector<CameraIdentity> closedUsbCameras(const std::string& devices = "/sys/bus/usb/devices",
                                             const std::string& nodes = "/dev/bus/usb");

Time wallClock();

}  // namespace scanner::bumblebee::aravis
