#pragma once

#include <libusb-1.0/libusb.h>

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "scanner/bumblebee/stereo_camera.h"

namespace scanner::bumblebee {

/// Frames from a bulk endpoint, one transfer each, several queued in the kernel so that none is
/// missed between two. A thread of its own takes them; the newest ones wait for next().
/// start(), stop() and next() are called from one thread, statistics() from any.
class UsbStream {
 public:
  /// Both must outlive this; nobody else may use the endpoint.
  UsbStream(libusb_context* context, libusb_device_handle* handle) noexcept
      : context_(context), handle_(handle) {}
  ~UsbStream() { stop(); }
  UsbStream(const UsbStream&) = delete;
  UsbStream& operator=(const UsbStream&) = delete;

  /// Queues the transfers: to be called before the camera begins to send. Fewer than `buffers` (but
  /// at least 2) are made do with when the kernel grants no memory for more.
  Status start(std::size_t frame_bytes, int buffers);
  /// Cancels what is queued and waits until the kernel has given all of it back.
  void stop();

  struct Frame {
    std::vector<std::uint8_t> bytes;  ///< as many as came
    Status status;
    Time arrival;
    std::chrono::steady_clock::time_point arrival_steady;
  };
  /// kOutOfRange when none came in time; kIoError once the camera is gone.
  Result<Frame> next(Duration timeout);
  TransportStatistics statistics() const;

 private:
  struct TransferFree {
    void operator()(libusb_transfer* transfer) const { libusb_free_transfer(transfer); }
  };
  static void LIBUSB_CALL completed(libusb_transfer* transfer);
  void take(libusb_transfer* transfer);
  void keep(const libusb_transfer& transfer);
  void handOver(Frame frame);
  void damaged(const char* what);
  void halt();
  void fail(const Status& status);
  void submit(libusb_transfer* transfer);
  void cancelAll();
  void recover();
  void run();

  libusb_context* context_;
  libusb_device_handle* handle_;
  std::size_t frame_bytes_ = 0;
  std::vector<std::vector<std::uint8_t>> buffers_;
  std::vector<std::unique_ptr<libusb_transfer, TransferFree>> transfers_;
  std::thread thread_;

  mutable std::mutex mutex_;  ///< of all below
  std::condition_variable arrived_;
  std::deque<Frame> ready_;
  std::size_t in_flight_ = 0;
  bool stopping_ = false;
  bool halted_ = false;  ///< the endpoint stalled: transfers come back, then it is cleared
  int halts_ = 0;        ///< since the last good frame
  Status failure_;
  TransportStatistics statistics_;
};

}  // namespace scanner::bumblebee
