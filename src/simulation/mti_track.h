#pragma once

#include <vector>

#include "scanner/simulation/imu_model.h"

namespace scanner::simulation {

/// What the sensors of the device feel at one moment.
struct MtiReading {
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();       ///< rad/s, sensor frame
  Eigen::Vector3d linear_acceleration = Eigen::Vector3d::Zero();    ///< m/s^2, gravity included
  Eigen::Vector3d magnetic_field = Eigen::Vector3d::Zero();         ///< 1 = the earth's field
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< sensor to ENU
  double temperature_c = 0.0;
};

/// Samples of a simulated MTi, readable at any time: the device samples when its own clock says so,
/// which is never exactly when the simulation did. Motion is interpolated from the truth (cubic;
/// slerp for the orientation) and the errors are those of the nearest sample, not interpolated:
/// blending neighbours would make the noise smaller than it was specified. Samples without truth
/// are interpolated as they are. Before the first and after the last sample the device stands
/// still. Samples before time 0 say what standing still looks like, noise and all: they are gone
/// through to and fro for as long as the device waits for time 0; so are the last `still_end_s`
/// after the end.
class MtiTrack {
 public:
  /// Throws ConfigurationError when there is no sample, times do not increase or an orientation is
  /// missing.
  explicit MtiTrack(std::vector<MtiSample> samples, double still_end_s = 0.0);
  MtiReading at(double unfolded_s) const;
  /// While nobody knows when time 0 will be, `waited_s` after power-on.
  MtiReading waiting(double waited_s) const { return at(-waited_s); }

 private:
  double folded(double time_s) const;

  std::vector<MtiSample> samples_;
  double still_end_s_;
};

}  // namespace scanner::simulation
