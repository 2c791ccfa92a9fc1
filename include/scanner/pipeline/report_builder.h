#pragma once

#include <optional>
#include <string>
#include <vector>

#include "scanner/core/se3.h"
#include "scanner/core/time.h"
#include "scanner/evaluation/report.h"
#include "scanner/inertial/odometry.h"
#include "scanner/pipeline/scan_folder.h"
#include "scanner/pipeline/stage_times.h"
#include "scanner/registration/registrar.h"
#include "scanner/surface/statistics.h"

namespace scanner::pipeline {

/// What became of one stereo frame.
struct FrameOutcome {
  int index = -1;  ///< of the stereo frame, from 0; its place in the list
  Time stamp;
  bool registered = false;
  std::string reason;            ///< why it was discarded; empty when registered
  std::size_t depth_pixels = 0;  ///< with a valid disparity
  std::size_t points = 0;        ///< left after conditioning
  int trial = 0;  ///< step of the trial state machine that succeeded, 0 for the first
};

/// What the stages know at the end of a scan, whoever ran them.
struct ReportInput {
  const registration::Registrar& registrar;
  const registration::RegistrationOptions& options;
  const inertial::InertialStatistics& inertial;
  const std::vector<FrameOutcome>& frames;  ///< every view of the registrar has its entry
  StageTimes times;
  std::optional<registration::LoopOutcome> loop;  ///< of the global stage, when it ran
  std::optional<Trajectory> truth;                ///< T_truth_base
  std::optional<surface::MeshStatistics> model;
  std::vector<std::string> warnings;
};

/// The report of a scan. Throws ConfigurationError for threads < 1.
evaluation::ScanReport buildReport(const ReportInput& input, int threads);

/// The statistics of a mesh in the words of the report; absent for one without faces.
std::optional<evaluation::ReportModel> reportModel(const surface::MeshStatistics& model);

/// Adds a model that was made after registration wrote report.json, with the seconds that it took,
/// and makes report.html anew. Nothing happens in a folder without report.json.
Status addModelToReport(ScanFolder& folder, const surface::MeshStatistics& model, double seconds);

/// Tables 4.2 and 4.3 of the thesis for the registered views, in order. Deterministic whatever the
/// number of threads.
std::vector<evaluation::ReportSampling> samplingTable(
    const std::vector<registration::RegisteredView>& views, int threads);
std::vector<evaluation::ReportCompatible> compatibleTable(
    const std::vector<registration::RegisteredView>& views,
    const registration::RegistrationOptions& options, int threads);

}  // namespace scanner::pipeline
