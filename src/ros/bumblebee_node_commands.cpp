// --list and --probe of bumblebee_node: what is connected, without a master.
#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vector>

#include "scanner/bumblebee/factory_calibration.h"
#include "scanner/bumblebee/stereo_camera.h"
#include "scanner/ros/bumblebee_node.h"

namespace scanner::bridge {
namespace {

using bumblebee::CameraIdentity;
using bumblebee::Capabilities;
using bumblebee::ControlRange;
using bumblebee::Controls;
using bumblebee::FactoryCalibration;
using bumblebee::FrameFormat;
using bumblebee::StereoCamera;
using bumblebee::Transport;

/// A field of a table whose columns are tabs and whose rows are lines.
std::string field(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\t' || c == '\n' || c == '\r'; }, ' ');
  return text;
}

Status notFound(const std::string& address, const std::vector<CameraIdentity>& cameras) {
  std::string message = address.empty() ? "no camera found" : "no camera '" + address + "'";
  for (const CameraIdentity& camera : cameras) {
    message += (&camera == &cameras.front() ? "; there is " : ", ") + camera.address;
    if (!camera.serial.empty()) message += " (serial " + camera.serial + ")";
    if (!camera.problem.empty()) message += ": " + camera.problem;
  }
  return Status(StatusCode::kIoError, message);
}

Result<CameraIdentity> find(const std::string& address) {
  std::error_code ignored;
  if (!address.empty() && std::filesystem::is_directory(address, ignored)) {
    CameraIdentity folder;
    folder.transport = Transport::kFile;
    folder.address = address;
    return folder;
  }
  const std::vector<CameraIdentity> cameras = bumblebee::listCameras();
  const auto camera = std::find_if(cameras.begin(), cameras.end(), [&](const CameraIdentity& c) {
    return address.empty() ? c.problem.empty() : c.address == address || c.serial == address;
  });
  if (camera == cameras.end()) return notFound(address, cameras);
  return *camera;
}

ParameterTree toTree(const CameraIdentity& camera) {
  return {{"transport", bumblebee::toString(camera.transport)},
          {"address", camera.address},
          {"vendor", camera.vendor},
          {"model", camera.model},
          {"serial", camera.serial},
          {"firmware", camera.firmware}};
}

ParameterTree toTree(const std::optional<ControlRange>& range) {
  return range ? ParameterTree::array({range->min, range->max}) : ParameterTree();
}

ParameterTree toTree(const std::optional<double>& value) {
  return value ? ParameterTree(*value) : ParameterTree();
}

ParameterTree toTree(const Capabilities& camera) {
  return {{"size", {camera.width_px, camera.height_px}},
          {"exposure_s", toTree(camera.exposure_s)},
          {"gain_db", toTree(camera.gain_db)},
          {"rate_hz", toTree(camera.rate_hz)},
          {"white_balance", toTree(camera.white_balance)},
          {"registers", camera.registers},
          {"frame_counter", camera.frame_counter},
          {"device_clock", camera.device_clock},
          {"temperature", camera.temperature}};
}

ParameterTree toTree(const FrameFormat& format) {
  const bool left_first = format.order == bumblebee::ByteOrder::kLeftFirst;
  return {{"size", {format.width_px, format.height_px}},
          {"pixels", toString(format.pixels)},
          {"first_byte", left_first ? "left" : "right"},
          {"embedded_timestamp", format.embedded_timestamp},
          {"embedded_counter", format.embedded_counter}};
}

ParameterTree toTree(const Controls& controls) {
  return {{"exposure_s", toTree(controls.exposure_s)},
          {"gain_db", toTree(controls.gain_db)},
          {"rate_hz", toTree(controls.rate_hz)},
          {"white_balance_blue", toTree(controls.white_balance_blue)},
          {"white_balance_red", toTree(controls.white_balance_red)}};
}

/// The text of the camera begins with what it is; thousands of numbers follow.
ParameterTree toTree(const Result<FactoryCalibration>& calibration) {
  constexpr int kLines = 12;
  if (!calibration) return calibration.status().message();
  ParameterTree head = ParameterTree::array();
  std::istringstream lines(calibration->text);
  for (std::string line; std::getline(lines, line) && head.size() < kLines;) head.push_back(line);
  return {{"bytes", calibration->text.size()}, {"head", head}};
}

}  // namespace

std::string listBumblebees() {
  const std::vector<CameraIdentity> cameras = bumblebee::listCameras();
  if (cameras.empty()) return {};
  std::string table = "transport\taddress\tvendor\tmodel\tserial\tfirmware\tproblem\n";
  for (const CameraIdentity& camera : cameras) {
    table += bumblebee::toString(camera.transport);
    for (const std::string& text : {camera.address, camera.vendor, camera.model, camera.serial,
                                    camera.firmware, camera.problem}) {
      table += "\t" + field(text);
    }
    table += "\n";
  }
  return table;
}

Result<std::string> probeBumblebee(const std::string& address) {
  const Result<CameraIdentity> found = find(address);
  if (!found) return found.status();
  const Result<std::unique_ptr<StereoCamera>> opened =
      bumblebee::openCamera(found->transport, found->address, {});
  if (!opened) return opened.status();
  StereoCamera& camera = **opened;
  const Result<FrameFormat> format = camera.configure(0, 0, {});
  if (!format) return format.status();
  ParameterTree probed = {{"camera", toTree(camera.identity())},
                          {"capabilities", toTree(camera.capabilities())},
                          {"format", toTree(*format)},
                          {"temperature_c", toTree(camera.temperatureC())}};
  if (const Result<Controls> controls = camera.controls()) probed["controls"] = toTree(*controls);
  if (camera.capabilities().registers) {
    probed["factory_calibration"] = toTree(bumblebee::readFactoryCalibration(
        [&camera](std::uint64_t offset) { return camera.readRegister(offset); }));
  }
  return toYaml(probed);
}

}  // namespace scanner::bridge
