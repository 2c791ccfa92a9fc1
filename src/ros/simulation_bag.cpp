#include "scanner/ros/simulation_bag.h"

#include <algorithm>

#include "ros/recording_writer.h"

namespace scanner::bridge {
namespace {

using simulation::Simulation;

/// Truth and samples up to a stamp, in the order of time.
class SteadyStreams {
 public:
  SteadyStreams(const Simulation& simulation, Time first, Time last)
      : simulation_(simulation), truth_(simulation.truth()), last_(last) {
    const auto before = [](const StampedPose& pose, Time stamp) { return pose.stamp < stamp; };
    pose_ = static_cast<std::size_t>(std::lower_bound(truth_.begin(), truth_.end(), first, before) -
                                     truth_.begin());
    const auto& samples = simulation_.samples();
    while (sample_ < samples.size() && samples[sample_].imu.stamp < first) ++sample_;
  }

  void writeUpTo(Time stamp, RecordingWriter& writer) {
    const auto& samples = simulation_.samples();
    const Time limit = std::min(stamp, last_);
    while (true) {
      const bool pose_left = pose_ < truth_.size() && truth_[pose_].stamp <= limit;
      const bool sample_left = sample_ < samples.size() && samples[sample_].imu.stamp <= limit;
      if (!pose_left && !sample_left) return;
      if (pose_left && (!sample_left || truth_[pose_].stamp <= samples[sample_].imu.stamp)) {
        writer.writeTruth(truth_[pose_++]);
      } else {
        writer.writeImu(samples[sample_++].imu);
      }
    }
  }

 private:
  const Simulation& simulation_;
  Trajectory truth_;
  Time last_;
  std::size_t pose_ = 0;
  std::size_t sample_ = 0;
};

}  // namespace

Status writeSimulation(const Simulation& simulation, const std::string& bag_path,
                       const SimulationBagOptions& options,
                       const std::function<bool(std::size_t, std::size_t)>& progress) {
  const int last = options.last_view < 0 ? simulation.views() - 1
                                         : std::min(options.last_view, simulation.views() - 1);
  if (options.first_view < 0 || options.first_view > last) {
    throw ConfigurationError("first view " + std::to_string(options.first_view) +
                             " is not among the views 0 .. " + std::to_string(last));
  }
  // What is cut out keeps some standing still (or motion) before, for the filters to settle.
  constexpr Duration kMargin = fromSeconds(3.5);
  const Time from = simulation.viewStamp(options.first_view) - kMargin;
  const bool to_the_end = last + 1 == simulation.views();
  const Time to = to_the_end ? Time::max() : simulation.viewStamp(last) + fromSeconds(0.5);
  const simulation::SimulatedRig& rig = simulation.rig();
  return writeRecording(bag_path, options.compressed, [&](RecordingWriter& writer) {
    SteadyStreams streams(simulation, from, to);
    writer.writeTransforms(std::max(from, simulation.stampAt(0.0)), rig.T_base_camera,
                           rig.T_left_right);
    const std::size_t total = static_cast<std::size_t>(last - options.first_view) + 1;
    std::size_t done = 0;
    for (int view = options.first_view; view <= last; ++view) {
      streams.writeUpTo(simulation.viewStamp(view), writer);
      writer.writeFrame(simulation.frame(view), rig.calibration);
      if (progress && !progress(++done, total)) {
        return Status(StatusCode::kIoError, bag_path + ": interrupted, nothing was written");
      }
    }
    streams.writeUpTo(Time::max(), writer);
    return Status::ok();
  });
}

}  // namespace scanner::bridge
