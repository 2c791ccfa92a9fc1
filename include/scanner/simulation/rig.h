#pragma once

#include <Eigen/Geometry>

#include "scanner/core/camera.h"
#include "scanner/core/options.h"

namespace scanner::simulation {

/// Block `simulation.rig`. The defaults are the published rig (thesis 3.1): 6 mm lens.
struct RigOptions {
  int width_px = 1024;
  int height_px = 768;
  double focal_px =
      1098.0;  ///< after rectification, at 1024 pixels of width; scales with the width
  double baseline_m = 0.12;
  bool distortion = true;    ///< radial and tangential distortion of both lenses, unequal
  bool misalignment = true;  ///< the eyes are turned by some 0.1 deg against each other
};
void describe(OptionVisitor& v, RigOptions& o);

/// The true cameras and the calibration that matches them exactly.
struct SimulatedRig {
  StereoCalibration calibration;  ///< K and D are the truth; R and P rectify; left R is identity
  Eigen::Isometry3d T_left_right =
      Eigen::Isometry3d::Identity();  ///< raw right to raw left optical
  Eigen::Isometry3d T_base_camera =
      Eigen::Isometry3d::Identity();  ///< raw left optical to base_link

  Rig rig() const;
};
SimulatedRig makeRig(const RigOptions& options, int seed);

}  // namespace scanner::simulation
