#include <arpa/inet.h>

#include <mutex>

#include "bumblebee/aravis_camera.h"
#include "bumblebee/aravis_features.h"
#include "bumblebee/aravis_support.h"
#include "bumblebee/transports.h"

namespace scanner::bumblebee {
namespace {

using aravis::Error;
using aravis::Object;
using std::chrono::milliseconds;

struct Found {
  CameraIdentity identity;
  std::string physical;  ///< MAC address, or GUID of a USB device
  std::string network;   ///< IP address; empty on USB
};

std::string text(const char* value) { return value != nullptr ? value : ""; }

bool isAddress(const std::string& address) {
  in_addr unused{};
  return ::inet_pton(AF_INET, address.c_str(), &unused) == 1;
}

/// Asks all interfaces, the loopback included, and listens until they have been silent for 1 s.
/// Aravis' list is one for the process, and its strings last until the next update.
std::vector<Found> discover() {
  static std::mutex mutex;
  const std::lock_guard<std::mutex> lock(mutex);
  arv_update_device_list();
  std::vector<Found> result;
  const unsigned int count = arv_get_n_devices();
  for (unsigned int i = 0; i < count; ++i) {
    Found found;
    found.identity.transport = Transport::kAravis;
    found.identity.address = text(arv_get_device_id(i));
    found.identity.vendor = text(arv_get_device_vendor(i));
    found.identity.model = text(arv_get_device_model(i));
    found.identity.serial = text(arv_get_device_serial_nbr(i));
    found.physical = text(arv_get_device_physical_id(i));
    if (text(arv_get_device_protocol(i)) == "GigEVision") {
      found.network = text(arv_get_device_address(i));
    }
    result.push_back(std::move(found));
  }
  return result;
}

/// Straight to the camera: by its name, Aravis would first ask a name server who that is.
Result<Object<ArvDevice>> openGigE(const std::string& address) {
  const aravis::ProbeResult probe = aravis::probeGigE(address, 3, milliseconds(400));
  if (!probe.answers) {
    return Status(StatusCode::kIoError, "no GigE Vision camera answers at " + address);
  }
  const Object<GInetAddress> local(g_inet_address_new_from_string(probe.local_address.c_str()));
  const Object<GInetAddress> remote(g_inet_address_new_from_string(address.c_str()));
  Error error;
  Object<ArvDevice> device(arv_gv_device_new(local.get(), remote.get(), error.out()));
  if (!device || error) {
    const Status status = error.status("camera at " + address);
    return status ? Status(StatusCode::kIoError, "camera at " + address + " cannot be opened")
                  : status;
  }
  if (arv_gv_device_is_controller(ARV_GV_DEVICE(device.get())) == FALSE) {
    aravis::freeLater([unused = device.release()] { g_object_unref(unused); });
    return Status(StatusCode::kIoError,
                  "camera at " + address + " is busy: another program controls it");
  }
  return device;
}

/// libusb's words are what there is to tell a missing permission from a camera in use.
Status explainUsb(const std::string& name, const Status& status) {
  const auto says = [&status](const char* word) {
    return status.message().find(word) != std::string::npos;
  };
  if (says("LIBUSB_ERROR_ACCESS")) {
    return {StatusCode::kIoError, "no permission to open USB camera " + name +
                                      " (udev rules not installed?): " + status.message()};
  }
  if (says("LIBUSB_ERROR_BUSY")) {
    return {StatusCode::kIoError,
            "USB camera " + name + " is busy, another program holds it: " + status.message()};
  }
  return status;
}

Result<Object<ArvDevice>> openUsbVision(const std::string& id) {
  Error error;
  Object<ArvDevice> device(arv_open_device(id.c_str(), error.out()));
  if (device && !error) return device;
  const Status status = error.status("camera " + id);
  return explainUsb(
      id, status ? Status(StatusCode::kIoError, "camera " + id + " cannot be opened") : status);
}

Result<Found> find(const std::string& address) {
  if (isAddress(address)) {
    Found found;
    found.identity.address = found.network = address;
    return found;
  }
  for (Found& found : discover()) {
    if (address.empty() || address == found.identity.address || address == found.identity.serial ||
        address == found.physical) {
      Result<Found> wanted(std::move(found));
      return wanted;
    }
  }
  for (const CameraIdentity& closed : aravis::closedUsbCameras()) {
    if (address.empty() || address == closed.serial) {
      return Status(StatusCode::kIoError, "USB camera " + closed.serial + ": " + closed.problem);
    }
  }
  return Status(StatusCode::kIoError, address.empty()
                                          ? "no GenICam camera (GigE Vision, USB3 Vision) found"
                                          : "no GenICam camera '" + address + "' found");
}

}  // namespace

std::vector<CameraIdentity> listAravis() {
  std::vector<CameraIdentity> result;
  for (Found& found : discover()) result.push_back(std::move(found.identity));
  for (CameraIdentity& closed : aravis::closedUsbCameras()) result.push_back(std::move(closed));
  return result;
}

Result<std::unique_ptr<StereoCamera>> openAravis(const std::string& address,
                                                 const TransportOptions& options) {
  Result<Found> found = find(address);
  if (!found) return found.status();
  Result<Object<ArvDevice>> device =
      found->network.empty() ? openUsbVision(found->identity.address) : openGigE(found->network);
  if (!device) return device.status();
  Error error;
  Object<ArvCamera> camera(arv_camera_new_with_device(device->get(), error.out()));
  if (!camera || error) {
    const Status status = error.status("camera " + found->identity.address);
    return status ? Status(StatusCode::kIoError, "camera cannot be used") : status;
  }
  CameraIdentity identity = found->identity;
  identity.transport = Transport::kAravis;
  identity.vendor = text(arv_camera_get_vendor_name(camera.get(), nullptr));
  identity.model = text(arv_camera_get_model_name(camera.get(), nullptr));
  identity.serial = text(arv_camera_get_device_serial_number(camera.get(), nullptr));
  identity.firmware = aravis::readText(camera.get(), "DeviceFirmwareVersion");
  if (identity.firmware.empty()) {
    identity.firmware = aravis::readText(camera.get(), "DeviceVersion");
  }
  return std::unique_ptr<StereoCamera>(std::make_unique<aravis::Camera>(
      std::move(camera), std::move(identity), found->network, options));
}

}  // namespace scanner::bumblebee
