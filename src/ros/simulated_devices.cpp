#include <algorithm>
#include <cmath>
#include <optional>

#include "ros/simulated_rig.h"
#include "scanner/ros/conversions.h"
#include "scanner/simulation/emulated_bumblebee.h"

namespace scanner::bridge {

using simulation::EmulatedBumblebee;
using simulation::EmulatedMti;
using simulation::Exposure;
using simulation::FrameStore;
using simulation::MtiSample;
using simulation::Simulation;

namespace {

/// The rig stands still for so long in front of both drivers before the motion begins: their clocks
/// and the filters of the odometry settle.
constexpr double kSettleS = 4.0;

/// The samples from the first view on: before it the device repeats its first one, standing still.
std::vector<MtiSample> samplesFrom(const Simulation& simulation, double time_s) {
  std::vector<MtiSample> samples;
  for (const MtiSample& sample : simulation.samples()) {
    if (sample.time_s < time_s) continue;
    samples.push_back(sample);
    samples.back().time_s -= time_s;
  }
  return samples;
}

EmulatedMti::Options mtiOptions(const SimulatedDevices::Options& options) {
  EmulatedMti::Options mti;
  mti.link = options.mti_link;
  return mti;
}

EmulatedBumblebee::Options cameraOptions(const SimulatedDevices::Options& options,
                                         const Simulation& simulation) {
  EmulatedBumblebee::Options camera;
  camera.interface = options.camera_interface;
  camera.serial = options.camera_serial;
  camera.width_px = simulation.rig().calibration.left.width;
  camera.height_px = simulation.rig().calibration.left.height;
  camera.rate_hz = simulation.options().motion.view_rate_hz;
  camera.exposure = simulation.exposure();
  return camera;
}

}  // namespace

class SimulatedDevices::Impl {
 public:
  Impl(const ros::NodeHandle& nh, const Simulation& simulation, FrameStore& frames,
       const Options& options)
      : simulation_(simulation),
        frames_(frames),
        truth_(nh, simulation),
        mti_(mtiOptions(options), samplesFrom(simulation, simulation.viewTime(0))),
        camera_(cameraOptions(options, simulation),
                [this](std::uint64_t, const Exposure& exposure) { return take(exposure); }) {}

  void run() {
    Pacer pacer;
    pacer.begin(Duration(0));
    const double step = 1.0 / simulation_.options().imu.rate_hz;
    for (double next = 0.0; !ended() && !stopped_; next += step) {
      if (std::optional<double> time = motionTime())
        truth_.publish(*time, fromRos(ros::Time::now()));
      if (!pacer.waitUntil(next)) return;
    }
  }
  void stop() { stopped_ = true; }

  SimulatedRigStatistics statistics() const {
    return {frames_.rendered(), shown_.load(), missed_.load()};
  }

  EmulatedMti& mti() { return mti_; }
  EmulatedBumblebee& camera() { return camera_; }

 private:
  using Clock = std::chrono::steady_clock;

  /// Time on the motion's clock since the motion began.
  std::optional<double> motionTime() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!begun_) return std::nullopt;
    return simulation_.viewTime(0) + std::chrono::duration<double>(Clock::now() - *begun_).count();
  }
  bool ended() const {
    const std::optional<double> time = motionTime();
    return time && *time > simulation_.motion().duration();
  }

  /// Called by the camera at each exposure; decides when the motion begins.
  void beginWhenSettled() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (begun_ || mti_.statistics().messages_sent == 0) return;
    const Clock::time_point now = Clock::now();
    if (!settling_) settling_ = now;
    if (now - *settling_ < std::chrono::duration<double>(kSettleS)) return;
    begun_ = now;
    mti_.start();
  }

  /// The picture nearest to now, or black when it is not rendered yet.
  StereoFrame take(const Exposure& exposure) {
    beginWhenSettled();
    const double time = motionTime().value_or(simulation_.viewTime(0));
    const double rate = simulation_.options().motion.view_rate_hz;
    const int nearest = static_cast<int>(std::lround((time - simulation_.viewTime(0)) * rate));
    const int view = std::clamp(nearest, 0, simulation_.views() - 1);
    if (std::optional<StereoFrame> frame = frames_.frame(view, exposure)) {
      ++shown_;
      return *std::move(frame);
    }
    ++missed_;
    frames_.skipBefore(view + 1);
    const cv::Size size(simulation_.rig().calibration.left.width,
                        simulation_.rig().calibration.left.height);
    const Image black{cv::Mat::zeros(size, CV_8UC1), PixelFormat::kBayerRggb8};
    return {simulation_.viewStamp(view), black, black};
  }

  const Simulation& simulation_;
  FrameStore& frames_;
  TruthPublisher truth_;
  mutable std::mutex mutex_;
  std::optional<Clock::time_point> settling_, begun_;
  std::atomic<bool> stopped_{false};
  std::atomic<int> shown_{0}, missed_{0};
  EmulatedMti mti_;
  EmulatedBumblebee camera_;  // last: its thread calls take()
};

SimulatedDevices::SimulatedDevices(const ros::NodeHandle& nh, const Simulation& simulation,
                                   FrameStore& frames, const Options& options)
    : impl_(std::make_unique<Impl>(nh, simulation, frames, options)) {}
SimulatedDevices::~SimulatedDevices() = default;
void SimulatedDevices::run() { impl_->run(); }
void SimulatedDevices::stop() { impl_->stop(); }
SimulatedRigStatistics SimulatedDevices::statistics() const { return impl_->statistics(); }

void SimulatedDevices::plugCamera(bool in) {
  in ? impl_->camera().plug() : impl_->camera().unplug();
}
void SimulatedDevices::plugMti(bool in) { in ? impl_->mti().plug() : impl_->mti().unplug(); }

void SimulatedDevices::setFaults(const DeviceFaults& faults) {
  impl_->camera().setLostPackets(faults.lost_packets);
  impl_->mti().setFaults(faults.mti);
}

}  // namespace scanner::bridge
