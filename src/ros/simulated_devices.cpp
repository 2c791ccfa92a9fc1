#include <algorithm>
#include <cmath>
#include <future>
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
constexpr double kStillEndS = 0.8;  ///< at the end of every motion (simulation/motion.h)

/// On a clock that is 0 at the first view. What comes before is the rig standing still.
std::vector<MtiSample> samplesFromFirstView(const Simulation& simulation) {
  std::vector<MtiSample> samples = simulation.samples();
  for (MtiSample& sample : samples) sample.time_s -= simulation.viewTime(0);
  return samples;
}

EmulatedMti::Options mtiOptions(const SimulatedDevices::Options& options) {
  EmulatedMti::Options mti;
  mti.link = options.mti_link;
  mti.still_end_s = kStillEndS;
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

/// The picture that will be asked for next, made while the camera waits: a real one does not take
/// longer for a picture with more noise. Called from one thread.
class NextPicture {
 public:
  explicit NextPicture(const FrameStore& frames) : frames_(frames) {}

  std::optional<StereoFrame> take(int view, const Exposure& exposure) {
    const bool prepared = next_.valid() && view == view_ &&
                          exposure.exposure_s == exposure_.exposure_s &&
                          exposure.gain_db == exposure_.gain_db;
    return prepared ? next_.get() : frames_.frame(view, exposure);
  }
  void prepare(int view, const Exposure& exposure) {
    if (next_.valid()) next_.wait();
    view_ = view;
    exposure_ = exposure;
    next_ = std::async(std::launch::async,
                       [this, view, exposure] { return frames_.frame(view, exposure); });
  }

 private:
  const FrameStore& frames_;
  int view_ = -1;
  Exposure exposure_;
  std::future<std::optional<StereoFrame>> next_;
};

class SimulatedDevices::Impl {
 public:
  Impl(const ros::NodeHandle& nh, const Simulation& simulation, FrameStore& frames,
       const Options& options)
      : simulation_(simulation),
        frames_(frames),
        next_picture_(frames),
        truth_(nh, simulation),
        mti_(mtiOptions(options), samplesFromFirstView(simulation)),
        camera_(cameraOptions(options, simulation),
                [this](std::uint64_t, const Exposure& exposure) { return take(exposure); }) {
    built_.store(true);
  }

  void run() {
    Pacer pacer;
    pacer.begin(Duration(0));
    const double step = 1.0 / simulation_.options().imu.rate_hz;
    for (double next = 0.0; !ended() && !stopped_; next += step) {
      publishTruth(step);
      if (!pacer.waitUntil(next)) return;
    }
  }
  void stop() { stopped_ = true; }
  void allowMotion() { may_move_ = true; }
  bool settled() const { return settled_; }

  SimulatedRigStatistics statistics() const {
    return {frames_.rendered(), shown_.load(), missed_.load()};
  }

  EmulatedMti& mti() { return mti_; }
  EmulatedBumblebee& camera() { return camera_; }

 private:
  /// Time on the motion's clock at `now` of the wall clock, once the motion has begun.
  std::optional<double> motionTime(Time now) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!begun_) return std::nullopt;
    return simulation_.viewTime(0) + toSeconds(now - *begun_);
  }
  /// Every step up to now, also those that a busy machine was late for: between samples of the
  /// truth whoever compares with it draws straight lines.
  void publishTruth(double step) {
    const double begin = simulation_.viewTime(0);
    const std::optional<double> now = motionTime(fromRos(ros::Time::now()));
    if (!now) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    for (double time = begin + step * truths_; time <= *now; time = begin + step * truths_) {
      truth_.publish(time, *begun_ + fromSeconds(time - begin));
      ++truths_;
    }
  }

  /// With the last picture: there is none of how the motion ebbs away after it.
  bool ended() const {
    const std::optional<double> time = motionTime(fromRos(ros::Time::now()));
    const double period = 1.0 / simulation_.options().motion.view_rate_hz;
    return time && *time > simulation_.viewTime(simulation_.views() - 1) + 0.5 * period;
  }

  /// Called with the middle of each exposure; decides when the motion begins.
  void beginWhenSettled(Time mid_exposure) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (begun_ || mti_.statistics().messages_sent == 0) return;
    if (!settling_) settling_ = mid_exposure;
    settled_ = mid_exposure - *settling_ >= fromSeconds(kSettleS);
    if (!settled_ || !may_move_) return;
    begun_ = mid_exposure;
    mti_.start(toSeconds(mid_exposure - fromRos(ros::Time::now())));
  }

  /// The picture nearest to now, or black when it is not rendered yet.
  StereoFrame take(const Exposure& exposure) {
    if (!built_) return {};
    const Time middle = camera_.frameTime() + fromSeconds(0.5 * exposure.exposure_s);
    beginWhenSettled(middle);
    const double rate = simulation_.options().motion.view_rate_hz;
    const auto viewAt = [&](double time) {
      const long nearest = std::lround((time - simulation_.viewTime(0)) * rate);
      return std::clamp(static_cast<int>(nearest), 0, simulation_.views() - 1);
    };
    const double time = motionTime(middle).value_or(simulation_.viewTime(0));
    const int view = viewAt(time);
    std::optional<StereoFrame> frame = next_picture_.take(view, exposure);
    const bool moves = settled_ && may_move_;
    next_picture_.prepare(moves ? viewAt(time + 1.0 / rate) : view, exposure);
    if (frame) {
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
  NextPicture next_picture_;
  TruthPublisher truth_;
  int truths_ = 0;  ///< published
  mutable std::mutex mutex_;
  std::optional<Time> settling_, begun_;  ///< wall clock
  std::atomic<bool> built_{false}, stopped_{false}, settled_{false}, may_move_{false};
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
void SimulatedDevices::allowMotion() { impl_->allowMotion(); }
bool SimulatedDevices::settled() const { return impl_->settled(); }
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
