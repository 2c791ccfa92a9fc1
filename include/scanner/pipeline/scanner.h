#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "scanner/core/camera.h"
#include "scanner/core/image.h"
#include "scanner/core/imu.h"
#include "scanner/core/mesh.h"
#include "scanner/core/se3.h"
#include "scanner/evaluation/report.h"
#include "scanner/inertial/odometry.h"
#include "scanner/pipeline/config.h"
#include "scanner/pipeline/report_builder.h"
#include "scanner/pipeline/sample_pictures.h"
#include "scanner/pipeline/scan_folder.h"
#include "scanner/registration/registrar.h"
#include "scanner/stereo/stereo_processor.h"
#include "scanner/surface/surface.h"

namespace scanner::pipeline {

/// The whole pipeline on a stream of frames and inertial samples, without ROS
/// (docs/architecture.md, "the frame's way"). Feed everything in the order of its stamps: inertial
/// samples may run ahead of the frames, and a frame waits until the samples have passed its stamp.
/// Same input, same result, for every thread count. Not thread-safe.
class Scanner {
 public:
  /// `folder` may be null: nothing is written. Throws ConfigurationError for a calibration or
  /// configuration that cannot be scanned with.
  Scanner(const ScannerConfig& config, const Rig& rig, const StereoCalibration& calibration,
          int threads, ScanFolder* folder);

  /// The status tells why a sample was skipped; it is counted too.
  Status addImu(const ImuSample& sample);
  /// kIoError when the scan folder cannot be written any more; trouble with the frame itself is in
  /// frames() and does not stop the scan.
  Status addFrame(const StereoFrame& frame);

  /// Lines for the report: what the source of the data had to skip.
  void addWarnings(const std::vector<std::string>& lines);

  /// Registers what still waits, runs the global stage and builds and writes cloud and mesh. The
  /// report holds the errors against `truth` when there is one. Call once.
  Result<evaluation::ScanReport> finish(const std::optional<Trajectory>& truth);

  /// One entry for every frame that was processed, in order.
  const std::vector<FrameOutcome>& frames() const { return frames_; }
  /// Poses of the registered views as known now.
  Trajectory trajectory() const;
  const std::optional<Mesh>& model() const { return model_; }
  const StageTimes& times() const { return times_; }

 private:
  struct PendingFrame {
    int index;
    StereoFrame frame;
  };

  Status processPending(bool last_call);
  Status processFrame(const PendingFrame& pending, const inertial::OdometryState& state);
  Result<stereo::StereoProcessor::Output> runStereo(const StereoFrame& frame);
  Result<View> makeView(const PendingFrame& pending, const stereo::StereoProcessor::Output& stereo,
                        const inertial::OdometryState& state, FrameOutcome* outcome);
  Eigen::Isometry3d motionSincePreviousView(int index, const inertial::OdometryState& state);
  Status registerView(View view, const inertial::OdometryState& state, FrameOutcome* outcome);
  Status writeResults();
  Status buildModel();
  evaluation::ScanReport makeReport(const std::optional<Trajectory>& truth) const;
  Status writeReport(evaluation::ScanReport& report);

  ScannerConfig config_;
  int threads_;
  ScanFolder* folder_;
  Eigen::Isometry3d T_base_optical_;  ///< rectified left optical frame
  stereo::StereoProcessor stereo_;
  stereo::RangeTracker range_;
  inertial::InertialOdometry inertial_;
  registration::Registrar registrar_;
  std::deque<PendingFrame> pending_;
  int next_index_ = 0;
  std::vector<FrameOutcome> frames_;
  std::optional<inertial::OdometryState> previous_;  ///< at the view added last
  std::optional<registration::GlobalOutcome> global_;
  std::optional<Mesh> model_;
  SamplePictures pictures_;
  surface::SurfaceStatistics surface_statistics_;
  std::vector<std::string> warnings_;
  StageTimes times_;
};

}  // namespace scanner::pipeline
