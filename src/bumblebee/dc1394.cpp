#include <dc1394/dc1394.h>
#include <poll.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <utility>

#include "bumblebee/dc1394_bus.h"
#include "bumblebee/dc1394_lateness.h"
#include "bumblebee/iidc.h"
#include "bumblebee/iidc_registers.h"
#include "bumblebee/transports.h"

// IEEE 1394 cameras, through libdc1394 on the kernel's FireWire stack.

namespace scanner::bumblebee {
namespace {

using Clock = std::chrono::steady_clock;

/// A FireWire bus has 8000 cycles a second, and a stream one packet in each.
constexpr double kCycle = 125e-6;
constexpr auto kMoment = std::chrono::milliseconds(5);

Time wallClock() {
  return Time(
      std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch()));
}

std::string guidText(std::uint64_t guid) {
  char text[20];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(guid));
  return text;
}

dc1394speed_t isoSpeed(int mbps) {
  return mbps >= 800   ? DC1394_ISO_SPEED_800
         : mbps >= 400 ? DC1394_ISO_SPEED_400
         : mbps >= 200 ? DC1394_ISO_SPEED_200
                       : DC1394_ISO_SPEED_100;
}

/// Only cameras of the FireWire stack have a bus generation; libdc1394 also finds USB cameras,
/// which are the business of the usb transport.
bool onFireWire(dc1394camera_t* camera) {
  std::uint32_t node = 0, generation = 0;
  return dc1394_camera_get_node(camera, &node, &generation) == DC1394_SUCCESS;
}

CameraIdentity identify(dc1394camera_t* camera, const RegisterBus& registers) {
  CameraIdentity identity;
  identity.transport = Transport::kDc1394;
  identity.address = guidText(camera->guid);
  identity.vendor = camera->vendor == nullptr ? "" : camera->vendor;
  identity.model = camera->model == nullptr ? "" : camera->model;
  if (const auto serial = iidcSerialNumber(registers)) identity.serial = std::to_string(*serial);
  return identity;
}

class Dc1394StereoCamera : public StereoCamera {
 public:
  Dc1394StereoCamera(Dc1394Context context, Dc1394Camera camera, const TransportOptions& options)
      : context_(std::move(context)),
        camera_(std::move(camera)),
        registers_(camera_.get()),
        options_(options),
        identity_(identify(camera_.get(), registers_)) {}
  ~Dc1394StereoCamera() override {
    Dc1394StereoCamera::stop();
    camera_.reset();
    releaseLeftovers();
  }

  CameraIdentity identity() const override { return identity_; }
  Capabilities capabilities() const override { return capabilities_; }
  Status readCapabilities();
  Result<FrameFormat> configure(int width_px, int height_px, const Controls& controls) override;
  Status start() override;
  Result<RawFrame> grab(Duration timeout) override;
  void stop() override;
  Status setControls(const Controls& controls) override {
    return setIidcControls(registers_, controls);
  }
  Result<Controls> controls() const override { return iidcControls(registers_); }
  Result<std::uint32_t> readRegister(std::uint64_t offset) const override {
    return registers_.read(offset);
  }
  Status writeRegister(std::uint64_t offset, std::uint32_t value) override {
    return registers_.write(offset, value);
  }
  std::optional<double> temperatureC() const override { return iidcTemperatureC(registers_); }
  TransportStatistics statistics() const override {
    const std::lock_guard<std::mutex> lock(statistics_mutex_);
    return statistics_;
  }

 private:
  Status setSpeed();
  Status setUpCapture();
  Result<bool> waitReadable(Clock::time_point deadline) const;
  Result<RawFrame> take(dc1394video_frame_t* frame, Time arrival, bool watched);
  Status gone(const std::string& what) const {
    return {StatusCode::kIoError, "camera " + identity_.address + " has left the bus: " + what};
  }
  void releaseLeftovers();

  Dc1394Context context_;
  Dc1394Camera camera_;
  mutable Dc1394Registers registers_;
  TransportOptions options_;
  CameraIdentity identity_;
  Capabilities capabilities_;
  std::optional<FrameFormat> format_;
  bool capturing_ = false;
  LatenessCheck lateness_;
  Clock::time_point last_empty_;  ///< when grab() last ended without a frame
  mutable std::mutex statistics_mutex_;
  TransportStatistics statistics_;
  /// libdc1394 keeps its capture file and buffers when the camera is gone at capture_stop.
  int capture_fd_ = -1;
  void* capture_buffers_ = nullptr;
  std::size_t capture_bytes_ = 0;
  bool left_over_ = false;
};

Status Dc1394StereoCamera::readCapabilities() {
  auto capabilities = iidcCapabilities(registers_);
  if (!capabilities) return capabilities.status();
  capabilities_ = *capabilities;
  capabilities_.device_clock = true;
  return Status::ok();
}

Status Dc1394StereoCamera::setSpeed() {
  const std::lock_guard<std::mutex> lock(registers_.mutex());
  takeDc1394Log();
  const bool fast = options_.iso_speed_mbps >= 800;
  if (fast && camera_->bmode_capable == DC1394_FALSE)
    return {StatusCode::kUnsupported, "this camera has no 1394b mode: 800 Mbit/s is not possible"};
  if (camera_->bmode_capable != DC1394_FALSE) {
    const auto error = dc1394_video_set_operation_mode(
        camera_.get(), fast ? DC1394_OPERATION_MODE_1394B : DC1394_OPERATION_MODE_LEGACY);
    if (error != DC1394_SUCCESS) return dc1394Status(error, "operation mode of the camera");
  }
  return dc1394Status(
      dc1394_video_set_iso_speed(camera_.get(), isoSpeed(options_.iso_speed_mbps)),
      "isochronous speed of " + std::to_string(options_.iso_speed_mbps) + " Mbit/s");
}

Result<FrameFormat> Dc1394StereoCamera::configure(int width_px, int height_px,
                                                  const Controls& controls) {
  stop();
  if (left_over_) return gone("open it again");
  format_.reset();
  // A stream that a crashed program left on would refuse another speed. A camera without power may
  // refuse this; configureIidc() does it again.
  static_cast<void>(stopIidc(registers_));
  if (auto status = setSpeed(); !status) return status;
  const auto setup = configureIidc(registers_, width_px, height_px, options_.eye_order);
  if (!setup) return setup.status();
  if (auto status = setIidcControls(registers_, controls); !status) return status;
  format_ = setup->format;
  return *format_;
}

Status Dc1394StereoCamera::setUpCapture() {
  const std::lock_guard<std::mutex> lock(registers_.mutex());
  const auto setUp = [this] {
    takeDc1394Log();
    return dc1394_capture_setup(camera_.get(),
                                static_cast<std::uint32_t>(std::max(2, options_.buffers)),
                                DC1394_CAPTURE_FLAGS_DEFAULT);
  };
  auto error = setUp();
  if (error == DC1394_NO_BANDWIDTH || error == DC1394_NO_ISO_CHANNEL) {
    // What a crashed program allocated stays allocated until the bus is reset; the living ones
    // claim theirs again after it.
    dc1394_reset_bus(camera_.get());
    error = setUp();
    if (error == DC1394_NO_BANDWIDTH || error == DC1394_NO_ISO_CHANNEL)
      return dc1394Status(error, "the FireWire bus is full: another camera or disk uses it");
  }
  return dc1394Status(error, "capture of camera " + identity_.address + " cannot be set up");
}

Status Dc1394StereoCamera::start() {
  stop();
  if (left_over_) return gone("open it again");
  if (!format_) return {StatusCode::kInvalidInput, "start() before configure()"};
  if (auto status = setUpCapture(); !status) return status;
  capturing_ = true;
  capture_fd_ = dc1394_capture_get_fileno(camera_.get());
  capture_buffers_ = nullptr;
  lateness_.reset();
  {
    const std::lock_guard<std::mutex> lock(statistics_mutex_);
    statistics_ = TransportStatistics();
  }
  if (auto status = startIidc(registers_); !status) {
    stop();
    return status;
  }
  return Status::ok();
}

void Dc1394StereoCamera::stop() {
  if (!capturing_) return;
  capturing_ = false;
  // Failures mean that the camera is gone; then it does not send either.
  static_cast<void>(stopIidc(registers_));
  const std::lock_guard<std::mutex> lock(registers_.mutex());
  left_over_ = dc1394_capture_stop(camera_.get()) != DC1394_SUCCESS;
}

void Dc1394StereoCamera::releaseLeftovers() {
  if (!left_over_) return;
  if (capture_buffers_ != nullptr) ::munmap(capture_buffers_, capture_bytes_);
  if (capture_fd_ >= 0) ::close(capture_fd_);
}

/// True when a frame can be taken, false at the deadline.
Result<bool> Dc1394StereoCamera::waitReadable(Clock::time_point deadline) const {
  for (;;) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now());
    pollfd waiting{capture_fd_, POLLIN, 0};
    const int ready = ::poll(&waiting, 1,
                             static_cast<int>(std::max<std::int64_t>(
                                 0, std::min<std::int64_t>(left.count() + 1, 60000))));
    if (ready < 0 && errno != EINTR) return gone(std::strerror(errno));
    if (ready > 0) {
      if ((waiting.revents & (POLLERR | POLLHUP | POLLNVAL)) != 0)
        return gone("unplugged, or without power");
      return true;
    }
    if (Clock::now() >= deadline) return false;
  }
}

Result<RawFrame> Dc1394StereoCamera::grab(Duration timeout) {
  if (!capturing_) return Status(StatusCode::kIoError, "grab() before start()");
  const auto begin = Clock::now();
  const auto deadline = begin + std::max(timeout, Duration(0));
  const auto at_once = waitReadable(begin);
  if (!at_once) return at_once.status();
  bool wait = !*at_once;
  // Whether it is known when the frame was complete: we wait for it now, or did a moment ago.
  const bool watched = wait || begin - last_empty_ < kMoment;
  for (;;) {
    if (wait) {
      const auto ready = waitReadable(deadline);
      if (!ready) return ready.status();
      if (!*ready) {
        last_empty_ = Clock::now();
        return Status(StatusCode::kOutOfRange, "no frame came in time");
      }
    }
    dc1394video_frame_t* frame = nullptr;
    takeDc1394Log();
    const auto error = dc1394_capture_dequeue(camera_.get(), DC1394_CAPTURE_POLICY_POLL, &frame);
    const Time arrival = wallClock();
    if (error != DC1394_SUCCESS) return gone(dc1394Status(error, "no frame").message());
    if (frame != nullptr) return take(frame, arrival, watched);
    wait = true;  // an event that was no frame
  }
}

/// Copies what is needed and gives the buffer back, whatever the frame is like.
Result<RawFrame> Dc1394StereoCamera::take(dc1394video_frame_t* frame, Time arrival, bool watched) {
  RawFrame raw;
  raw.arrival = arrival;
  raw.moment = StampMoment::kStartOfTransmission;
  const std::size_t wanted = 2 * static_cast<std::size_t>(format_->width_px) *
                             static_cast<std::size_t>(format_->height_px);
  const std::size_t received = frame->total_bytes;
  capture_buffers_ = frame->image - static_cast<std::size_t>(frame->id) * received;
  capture_bytes_ = received * static_cast<std::size_t>(std::max(2, options_.buffers));
  const EmbeddedInfo info = readEmbeddedInfo(frame->image, received, *format_);
  if (frame->timestamp != 0) raw.device_time = std::chrono::microseconds(frame->timestamp);
  const double transfer_s = kCycle * frame->packets_per_frame;
  if (dc1394_capture_is_frame_corrupt(camera_.get(), frame) != DC1394_FALSE) {
    raw.status = {StatusCode::kInvalidInput, "the bus says that the frame is damaged"};
  } else if (received < wanted) {
    raw.status = {StatusCode::kInvalidInput, "short frame: " + std::to_string(received) + " of " +
                                                 std::to_string(wanted) + " bytes"};
  } else if (raw.device_time && lateness_.isDamaged(*raw.device_time, arrival.time_since_epoch(),
                                                    transfer_s, info.counter, watched)) {
    raw.status = {StatusCode::kInvalidInput, "packets of the frame were lost: it came too late"};
  }
  if (info.counter) {
    raw.counter = *info.counter;
    raw.counter_max = 0xFFFFFFFF;
  }
  if (raw.status)
    raw.bytes =
        std::make_shared<const std::vector<std::uint8_t>>(frame->image, frame->image + wanted);
  takeDc1394Log();
  const auto error = dc1394_capture_enqueue(camera_.get(), frame);
  if (error != DC1394_SUCCESS)
    return gone(dc1394Status(error, "a buffer cannot be given back").message());
  const std::lock_guard<std::mutex> lock(statistics_mutex_);
  ++(raw.status ? statistics_.frames : statistics_.incomplete);
  statistics_.bytes += received;
  return raw;
}

Status noCamera(const std::string& address, const std::vector<FireWireNode>& nodes) {
  std::string message = address.empty() ? "no camera on the FireWire bus"
                                        : "no camera " + address + " on the FireWire bus";
  for (const auto& node : nodes)
    if (!node.problem.empty()) message += "; " + node.problem;
  return {StatusCode::kIoError, message};
}

Dc1394Context newContext() {
  captureDc1394Log();
  return Dc1394Context(dc1394_new());
}

std::vector<std::uint64_t> findGuids(dc1394_t* context) {
  std::vector<std::uint64_t> guids;
  dc1394camera_list_t* found = nullptr;
  if (context == nullptr || dc1394_camera_enumerate(context, &found) != DC1394_SUCCESS)
    return guids;
  const std::unique_ptr<dc1394camera_list_t, Dc1394Free> list(found);
  for (std::uint32_t i = 0; i < list->num; ++i) guids.push_back(list->ids[i].guid);
  return guids;
}

std::string withoutPrefix(const std::string& address) {
  std::string text = address;
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text.compare(0, 2, "0x") == 0 ? text.substr(2) : text;
}

}  // namespace

std::vector<CameraIdentity> listDc1394() {
  std::vector<CameraIdentity> cameras;
  const auto nodes = fireWireNodes();
  // Without a FireWire bus libdc1394 is not even asked: it would open USB cameras.
  if (nodes.empty()) return cameras;
  const Dc1394Context context = newContext();
  for (const std::uint64_t guid : findGuids(context.get())) {
    const Dc1394Camera camera(dc1394_camera_new(context.get(), guid));
    if (camera == nullptr || !onFireWire(camera.get())) continue;
    cameras.push_back(identify(camera.get(), Dc1394Registers(camera.get())));
  }
  for (const auto& node : nodes) {
    if (!node.is_camera || node.problem.empty()) continue;
    CameraIdentity identity;
    identity.transport = Transport::kDc1394;
    identity.address = node.guid.empty() ? node.path : node.guid;
    identity.vendor = node.vendor;
    identity.model = node.model;
    identity.problem = node.problem;
    cameras.push_back(identity);
  }
  return cameras;
}

Result<std::unique_ptr<StereoCamera>> openDc1394(const std::string& address,
                                                 const TransportOptions& options) {
  const auto nodes = fireWireNodes();
  if (nodes.empty())
    return Status(StatusCode::kIoError,
                  "no FireWire bus: there is no /dev/fw*; is a controller fitted and the kernel "
                  "module firewire_ohci loaded?");
  Dc1394Context context = newContext();
  if (context == nullptr) return Status(StatusCode::kIoError, "libdc1394 cannot be initialised");
  const std::string wanted = withoutPrefix(address);
  for (const std::uint64_t guid : findGuids(context.get())) {
    takeDc1394Log();
    Dc1394Camera camera(dc1394_camera_new(context.get(), guid));
    if (camera == nullptr || !onFireWire(camera.get())) continue;
    const CameraIdentity identity = identify(camera.get(), Dc1394Registers(camera.get()));
    if (!wanted.empty() && wanted != identity.address && wanted != identity.serial) continue;
    if (camera->command_registers_base != iidc::kCommandBase)
      return Status(
          StatusCode::kUnsupported,
          "camera " + identity.address + " keeps its registers in an unusual place: no Bumblebee");
    auto opened =
        std::make_unique<Dc1394StereoCamera>(std::move(context), std::move(camera), options);
    if (auto status = opened->readCapabilities(); !status) return status;
    return std::unique_ptr<StereoCamera>(std::move(opened));
  }
  return noCamera(address, nodes);
}

}  // namespace scanner::bumblebee
