#include <utility>

#include "bumblebee/driver_impl.h"
#include "scanner/bumblebee/factory_calibration.h"

namespace scanner::bumblebee {
namespace {

std::vector<Transport> transportsOf(TransportChoice choice) {
  switch (choice) {
    case TransportChoice::kAuto:
      return {Transport::kAravis, Transport::kUsb, Transport::kDc1394};
    case TransportChoice::kAravis:
      return {Transport::kAravis};
    case TransportChoice::kUsb:
      return {Transport::kUsb};
    case TransportChoice::kDc1394:
      return {Transport::kDc1394};
    case TransportChoice::kFile:
      return {Transport::kFile};
  }
  return {};
}

}  // namespace

CameraBus CameraBus::system() {
  return {[](Transport transport) { return listCameras(transport); },
          [](Transport transport, const std::string& address, const TransportOptions& options) {
            return openCamera(transport, address, options);
          }};
}

Result<std::unique_ptr<StereoCamera>> DriverCore::search() {
  std::string problems;
  for (const Transport transport : transportsOf(options().transport)) {
    if (!wait(0.0)) break;  // searching a network takes its time
    Result<std::unique_ptr<StereoCamera>> camera = openOn(transport);
    if (camera) return camera;
    problems += (problems.empty() ? "" : "; ") + std::string(toString(transport)) + ": " +
                camera.status().message();
  }
  return Status(StatusCode::kIoError, problems.empty() ? "the driver stops" : problems);
}

/// The address of the options may be a serial number. Transports that do not know it as such are
/// asked for a list, which is slow, so only then.
Result<std::unique_ptr<StereoCamera>> DriverCore::openOn(Transport transport) {
  const DriverOptions wanted = options();
  Result<std::unique_ptr<StereoCamera>> camera = bus_.open(transport, wanted.address, wanted.bus);
  if (camera || wanted.address.empty() || transport == Transport::kFile) return camera;
  for (const CameraIdentity& listed : bus_.list(transport)) {
    if (listed.serial != wanted.address || listed.address == wanted.address) continue;
    return bus_.open(transport, listed.address, wanted.bus);
  }
  return camera;
}

Status DriverCore::connect(std::unique_ptr<StereoCamera> camera) {
  const DriverOptions wanted = options();
  const CameraIdentity identity = camera->identity();
  const Capabilities before = camera->capabilities();
  std::string refused;
  Controls controls;
  {
    const std::lock_guard<std::mutex> access(access_);
    setUpMetering(wanted, before);
    controls = wantedControls(wanted, before, refused);
  }
  const Result<FrameFormat> format = camera->configure(wanted.width_px, wanted.height_px, controls);
  if (!format) return format.status();
  if (Status status = checkFormat(*format); !status) return status;
  format_ = *format;
  const Capabilities capabilities = camera->capabilities();
  if (capabilities.registers) readFactoryCalibration(*camera, identity);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    statistics_.camera = identity;
    statistics_.capabilities = capabilities;
    statistics_.format = *format;
    if (!capabilities.registers) statistics_.factory_calibration.clear();
    refused_ = refused;
    lost_packets_before_ = statistics_.lost_packets;
  }
  const double assumed = assumedLatency(identity, *format, wanted.bus);
  clock_.restart(wanted.latency_s >= 0.0 ? wanted.latency_s : assumed);
  const std::lock_guard<std::mutex> access(access_);
  if (Status status = camera->start(); !status) return status;
  // Options may have changed meanwhile; and what the camera made of them is known only now.
  camera_ = std::move(camera);
  readBack(*camera_);
  applyOptions(*camera_);
  return Status::ok();
}

void DriverCore::readFactoryCalibration(const StereoCamera& camera,
                                        const CameraIdentity& identity) {
  if (!identity.serial.empty() && identity.serial == calibration_serial_) return;
  const Result<FactoryCalibration> calibration = bumblebee::readFactoryCalibration(
      [&camera](std::uint64_t offset) { return camera.readRegister(offset); });
  calibration_serial_ = calibration ? identity.serial : "";
  const std::lock_guard<std::mutex> lock(mutex_);
  statistics_.factory_calibration = calibration ? calibration->text : "";
}

void DriverCore::disconnect() {
  const std::lock_guard<std::mutex> access(access_);
  if (camera_ == nullptr) return;
  const TransportStatistics transport = camera_->statistics();
  camera_->stop();
  camera_.reset();
  const std::lock_guard<std::mutex> lock(mutex_);
  statistics_.lost_packets = lost_packets_before_ + transport.lost_packets;
  statistics_.temperature_c.reset();
  meter_.clear();
}

}  // namespace scanner::bumblebee
