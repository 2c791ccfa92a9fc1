#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "bumblebee/aravis_support.h"

namespace scanner::bumblebee::aravis {
namespace {

namespace fs = std::filesystem;

/// First line of a small file; empty if there is none.
std::string line(const fs::path& path) {
  std::ifstream file(path);
  std::string result;
  std::getline(file, result);
  return result;
}

/// "5" of a bus or device as the folders below /dev/bus/usb write it: "005".
std::string threeDigits(const std::string& number) {
  return number.size() < 3 ? std::string(3 - number.size(), '0') + number : number;
}

}  // namespace

std::vector<CameraIdentity> closedUsbCameras(const std::string& devices, const std::string& nodes) {
  std::vector<CameraIdentity> result;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(devices, error)) {
    const std::string interface = entry.path().filename().string();
    // Miscellaneous, USB3 Vision; in the folder of an interface, "BUS-PORT:CONFIGURATION.NUMBER".
    if (line(entry.path() / "bInterfaceClass") != "ef" ||
        line(entry.path() / "bInterfaceSubClass") != "05") {
      continue;
    }
    const fs::path device = entry.path().parent_path() / interface.substr(0, interface.find(':'));
    const fs::path node = fs::path(nodes) / threeDigits(line(device / "busnum")) /
                          threeDigits(line(device / "devnum"));
    if (::access(node.c_str(), R_OK | W_OK) == 0) continue;
    CameraIdentity camera;
    camera.transport = Transport::kAravis;
    camera.vendor = line(device / "manufacturer");
    camera.model = line(device / "product");
    camera.serial = line(device / "serial");
    camera.address = camera.serial;
    camera.problem = "no permission to open " + node.string() + " (udev rules not installed?)";
    // A camera has two or three such interfaces.
    bool known = false;
    for (const CameraIdentity& other : result) known = known || other.problem == camera.problem;
    if (!known) result.push_back(std::move(camera));
  }
  return result;
}

}  // namespace scanner::bumblebee::aravis
