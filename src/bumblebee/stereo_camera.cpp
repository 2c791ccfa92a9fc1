#include "scanner/bumblebee/stereo_camera.h"

#include <iterator>

#include "bumblebee/transports.h"

namespace scanner::bumblebee {

const char* toString(Transport transport) {
  switch (transport) {
    case Transport::kAravis:
      return "aravis";
    case Transport::kUsb:
      return "usb";
    case Transport::kDc1394:
      return "dc1394";
    case Transport::kFile:
      return "file";
  }
  return "unknown";
}

std::vector<CameraIdentity> listCameras(Transport transport) {
  switch (transport) {
    case Transport::kAravis:
      return listAravis();
    case Transport::kUsb:
      return listUsb();
    case Transport::kDc1394:
      return listDc1394();
    case Transport::kFile:
      break;  // a folder is named, not found
  }
  return {};
}

std::vector<CameraIdentity> listCameras() {
  std::vector<CameraIdentity> all;
  for (const Transport transport : {Transport::kAravis, Transport::kUsb, Transport::kDc1394}) {
    std::vector<CameraIdentity> found = listCameras(transport);
    all.insert(all.end(), std::make_move_iterator(found.begin()),
               std::make_move_iterator(found.end()));
  }
  return all;
}

Result<std::unique_ptr<StereoCamera>> openCamera(Transport transport, const std::string& address,
                                                 const TransportOptions& options) {
  switch (transport) {
    case Transport::kAravis:
      return openAravis(address, options);
    case Transport::kUsb:
      return openUsb(address, options);
    case Transport::kDc1394:
      return openDc1394(address, options);
    case Transport::kFile:
      return openFile(address, options);
  }
  return Status(StatusCode::kUnsupported, "no such transport");
}

}  // namespace scanner::bumblebee
