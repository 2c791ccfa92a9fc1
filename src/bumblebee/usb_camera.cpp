#include "bumblebee/usb_camera.h"

#include <libusb-1.0/libusb.h>

#include <cmath>
#include <cstdio>
#include <utility>

#include "bumblebee/iidc.h"
#include "bumblebee/transports.h"
#include "bumblebee/usb_registers.h"
#include "bumblebee/usb_stream.h"

// Cameras that speak IIDC over USB, on libusb.

namespace scanner::bumblebee {

Duration CycleClock::unwrap(Duration cycle_time, Steady::time_point arrival) {
  constexpr Duration kTurn = std::chrono::seconds(128);
  Duration device = cycle_time;
  if (last_) {
    const Duration expected =
        last_->device + std::chrono::duration_cast<Duration>(arrival - last_->host);
    const double turns =
        static_cast<double>((expected - cycle_time).count()) / static_cast<double>(kTurn.count());
    device += std::llround(turns) * kTurn;
  }
  last_ = Moment{device, arrival};
  return device;
}

namespace {

constexpr std::uint16_t kVendor = 0x1E10;
constexpr std::uint16_t kProducts[] = {0x2000, 0x2001, 0x2002, 0x2003, 0x2004,
                                       0x2005, 0x3000, 0x3005, 0x3006, 0x3008,
                                       0x300A, 0x300B, 0x3103, 0x3300, 0x3800};
constexpr int kInterface = 0;

/// One camera on the bus; `handle` is empty and `identity.problem` set when it cannot be asked.
struct Found {
  CameraIdentity identity;
  std::string guid;
  UsbHandle handle;
};

std::string guidText(std::uint64_t guid) {
  char text[20];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(guid));
  return text;
}

bool isKnown(libusb_device* device) {
  libusb_device_descriptor descriptor{};
  if (libusb_get_device_descriptor(device, &descriptor) != LIBUSB_SUCCESS) return false;
  if (descriptor.idVendor != kVendor) return false;
  for (const std::uint16_t product : kProducts)
    if (descriptor.idProduct == product) return true;
  return false;
}

Found ask(libusb_device* device) {
  Found found;
  found.identity.transport = Transport::kUsb;
  found.identity.address = std::to_string(libusb_get_bus_number(device)) + "." +
                           std::to_string(libusb_get_device_address(device));
  const std::string name = "camera at USB " + found.identity.address;
  libusb_device_handle* opened = nullptr;
  const int error = libusb_open(device, &opened);
  if (error != LIBUSB_SUCCESS) {
    found.identity.problem = usbStatus(error, name).message();
    return found;
  }
  UsbHandle handle(opened);
  const UsbRegisters registers(opened);
  const auto rom = readConfigurationRom(registers);
  if (!rom) {
    found.identity.problem = name + ": " + rom.status().message();
    return found;
  }
  found.guid = guidText(rom->guid);
  found.identity.vendor = rom->vendor;
  found.identity.model = rom->model;
  const auto serial = iidcSerialNumber(registers);
  found.identity.serial = serial ? std::to_string(*serial) : found.guid;
  found.handle = std::move(handle);
  return found;
}

UsbContext newContext() {
  libusb_context* context = nullptr;
  if (libusb_init(&context) != LIBUSB_SUCCESS) return nullptr;
  return UsbContext(context);
}

/// In the order of the bus. The handles must be closed before the context.
std::vector<Found> findAll(libusb_context* context) {
  std::vector<Found> all;
  libusb_device** devices = nullptr;
  const auto count = libusb_get_device_list(context, &devices);
  for (ssize_t i = 0; i < count; ++i)
    if (isKnown(devices[i])) all.push_back(ask(devices[i]));
  if (count >= 0) libusb_free_device_list(devices, 1);
  return all;
}

class UsbStereoCamera : public StereoCamera {
 public:
  UsbStereoCamera(UsbContext context, Found&& found, const TransportOptions& options)
      : context_(std::move(context)),
        handle_(std::move(found.handle)),
        registers_(handle_.get()),
        stream_(context_.get(), handle_.get()),
        options_(options),
        identity_(std::move(found.identity)) {}
  ~UsbStereoCamera() override {
    UsbStereoCamera::stop();
    if (claimed_) libusb_release_interface(handle_.get(), kInterface);
  }

  Status claim();
  CameraIdentity identity() const override { return identity_; }
  Capabilities capabilities() const override { return capabilities_; }
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
  TransportStatistics statistics() const override { return stream_.statistics(); }

 private:
  UsbContext context_;
  UsbHandle handle_;
  UsbRegisters registers_;
  UsbStream stream_;
  TransportOptions options_;
  CameraIdentity identity_;
  Capabilities capabilities_;
  std::optional<FrameFormat> format_;
  CycleClock clock_;
  bool claimed_ = false, streaming_ = false;
};

Status UsbStereoCamera::claim() {
  const std::string name = "camera " + identity_.serial + " at USB " + identity_.address;
  libusb_set_auto_detach_kernel_driver(handle_.get(), 1);
  if (auto status = usbStatus(libusb_claim_interface(handle_.get(), kInterface), name); !status)
    return status;
  claimed_ = true;
  auto capabilities = iidcCapabilities(registers_);
  if (!capabilities)
    return {capabilities.status().code(), name + ": " + capabilities.status().message()};
  capabilities_ = *capabilities;
  return Status::ok();
}

Result<FrameFormat> UsbStereoCamera::configure(int width_px, int height_px,
                                               const Controls& controls) {
  stop();
  format_.reset();
  const auto setup = configureIidc(registers_, width_px, height_px, options_.eye_order);
  if (!setup) return setup.status();
  if (auto status = setIidcControls(registers_, controls); !status) return status;
  format_ = setup->format;
  capabilities_.device_clock = format_->embedded_timestamp;
  capabilities_.frame_counter = format_->embedded_counter;
  return *format_;
}

Status UsbStereoCamera::start() {
  stop();
  if (!format_) return {StatusCode::kInvalidInput, "start() before configure()"};
  clock_.reset();
  const std::size_t bytes = 2 * static_cast<std::size_t>(format_->width_px) *
                            static_cast<std::size_t>(format_->height_px);
  Status status = stream_.start(bytes, options_.buffers);
  if (status) status = startIidc(registers_);
  streaming_ = true;
  if (!status) stop();
  return status;
}

void UsbStereoCamera::stop() {
  if (!streaming_) return;
  streaming_ = false;
  // Failures mean that the camera is gone; then it does not send either.
  static_cast<void>(stopIidc(registers_));
  stream_.stop();
}

Result<RawFrame> UsbStereoCamera::grab(Duration timeout) {
  if (!streaming_) return Status(StatusCode::kIoError, "grab() before start()");
  auto frame = stream_.next(timeout);
  if (!frame) return frame.status();
  RawFrame raw;
  raw.status = frame->status;
  raw.arrival = frame->arrival;
  raw.moment = StampMoment::kStartOfTransmission;
  const EmbeddedInfo info = readEmbeddedInfo(frame->bytes.data(), frame->bytes.size(), *format_);
  if (info.counter) {
    raw.counter = *info.counter;
    raw.counter_max = 0xFFFFFFFF;
  }
  if (info.cycle_time) raw.device_time = clock_.unwrap(*info.cycle_time, frame->arrival_steady);
  if (raw.status)
    raw.bytes = std::make_shared<const std::vector<std::uint8_t>>(std::move(frame->bytes));
  return raw;
}

}  // namespace

std::vector<CameraIdentity> listUsb() {
  std::vector<CameraIdentity> identities;
  const UsbContext context = newContext();
  if (context == nullptr) return identities;
  for (Found& found : findAll(context.get())) identities.push_back(std::move(found.identity));
  return identities;
}

Result<std::unique_ptr<StereoCamera>> openUsb(const std::string& address,
                                              const TransportOptions& options) {
  UsbContext context = newContext();
  if (context == nullptr) return Status(StatusCode::kIoError, "USB is not available");
  std::string message = address.empty() ? "no camera on USB" : "no camera " + address + " on USB";
  std::vector<Found> all = findAll(context.get());
  for (Found& found : all) {
    const CameraIdentity& identity = found.identity;
    if (found.handle == nullptr) {
      message += "; " + identity.problem;
      continue;
    }
    if (!address.empty() && address != identity.address && address != identity.serial &&
        address != found.guid)
      continue;
    Found chosen = std::move(found);
    all.clear();  // other cameras' handles must not outlive the context
    auto camera = std::make_unique<UsbStereoCamera>(std::move(context), std::move(chosen), options);
    if (auto status = camera->claim(); !status) return status;
    return std::unique_ptr<StereoCamera>(std::move(camera));
  }
  return Status(StatusCode::kIoError, message);
}

}  // namespace scanner::bumblebee
