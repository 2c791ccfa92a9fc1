#include "scanner/simulation/simulation.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "scanner/simulation/random.h"

namespace scanner::simulation {
namespace {

/// Independent streams of randomness from the one seed of a simulation.
enum Stream { kSceneStream = 1, kRigStream, kMotionStream, kImuStream, kNoiseStream };

int streamSeed(int seed, Stream stream) {
  constexpr std::uint64_t kPositiveInt = 0x7fffffffU;
  return static_cast<int>(mixSeed(static_cast<std::uint64_t>(seed), stream) & kPositiveInt);
}

/// The one block of a file.
struct SimulationFile {
  SimulationOptions simulation;
};
void describe(OptionVisitor& v, SimulationFile& o) {
  v.group("simulation", o.simulation, "the simulated rig");
}

MotionSubject subjectOf(const Scene& scene, const SimulatedRig& rig) {
  MotionSubject subject;
  subject.bounds = scene.bounds.cast<double>();
  subject.T_base_camera = rig.T_base_camera;
  subject.path = scene.name == "totem" ? "passes" : "orbit";
  return subject;
}

}  // namespace

void describe(OptionVisitor& v, SimulationOptions& o) {
  v.group("scene", o.scene, "what is scanned");
  v.group("rig", o.rig, "the two cameras and where they sit on the body");
  v.group("render", o.render, "how the pictures are made");
  v.group("sensor", o.sensor, "the image sensor");
  v.group("motion", o.motion, "how the rig is carried");
  v.group("imu", o.imu, "the inertial sensor");
  v.option("truth_rate_hz", o.truth_rate_hz, {1.0, 1000.0}, "Hz", "poses of the ground truth");
}

SimulationOptions loadSimulation(const std::string& path) {
  const ParameterTree tree = readYaml(path);
  SimulationFile file;
  try {
    loadOptions(tree, "", file);
  } catch (const ConfigurationError& error) {
    throw ConfigurationError(path + ": " + error.what());
  }
  return file.simulation;
}

SimulationOptions noiseFree(SimulationOptions options) {
  options.sensor.noise = false;
  options.imu = noiseFree(options.imu);
  return options;
}

SimulationOptions realTime(SimulationOptions options) {
  options.render.samples = 1;
  options.render.motion_samples = 1;
  return options;
}

Simulation::Simulation(const std::string& scene, const SimulationOptions& options, int seed,
                       Time start, int threads)
    : options_(options),
      seed_(seed),
      start_(start),
      threads_(threads),
      scene_(makeScene(scene, options.scene, streamSeed(seed, kSceneStream))),
      rig_(makeRig(options.rig, streamSeed(seed, kRigStream))),
      motion_(makeMotion(subjectOf(scene_, rig_), options.motion, streamSeed(seed, kMotionStream))),
      samples_(simulateImu(*motion_, options.imu, start, streamSeed(seed, kImuStream))),
      renderer_(std::make_unique<Renderer>(scene_, options.render, threads)),
      exposure_{options.sensor.exposure_s, options.sensor.gain_db} {
  if (!options_.sensor.auto_exposure) return;
  // As on a rig whose exposure is set once, on the first picture, and then kept.
  const Eigen::Isometry3d T_map_camera = motion_->at(viewTime(0)).T_map_base * rig_.T_base_camera;
  exposure_ =
      meter(renderer_->radiance(rig_.calibration.left, {T_map_camera}, seed_), options_.sensor);
}

double Simulation::viewTime(int view) const {
  return firstViewTime(options_.motion) + view / options_.motion.view_rate_hz;
}

Time Simulation::viewStamp(int view) const { return stampAt(viewTime(view)); }

StereoRadiance Simulation::radiance(int view) const {
  const int poses = options_.render.motion_samples;
  std::vector<Eigen::Isometry3d> left, right;
  for (int i = 0; i < poses; ++i) {
    const double phase = (i + 0.5) / poses - 0.5;
    const double time = viewTime(view) + phase * exposure_.exposure_s;
    left.push_back(motion_->at(time).T_map_base * rig_.T_base_camera);
    right.push_back(left.back() * rig_.T_left_right);
  }
  // The two eyes must not share the places of their samples within a pixel.
  return {renderer_->radiance(rig_.calibration.left, left, 2 * view),
          renderer_->radiance(rig_.calibration.right, right, 2 * view + 1)};
}

StereoFrame Simulation::expose(int view, const StereoRadiance& radiance,
                               const Exposure& exposure) const {
  const auto noiseSeed = [&](int eye) {
    return mixSeed(static_cast<std::uint64_t>(streamSeed(seed_, kNoiseStream)),
                   2U * static_cast<std::uint64_t>(view) + static_cast<std::uint64_t>(eye));
  };
  StereoFrame frame;
  frame.stamp = viewStamp(view);
  frame.left = simulation::expose(radiance.left, options_.sensor, exposure, noiseSeed(0), threads_);
  frame.right =
      simulation::expose(radiance.right, options_.sensor, exposure, noiseSeed(1), threads_);
  return frame;
}

StereoFrame Simulation::frame(int view) const { return expose(view, radiance(view), exposure_); }

Trajectory Simulation::truth() const {
  std::vector<Time> stamps;
  const int count = static_cast<int>(motion_->duration() * options_.truth_rate_hz) + 1;
  stamps.reserve(static_cast<std::size_t>(count) + static_cast<std::size_t>(views()));
  for (int i = 0; i < count; ++i) stamps.push_back(stampAt(i / options_.truth_rate_hz));
  for (int view = 0; view < views(); ++view) stamps.push_back(viewStamp(view));
  std::sort(stamps.begin(), stamps.end());
  stamps.erase(std::unique(stamps.begin(), stamps.end()), stamps.end());
  Trajectory truth;
  truth.reserve(stamps.size());
  for (const Time stamp : stamps) {
    truth.push_back({stamp, motion_->at(toSeconds(stamp - start_)).T_map_base});
  }
  return truth;
}

}  // namespace scanner::simulation
