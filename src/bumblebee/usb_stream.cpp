#include "bumblebee/usb_stream.h"

#include <algorithm>
#include <string>
#include <utility>

#include "bumblebee/usb_registers.h"

namespace scanner::bumblebee {
namespace {

constexpr unsigned char kEndpoint = 0x81;
constexpr int kFewestBuffers = 2;
/// An endpoint that stalls that often without a frame in between does not recover.
constexpr int kMostHalts = 10;

}  // namespace

Status UsbStream::start(std::size_t frame_bytes, int buffers) {
  stop();
  const std::lock_guard<std::mutex> lock(mutex_);
  ready_.clear();
  statistics_ = TransportStatistics();
  failure_ = Status::ok();
  // Stopped before a stall was over.
  if (halted_) static_cast<void>(libusb_clear_halt(handle_, kEndpoint));
  stopping_ = halted_ = false;
  halts_ = 0;
  frame_bytes_ = frame_bytes;
  const auto count = static_cast<std::size_t>(std::max(kFewestBuffers, buffers));
  buffers_.assign(count, std::vector<std::uint8_t>(frame_bytes));
  for (auto& buffer : buffers_) {
    std::unique_ptr<libusb_transfer, TransferFree> transfer(libusb_alloc_transfer(0));
    if (transfer == nullptr) return {StatusCode::kIoError, "no memory for transfers"};
    libusb_fill_bulk_transfer(transfer.get(), handle_, kEndpoint, buffer.data(),
                              static_cast<int>(buffer.size()), &UsbStream::completed, this, 0);
    const int error = libusb_submit_transfer(transfer.get());
    if (error == LIBUSB_ERROR_NO_MEM && in_flight_ >= kFewestBuffers) break;
    if (error != LIBUSB_SUCCESS) {
      fail(usbStatus(error, "frames cannot be asked for"));
      break;
    }
    ++in_flight_;
    transfers_.push_back(std::move(transfer));
  }
  if (!transfers_.empty()) thread_ = std::thread(&UsbStream::run, this);
  return failure_;  // the transfers that were queued come back in stop()
}

void UsbStream::stop() {
  if (thread_.joinable()) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
      cancelAll();
    }
    libusb_interrupt_event_handler(context_);
    thread_.join();
  }
  transfers_.clear();
  buffers_.clear();
  const std::lock_guard<std::mutex> lock(mutex_);
  ready_.clear();
}

void UsbStream::run() {
  for (;;) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (in_flight_ == 0) {
        if (stopping_ || !failure_) return;
        if (halted_) recover();
        if (in_flight_ == 0) return;
      }
    }
    // Woken by every event; the time-out only bounds the wait should a wake-up get lost.
    timeval timeout{1, 0};
    const int error = libusb_handle_events_timeout_completed(context_, &timeout, nullptr);
    if (error != LIBUSB_SUCCESS && error != LIBUSB_ERROR_INTERRUPTED) {
      const std::lock_guard<std::mutex> lock(mutex_);
      fail(usbStatus(error, "USB events"));
      cancelAll();
    }
  }
}

void UsbStream::completed(libusb_transfer* transfer) {
  static_cast<UsbStream*>(transfer->user_data)->take(transfer);
}

void UsbStream::take(libusb_transfer* transfer) {
  const std::lock_guard<std::mutex> lock(mutex_);
  --in_flight_;
  switch (transfer->status) {
    case LIBUSB_TRANSFER_COMPLETED:
      keep(*transfer);
      break;
    case LIBUSB_TRANSFER_CANCELLED:
      break;
    case LIBUSB_TRANSFER_OVERFLOW:
      damaged("the camera sent more than a frame");
      break;
    case LIBUSB_TRANSFER_NO_DEVICE:
      fail(usbStatus(LIBUSB_ERROR_NO_DEVICE, "camera"));
      break;
    case LIBUSB_TRANSFER_STALL:
      damaged("the camera's endpoint stalled");
      halt();
      break;
    case LIBUSB_TRANSFER_ERROR:
    case LIBUSB_TRANSFER_TIMED_OUT:
      damaged("transfer failed on the bus");
      halt();
      break;
  }
  if (!stopping_ && !halted_ && failure_) submit(transfer);
}

void UsbStream::keep(const libusb_transfer& transfer) {
  if (transfer.actual_length == 0) return;  // an empty packet ends a frame, it is none
  Frame frame;
  const auto length = static_cast<std::size_t>(transfer.actual_length);
  frame.bytes.assign(transfer.buffer, transfer.buffer + length);
  statistics_.bytes += length;
  if (length == frame_bytes_) {
    ++statistics_.frames;
    halts_ = 0;
  } else {
    ++statistics_.incomplete;
    frame.status = {StatusCode::kInvalidInput, "short frame: " + std::to_string(length) + " of " +
                                                   std::to_string(frame_bytes_) + " bytes"};
  }
  handOver(std::move(frame));
}

void UsbStream::damaged(const char* what) {
  ++statistics_.incomplete;
  Frame frame;
  frame.status = {StatusCode::kInvalidInput, what};
  handOver(std::move(frame));
}

void UsbStream::handOver(Frame frame) {
  frame.arrival = Time(
      std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch()));
  frame.arrival_steady = std::chrono::steady_clock::now();
  if (ready_.size() >= buffers_.size()) {
    ready_.pop_front();
    ++statistics_.overruns;
  }
  ready_.push_back(std::move(frame));
  arrived_.notify_all();
}

/// A halted endpoint may be cleared only when nothing is queued on it.
void UsbStream::halt() {
  if (halted_) return;
  halted_ = true;
  if (++halts_ > kMostHalts)
    fail({StatusCode::kIoError, "camera: its endpoint fails again and again; plug it in again"});
  cancelAll();
}

void UsbStream::recover() {
  halted_ = false;
  if (const int error = libusb_clear_halt(handle_, kEndpoint); error != LIBUSB_SUCCESS)
    return fail(usbStatus(error, "a stalled endpoint cannot be cleared"));
  for (auto& transfer : transfers_)
    if (failure_) submit(transfer.get());
}

void UsbStream::submit(libusb_transfer* transfer) {
  const int error = libusb_submit_transfer(transfer);
  if (error == LIBUSB_SUCCESS) {
    ++in_flight_;
  } else if (error != LIBUSB_ERROR_NO_MEM || in_flight_ == 0) {
    fail(usbStatus(error, "camera"));
  }
}

void UsbStream::cancelAll() {
  // Those that are not queued answer that they are not.
  for (auto& transfer : transfers_) libusb_cancel_transfer(transfer.get());
}

void UsbStream::fail(const Status& status) {
  if (!failure_) return;
  failure_ = status;
  arrived_.notify_all();
}

Result<UsbStream::Frame> UsbStream::next(Duration timeout) {
  std::unique_lock<std::mutex> lock(mutex_);
  arrived_.wait_for(lock, std::max(timeout, Duration(0)),
                    [this] { return !ready_.empty() || !failure_; });
  if (!ready_.empty()) {
    Frame frame = std::move(ready_.front());
    ready_.pop_front();
    return frame;
  }
  if (!failure_) return failure_;
  return Status(StatusCode::kOutOfRange, "no frame came in time");
}

TransportStatistics UsbStream::statistics() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return statistics_;
}

}  // namespace scanner::bumblebee
