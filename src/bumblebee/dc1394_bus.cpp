#include "bumblebee/dc1394_bus.h"

#include <dirent.h>
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace scanner::bumblebee {
namespace {

thread_local std::string last_log;

void keepLog(dc1394log_t /*type*/, const char* message, void* /*user*/) {
  last_log = message == nullptr ? "" : message;
  while (!last_log.empty() && std::isspace(static_cast<unsigned char>(last_log.back())) != 0)
    last_log.pop_back();
}

void dropLog(dc1394log_t /*type*/, const char* /*message*/, void* /*user*/) {}

std::string firstLine(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

/// Units are written "0x00a02d:0x000102 ...": specifier and version.
bool hasCameraUnit(const std::string& units) {
  return units.find("0x00a02d") != std::string::npos || units.find("0x00b09d") != std::string::npos;
}

std::string whyNotOpen(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
  if (fd >= 0) {
    ::close(fd);
    return "";
  }
  if (errno == EACCES || errno == EPERM)
    return "no permission: " + path +
           " cannot be opened; install the udev rules of docs/drivers.md or join the group video";
  return path + " cannot be opened: " + std::strerror(errno);
}

}  // namespace

std::vector<FireWireNode> fireWireNodes(const std::string& sys) {
  std::vector<FireWireNode> nodes;
  DIR* directory = ::opendir("/dev");
  if (directory == nullptr) return nodes;
  while (const dirent* entry = ::readdir(directory)) {
    const std::string name = entry->d_name;
    if (name.compare(0, 2, "fw") != 0 || name.size() < 3 ||
        std::isdigit(static_cast<unsigned char>(name[2])) == 0)
      continue;
    FireWireNode node;
    node.path = "/dev/" + name;
    node.problem = whyNotOpen(node.path);
    const std::filesystem::path device = std::filesystem::path(sys) / name;
    const std::filesystem::path unit = device / (name + ".0");
    node.guid = firstLine(device / "guid");
    if (node.guid.compare(0, 2, "0x") == 0) node.guid.erase(0, 2);
    node.vendor = firstLine(device / "vendor_name");
    node.model = firstLine(device / "model_name");
    // Names belong to the device or to the unit within it, as the camera's ROM has them.
    if (node.vendor.empty()) node.vendor = firstLine(unit / "vendor_name");
    if (node.model.empty()) node.model = firstLine(unit / "model_name");
    node.is_camera = hasCameraUnit(firstLine(device / "units"));
    nodes.push_back(node);
  }
  ::closedir(directory);
  std::sort(nodes.begin(), nodes.end(),
            [](const FireWireNode& a, const FireWireNode& b) { return a.path < b.path; });
  return nodes;
}

void captureDc1394Log() {
  static std::once_flag once;
  std::call_once(once, [] {
    dc1394_log_register_handler(DC1394_LOG_ERROR, keepLog, nullptr);
    dc1394_log_register_handler(DC1394_LOG_WARNING, keepLog, nullptr);
    dc1394_log_register_handler(DC1394_LOG_DEBUG, dropLog, nullptr);
  });
}

std::string takeDc1394Log() {
  std::string log;
  log.swap(last_log);
  return log;
}

Status dc1394Status(dc1394error_t error, const std::string& what) {
  const std::string log = takeDc1394Log();
  if (error == DC1394_SUCCESS) return Status::ok();
  const char* reason = dc1394_error_get_string(error);
  return {StatusCode::kIoError, what + ": " + (reason == nullptr ? "unknown error" : reason) +
                                    (log.empty() ? "" : " (" + log + ")")};
}

Result<std::uint32_t> Dc1394Registers::read(std::uint64_t offset) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::uint32_t value = 0;
  // The last failure of the library can be from the call before.
  takeDc1394Log();
  const auto error = dc1394_get_control_registers(camera_, offset, &value, 1);
  if (error != DC1394_SUCCESS) return dc1394Status(error, "FireWire read");
  return value;
}

Status Dc1394Registers::write(std::uint64_t offset, std::uint32_t value) {
  const std::lock_guard<std::mutex> lock(mutex_);
  takeDc1394Log();
  return dc1394Status(dc1394_set_control_registers(camera_, offset, &value, 1), "FireWire write");
}

}  // namespace scanner::bumblebee
