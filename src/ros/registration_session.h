#pragma once

#include <visualization_msgs/Marker.h>

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "scanner/GroupArray.h"
#include "scanner/RegisteredView.h"
#include "scanner/evaluation/report.h"
#include "scanner/inertial/odometry.h"
#include "scanner/pipeline/config.h"
#include "scanner/pipeline/report_builder.h"
#include "scanner/pipeline/scan_folder.h"
#include "scanner/registration/registrar.h"

namespace scanner::bridge {

/// What the registration node does with samples and clouds, without topics and threads: the same
/// steps in the same order as pipeline::Scanner, so that a replay gives what scan_bag gives. The
/// prior of a view needs the pose of the view before as a correction, so the samples are integrated
/// here, in step with the clouds, and not taken from /odometry, which would depend on who is
/// faster. Not thread-safe.
class RegistrationSession {
 public:
  struct Outcome {
    int index = 0;
    Time stamp;
    std::shared_ptr<const View> view;  ///< null when the cloud gave no view
    bool registered = false;
    std::string reason;  ///< empty when registered
    int trial = 8;
    bool resampled = false;
    double mean_distance_m = 0.0;
    Eigen::Isometry3d T_map_base = Eigen::Isometry3d::Identity();  ///< the prior's when discarded
    double position_sigma_m = 0.0;  ///< of the motion since the view before
    double rotation_sigma_rad = 0.0;
  };

  /// `config` without its surface block. Throws ConfigurationError for options out of bounds.
  RegistrationSession(const pipeline::ScannerConfig& config, int threads, double preview_voxel_m);

  /// Samples in base_link, in order of time; those that cannot be used are skipped and counted.
  void addImu(const ImuSample& sample);
  /// The state that a cloud of this stamp needs. kNotEnoughData: with more samples it will be
  /// known.
  Result<inertial::OdometryState> predict(Time stamp) const { return inertial_.predict(stamp); }
  /// One stereo cloud with the state at its stamp; `T_base_optical` is the pose of the cloud's
  /// frame.
  Outcome add(const OrganizedCloud& cloud, const inertial::OdometryState& state,
              const Eigen::Isometry3d& T_base_optical);
  /// A cloud that cannot be used; counted as a view that was discarded.
  Outcome discard(Time stamp, const std::string& reason);
  registration::GlobalOutcome finish();
  bool discardLast();
  /// A line for the report.
  void warn(const std::string& line);

  std::size_t total() const { return frames_.size(); }
  std::size_t registered() const;
  const registration::TrialStatistics& trials() const { return registrar_.trials(); }
  Trajectory trajectory() const;
  Time newestStamp() const { return newest_; }

  GroupArray groups(const std::string& frame) const;
  /// The groups for rviz: lines from each group's first view to its members, a colour per group.
  visualization_msgs::Marker groupMarker(const std::string& frame) const;
  /// Everything registered, thinned to about one point per voxel and view, in map.
  PointCloud preview() const;
  Status writeTrajectory(pipeline::ScanFolder& folder) const;
  /// What is known here: no model, no stereo times. `truth` may be empty.
  evaluation::ScanReport report(const Trajectory& truth) const;
  /// Views, groups, trajectory, configuration and reports.
  Status save(pipeline::ScanFolder& folder, const Trajectory& truth) const;

 private:
  PointCloud merged(const registration::Group& group) const;
  Outcome place(std::shared_ptr<const View> view, const inertial::OdometryState& state);
  Eigen::Isometry3d motionSincePreviousView(const inertial::OdometryState& state);

  pipeline::ScannerConfig config_;
  int threads_;
  double preview_voxel_m_;
  registration::Registrar registrar_;
  inertial::InertialOdometry inertial_;
  std::optional<inertial::OdometryState> previous_;  ///< at the view added last
  Eigen::Isometry3d T_map_state_ =
      Eigen::Isometry3d::Identity();  ///< newest pose against inertial_
  std::vector<PointCloud> thinned_;   ///< of each of the registrar's views, in base_link
  std::vector<pipeline::FrameOutcome> frames_;
  std::optional<registration::LoopOutcome> loop_;  ///< once the global stage has run
  pipeline::StageTimes times_;
  std::vector<std::string> warnings_;
  Time newest_;
};

/// First point of every voxel, in the order of the cloud.
PointCloud thinnedByVoxel(const PointCloud& cloud, double voxel_m);

RegisteredView toRos(const RegistrationSession::Outcome& outcome, const std::string& map_frame,
                     const std::string& base_frame);

}  // namespace scanner::bridge
