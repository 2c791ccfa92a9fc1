#include "scanner/mti/driver.h"
#include "scanner/ros/mti_node.h"

namespace scanner::bridge {
namespace {

std::string described(const mti::FoundDevice& device) {
  std::string yaml = "port: " + device.port + "\n";
  if (!device.description.empty()) yaml += "adapter: \"" + device.description + "\"\n";
  yaml += "device_id: \"" + *device.device_id + "\"\n";
  yaml += "firmware: \"" + device.firmware + "\"\n";
  yaml += "baud_rate: " + std::to_string(device.baud_rate) + "\n";
  if (!device.problem.empty()) yaml += "problem: \"" + device.problem + "\"\n";
  return yaml;
}

std::string whyNot(const mti::FoundDevice& device) {
  if (device.problem.find(device.port) == 0) return device.problem;
  return device.port + ": " + (device.problem.empty() ? "no MTi answers" : device.problem);
}

}  // namespace

std::string listMtiPorts() {
  std::string lines;
  for (const mti::FoundDevice& device : mti::listPorts()) {
    lines += device.port + "\t" + device.description + "\t" + device.problem + "\n";
  }
  return lines.empty() ? lines : "port\tdescription\tproblem\n" + lines;
}

Result<std::string> probeMti(const std::string& port) {
  std::vector<mti::FoundDevice> ports;
  if (port.empty()) {
    ports = mti::listPorts();
  } else {
    ports.emplace_back();
    ports.back().port = port;
  }
  if (ports.empty()) return Status(StatusCode::kNotEnoughData, "no serial port found");
  std::string problems;
  for (const mti::FoundDevice& candidate : ports) {
    mti::FoundDevice device = mti::probe(candidate.port);
    if (device.description.empty()) device.description = candidate.description;
    if (device.device_id) return described(device);
    problems += (problems.empty() ? "" : "; ") + whyNot(device);
  }
  return Status(StatusCode::kIoError, problems);
}

}  // namespace scanner::bridge
