#pragma once

#include <optional>
#include <string>
#include <vector>

#include "scanner/core/se3.h"
#include "scanner/evaluation/report.h"
#include "scanner/inertial/odometry.h"
#include "scanner/pipeline/scanner.h"
#include "scanner/registration/registrar.h"
#include "scanner/surface/surface.h"

namespace scanner::pipeline {

/// What the stages know at the end of a scan.
struct ReportInput {
  const registration::Registrar& registrar;
  const inertial::InertialOdometry& inertial;
  const registration::GlobalOutcome& global;
  const std::vector<FrameOutcome>& frames;
  const StageTimes& times;
  const std::optional<Trajectory>& truth;
  const surface::SurfaceStatistics& surface;
  const std::vector<std::string>& warnings;
};

evaluation::ScanReport buildReport(const ReportInput& input);

}  // namespace scanner::pipeline
