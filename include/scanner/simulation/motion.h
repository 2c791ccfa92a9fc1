#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <string>

#include "scanner/core/options.h"

namespace scanner::simulation {

/// Exact state of base_link at one time.
struct MotionState {
  Eigen::Isometry3d T_map_base = Eigen::Isometry3d::Identity();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();              ///< map, m/s
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();          ///< map, m/s^2, without gravity
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();      ///< base_link, rad/s
  Eigen::Vector3d angular_acceleration = Eigen::Vector3d::Zero();  ///< base_link, rad/s^2
};

/// Block `simulation.motion`.
struct MotionOptions {
  int views = 50;
  double view_rate_hz = 1.82;  ///< rate of the pictures the motion is made for
  double still_s = 3.0;        ///< standing still before the first step, and 1 s at the end
  double tremor_m = 0.0015;    ///< the hand's tremor, RMS of the displacement; a tenth at rest
  double tremor_deg = 0.25;    ///< likewise, of the rotation
  bool pauses = true;          ///< the hand rests and hurries: steps of unequal length
};
void describe(OptionVisitor& v, MotionOptions& o);

/// What the path goes round, from the scene.
struct MotionSubject {
  Eigen::AlignedBox3d bounds;       ///< of the object, map, m
  Eigen::Isometry3d T_base_camera;  ///< raw left optical to base_link
  std::string path = "orbit";  ///< orbit: closed loop round the object (artwork, meshes, target);
                               ///< passes: up, down, up along one side (totem)
};

/// A hand-held motion: twice continuously differentiable, derivatives exact. Times from 0 to
/// duration(), seconds. Immutable and thread-safe.
class Motion {
 public:
  virtual ~Motion() = default;
  virtual MotionState at(double time_s) const = 0;
  virtual double duration() const = 0;
};

/// The motion of a scan. `firstViewTime` is when the first picture is taken, the last moment of
/// standing still; picture i follows at i / view_rate. The orbit goes round once, or a little
/// further, in 50 pictures; fewer show part of it, more go on. Its steps match thesis table 5.2 if
/// the object is about as large as the published one. Same seed, same bytes. Throws
/// ConfigurationError for an empty subject or an unknown path.
std::shared_ptr<const Motion> makeMotion(const MotionSubject& subject, const MotionOptions& options,
                                         int seed);
double firstViewTime(const MotionOptions& options);

}  // namespace scanner::simulation
