#pragma once

#include <string>

#include "scanner/bumblebee/driver.h"
#include "scanner/core/options.h"
#include "scanner/inertial/options.h"
#include "scanner/mti/driver.h"
#include "scanner/registration/options.h"
#include "scanner/stereo/options.h"
#include "scanner/surface/options.h"

namespace scanner::pipeline {

/// Block `scan`: what the pipeline itself decides.
struct ScanOptions {
  int model_factor = 1;      ///< every n-th point of a view goes into the model
  int seed = 1;              ///< of every random choice
  bool write_views = true;   ///< views/view_NNN.ply as the scan goes
  bool write_groups = true;  ///< groups/group_NNN.ply at the end
};
void describe(OptionVisitor& v, ScanOptions& o);

/// Everything that can be configured: one block per stage.
struct ScannerConfig {
  ScanOptions scan;
  mti::DriverOptions mti;              ///< the driver's; a recording has it behind it
  bumblebee::DriverOptions bumblebee;  ///< likewise
  stereo::StereoOptions stereo;
  inertial::InertialOptions inertial;
  registration::RegistrationOptions registration;
  surface::SurfaceOptions surface;
};
void describe(OptionVisitor& v, ScannerConfig& o);

/// Reads a configuration file; options that it does not name keep their defaults. Throws
/// ConfigurationError naming file, key, value and bound.
ScannerConfig loadConfig(const std::string& path);

/// docs/configuration.md: every option of every block, from the same descriptions.
std::string documentConfiguration();

}  // namespace scanner::pipeline
