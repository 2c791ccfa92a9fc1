#pragma once

#include <memory>
#include <string>
#include <vector>

#include "scanner/core/image.h"
#include "scanner/core/options.h"
#include "scanner/core/se3.h"
#include "scanner/simulation/imu_model.h"
#include "scanner/simulation/motion.h"
#include "scanner/simulation/renderer.h"
#include "scanner/simulation/rig.h"
#include "scanner/simulation/scene.h"
#include "scanner/simulation/sensor.h"

namespace scanner::simulation {

/// Block `simulation`.
struct SimulationOptions {
  SceneOptions scene;
  RigOptions rig;
  RenderOptions render;
  SensorOptions sensor;
  MotionOptions motion;
  ImuOptions imu;
  double truth_rate_hz = 100.0;  ///< poses per second of the ground truth
};
void describe(OptionVisitor& v, SimulationOptions& o);

/// The block `simulation` of a YAML file; what it does not name keeps its default. Throws
/// ConfigurationError naming file, key, value and bound.
SimulationOptions loadSimulation(const std::string& path);

/// Neither camera nor inertial sensor add noise; the optics stay as they are.
SimulationOptions noiseFree(SimulationOptions options);
/// What a rig in real time can afford: a sample per pixel but for edges, no motion blur.
SimulationOptions realTime(SimulationOptions options);

/// Linear radiance of both eyes (Renderer::radiance).
struct StereoRadiance {
  cv::Mat left;
  cv::Mat right;
};

/// A scan that never took place: the scene, the rig carried past it, and what its sensors give.
/// Time 0 of the motion is `start`. Immutable after construction and thread-safe; same arguments,
/// same bytes, for every thread count.
class Simulation {
 public:
  /// `scene`: artwork, totem, target or the path of a mesh. Throws ConfigurationError.
  Simulation(const std::string& scene, const SimulationOptions& options, int seed, Time start,
             int threads);

  const SimulationOptions& options() const { return options_; }
  const Scene& scene() const { return scene_; }
  const SimulatedRig& rig() const { return rig_; }
  const Motion& motion() const { return *motion_; }
  const std::vector<MtiSample>& samples() const { return samples_; }

  int views() const { return options_.motion.views; }
  double viewTime(int view) const;  ///< seconds on the motion's clock, mid-exposure
  Time viewStamp(int view) const;
  Time stampAt(double time_s) const { return start_ + fromSeconds(time_s); }

  /// The exposure that was metered on the first view, or the configured one.
  const Exposure& exposure() const { return exposure_; }
  StereoRadiance radiance(int view) const;
  /// Both pictures of one view, as the sensor gives them.
  StereoFrame frame(int view) const;
  StereoFrame expose(int view, const StereoRadiance& radiance, const Exposure& exposure) const;

  /// base_link in map at truth_rate_hz over the whole motion, and at every view.
  Trajectory truth() const;

 private:
  SimulationOptions options_;
  int seed_;
  Time start_;
  int threads_;
  Scene scene_;
  SimulatedRig rig_;
  std::shared_ptr<const Motion> motion_;
  std::vector<MtiSample> samples_;
  std::unique_ptr<Renderer> renderer_;
  Exposure exposure_;
};

}  // namespace scanner::simulation
