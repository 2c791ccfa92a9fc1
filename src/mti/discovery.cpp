#include "mti/discovery.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <optional>
#include <system_error>
#include <tuple>

#include "mti/device.h"
#include "mti/driver_options.h"

namespace scanner::mti {
namespace {

namespace fs = std::filesystem;

constexpr const char* kXsensVendor = "2639";
constexpr const char* kFtdiVendor = "0403";
/// Products that Xsens has programmed into FTDI's adapters: d388 .. d38f.
constexpr const char* kXsensFtdiProducts = "d38";
constexpr int kUsbDepth = 6;  ///< directories between a tty and its USB device, at most

std::string firstLine(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

bool startsWith(const std::string& text, const std::string& start) {
  return text.compare(0, start.size(), start) == 0;
}

/// The directory of the USB device that carries a tty.
std::optional<fs::path> usbDevice(const fs::path& tty) {
  std::error_code error;
  fs::path directory = fs::canonical(tty / "device", error);
  if (error) return std::nullopt;
  for (int i = 0; i < kUsbDepth && directory.has_relative_path(); ++i) {
    if (fs::exists(directory / "idVendor", error)) return directory;
    directory = directory.parent_path();
  }
  return std::nullopt;
}

Port::Kind kindOf(const std::string& vendor, const std::string& product) {
  if (vendor == kXsensVendor) return Port::Kind::kXsens;
  if (vendor != kFtdiVendor) return Port::Kind::kOtherUsb;
  return startsWith(product, kXsensFtdiProducts) ? Port::Kind::kXsens : Port::Kind::kFtdi;
}

/// Names that stay the same when a device is plugged in again, by the kernel's name.
std::map<std::string, std::string> stableNames(const fs::path& root) {
  std::map<std::string, std::string> names;
  std::error_code error;
  for (fs::directory_iterator entry(root / "dev/serial/by-id", error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    const fs::path target = fs::read_symlink(entry->path(), ignored);
    if (!ignored) names[target.filename().string()] = entry->path().string();
  }
  return names;
}

std::optional<Port> inspect(const fs::path& tty) {
  const std::string name = tty.filename().string();
  Port port;
  if (const std::optional<fs::path> usb = usbDevice(tty)) {
    port.kind = kindOf(firstLine(*usb / "idVendor"), firstLine(*usb / "idProduct"));
    const std::string maker = firstLine(*usb / "manufacturer");
    const std::string product = firstLine(*usb / "product");
    port.description = maker + (maker.empty() || product.empty() ? "" : " ") + product;
    return port;
  }
  // The kernel makes ports on spec; those without hardware are of type 0.
  const std::string type = firstLine(tty / "type");
  if (!startsWith(name, "ttyS") || type.empty() || type == "0") return std::nullopt;
  port.description = "built-in serial port";
  return port;
}

}  // namespace

std::vector<Port> findPorts(const fs::path& root) {
  const std::map<std::string, std::string> stable = stableNames(root);
  std::vector<Port> ports;
  std::error_code error;
  for (fs::directory_iterator entry(root / "sys/class/tty", error), end; !error && entry != end;
       entry.increment(error)) {
    std::optional<Port> port = inspect(entry->path());
    if (!port) continue;
    const std::string name = entry->path().filename().string();
    const auto known = stable.find(name);
    port->path = known != stable.end() ? known->second : (root / "dev" / name).string();
    ports.push_back(*port);
  }
  std::sort(ports.begin(), ports.end(), [](const Port& a, const Port& b) {
    return std::tie(a.kind, a.path) < std::tie(b.kind, b.path);
  });
  return ports;
}

std::vector<FoundDevice> listPorts() {
  std::vector<FoundDevice> found;
  for (const Port& port : findPorts()) {
    FoundDevice device;
    device.port = port.path;
    device.description = port.description;
    found.push_back(device);
  }
  return found;
}

FoundDevice probe(const std::string& port, const DriverOptions& options) {
  validate(options);
  FoundDevice found;
  found.port = port;
  for (const Port& known : findPorts()) {
    if (known.path == port) found.description = known.description;
  }
  const WakeUpCall never;
  SerialPort::Options line;
  line.two_stop_bits = options.two_stop_bits;
  line.low_latency = options.low_latency;
  Result<SerialPort> opened = SerialPort::open(port, line, &never);
  if (!opened) {
    found.problem = opened.status().message();
    return found;
  }
  Device device(std::move(*opened), options, never);
  device.listenFirst();
  Status status = device.find(0);
  if (status) {
    found.baud_rate = device.baudRate();
    status = device.identify();
  }
  if (status) {
    found.device_id = device.deviceId();
    found.firmware = device.firmware();
    if (device.wasMeasuring()) status = device.goToMeasurement();
  }
  if (!status) found.problem = status.message();
  return found;
}

}  // namespace scanner::mti
