#include "scanner/ros/rig_simulator_node.h"

#include <ros/init.h>
#include <ros/spinner.h>
#include <std_srvs/SetBool.h>

#include <filesystem>
#include <thread>

#include "ros/device_bring_up.h"
#include "ros/diagnostics.h"
#include "ros/scan_services.h"
#include "ros/simulated_rig.h"
#include "scanner/SetFaults.h"
#include "scanner/core/ply.h"
#include "scanner/ros/parameters.h"

namespace scanner::bridge {
namespace {

using simulation::FrameStore;
using simulation::Simulation;
using simulation::SimulationOptions;

constexpr std::chrono::milliseconds kRecheck(200);

SimulationOptions simulationOptions(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                                    const RigSimulatorOptions& options) {
  SimulationOptions simulation;
  loadBlock(nh, private_nh, "simulation", simulation);
  return options.full_quality ? simulation : simulation::realTime(simulation);
}

int threadCount(int threads) {
  if (threads > 0) return threads;
  return static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

}  // namespace

void describe(OptionVisitor& v, RigSimulatorOptions& o) {
  v.option("scene", o.scene, "artwork, totem, target, or the path of a mesh");
  v.option("seed", o.seed, {0, 1e9}, "", "of scene, motion and noise");
  v.option("full_quality", o.full_quality, "else one sample per pixel and no motion blur");
  v.option("prerender", o.prerender, "render all views before the motion starts");
  v.option("devices", o.devices, "emulate the two devices; else publish the sensors' topics");
  v.option("finish", o.finish, "finish the scan when the motion has ended, then exit");
  v.option("start_scan", o.start_scan, "with devices: start the scan when the motion begins");
  v.option("mesh", o.mesh, "build the mesh then");
  v.option("out", o.out, "scan folder to fill then; empty: none");
  v.option("startup_s", o.startup_s, {0.0, 3600.0}, "s", "how long the nodes may take to come up");
  v.option("threads", o.threads, {0, 1024}, "", "of the renderer; 0: all processors");
  v.option("mti_link", o.mti_link, "terminal of the emulated MTi");
  v.option("camera_interface", o.camera_interface, "address of the emulated camera");
  v.option("camera_serial", o.camera_serial, "serial number of the emulated camera");
}

class RigSimulatorNode::Impl {
 public:
  Impl(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
      : nh_(nh), private_nh_(private_nh) {
    loadPrivate(private_nh_, {"simulation"}, options_);
    simulation_ =
        std::make_unique<Simulation>(options_.scene, simulationOptions(nh_, private_nh_, options_),
                                     options_.seed, Time(), threadCount(options_.threads));
    frames_ = std::make_unique<FrameStore>(*simulation_);
    diagnostics_ = std::make_unique<Diagnostics>(
        nh_, private_nh_, "rig_simulator", [this](DiagnosticStatus& status) { report(status); });
  }

  Result<std::string> run();

 private:
  Status writeReference() const;
  bool waitForRendering();
  void makeRig();
  Status bringUpDevices();
  void offerServices(SimulatedDevices& devices);
  void report(DiagnosticStatus& status);

  ros::NodeHandle nh_, private_nh_;
  RigSimulatorOptions options_;
  std::unique_ptr<Simulation> simulation_;
  std::unique_ptr<FrameStore> frames_;
  std::mutex mutex_;  ///< of rig_, which the diagnostics look at
  std::shared_ptr<SimulatedRig> rig_;
  std::shared_ptr<SimulatedDevices> devices_;  ///< the same, when it is devices
  std::vector<ros::ServiceServer> services_;
  std::unique_ptr<Diagnostics> diagnostics_;
};

bool RigSimulatorNode::Impl::waitForRendering() {
  int said = -1;
  while (options_.prerender && ros::ok() && !frames_->waitForAll(kRecheck)) {
    const int tenth = 10 * frames_->rendered() / simulation_->views();
    if (tenth == said) continue;
    said = tenth;
    ROS_INFO("rendered %d of %d views", frames_->rendered(), simulation_->views());
  }
  return ros::ok();
}

void RigSimulatorNode::Impl::makeRig() {
  std::shared_ptr<SimulatedRig> rig;
  if (options_.devices) {
    const SimulatedDevices::Options where{options_.mti_link, options_.camera_interface,
                                          options_.camera_serial};
    auto devices = std::make_shared<SimulatedDevices>(nh_, *simulation_, *frames_, where);
    offerServices(*devices);
    devices_ = devices;
    rig = devices;
  } else {
    rig = makeSimulatedTopics(nh_, *simulation_, *frames_);
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  rig_ = rig;
}

Status RigSimulatorNode::Impl::bringUpDevices() {
  if (!devices_) return Status::ok();
  ROS_INFO("the devices are there; waiting for the drivers");
  const double patience_s = options_.finish ? options_.startup_s : 0.0;
  return bringUp(nh_, simulation_->rig().calibration, options_.start_scan, patience_s, *devices_);
}

void RigSimulatorNode::Impl::offerServices(SimulatedDevices& devices) {
  using Plug = std_srvs::SetBool;
  const auto plug = [this](const char* name, auto apply) {
    services_.push_back(private_nh_.advertiseService<Plug::Request, Plug::Response>(
        name, [apply](Plug::Request& request, Plug::Response& response) {
          apply(static_cast<bool>(request.data));
          response.success = true;
          response.message = request.data ? "plugged in" : "unplugged";
          return true;
        }));
  };
  plug("plug_camera", [&devices](bool in) { devices.plugCamera(in); });
  plug("plug_mti", [&devices](bool in) { devices.plugMti(in); });
  services_.push_back(private_nh_.advertiseService<
                      SetFaults::Request,
                      SetFaults::Response>("faults", [&devices](SetFaults::Request& request,
                                                                SetFaults::Response& response) {
    for (const double share : {request.lost_packets, request.corrupt_bytes, request.drop_bytes}) {
      if (share >= 0.0 && share <= 1.0) continue;
      response.message = "shares lie within 0 .. 1";
      return true;
    }
    DeviceFaults faults;
    faults.lost_packets = request.lost_packets;
    faults.mti = {request.corrupt_bytes, request.drop_bytes,
                  static_cast<bool>(request.answer_errors), static_cast<bool>(request.mute)};
    devices.setFaults(faults);
    response.success = true;
    response.message = "set";
    return true;
  }));
}

void RigSimulatorNode::Impl::report(DiagnosticStatus& status) {
  std::shared_ptr<SimulatedRig> rig;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    rig = rig_;
  }
  status.add("views", simulation_->views());
  status.add("rendered", frames_->rendered());
  if (!rig) return status.summary(kDiagnosticOk, "rendering");
  const SimulatedRigStatistics now = rig->statistics();
  status.add("shown", now.shown);
  status.add("missed", now.missed);
  if (now.missed > 0) return status.summary(kDiagnosticWarn, "the renderer is too slow");
  status.summary(kDiagnosticOk, "showing");
}

/// The truth that the scan is to be compared with stands beside it.
Status RigSimulatorNode::Impl::writeReference() const {
  if (options_.out.empty()) return Status::ok();
  std::error_code ignored;
  std::filesystem::create_directories(options_.out, ignored);
  return writePly(options_.out + "/reference.ply", referenceMesh(simulation_->scene()));
}

Result<std::string> RigSimulatorNode::Impl::run() {
  if (Status status = writeReference(); !status) return status;
  const Status interrupted(StatusCode::kIoError, "interrupted");
  if (!waitForRendering()) return interrupted;
  const ScanEnd end{options_.mesh, options_.out};
  makeRig();
  if (options_.finish) {
    const Status ready = waitForNodes(nh_, Topics(), end, options_.startup_s);
    if (!ready) return ready;
  }
  if (const Status up = bringUpDevices(); !up) return up;
  std::thread watch([this] {
    ros::waitForShutdown();
    rig_->stop();
  });
  rig_->run();
  const bool shut_down = !ros::ok();
  const SimulatedRigStatistics shown = rig_->statistics();
  ROS_INFO("motion ended: %d views shown, %d missed", shown.shown, shown.missed);
  Result<std::string> lines = std::string();
  if (shut_down) {
    lines = interrupted;
  } else if (options_.finish) {
    lines = finishScan(nh_, end);
  } else {
    ros::waitForShutdown();
  }
  ros::shutdown();
  watch.join();
  return lines;
}

RigSimulatorNode::RigSimulatorNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : impl_(std::make_unique<Impl>(nh, private_nh)) {}
RigSimulatorNode::~RigSimulatorNode() = default;
Result<std::string> RigSimulatorNode::run() { return impl_->run(); }

}  // namespace scanner::bridge
