#include "scanner/pipeline/scanner.h"

#include <nlohmann/json.hpp>

#include "scanner/evaluation/html_report.h"

namespace scanner::pipeline {

Scanner::Scanner(const ScannerConfig& config, const Rig& rig, const StereoCalibration& calibration,
                 int threads, ScanFolder* folder)
    : config_(config),
      threads_(threads),
      folder_(folder),
      T_base_optical_(rig.rectifiedCameraPose(calibration)),
      stereo_(calibration, config.stereo, threads),
      range_(stereo_.makeRangeTracker()),
      inertial_(config.inertial),
      registrar_(config.registration, threads, static_cast<std::uint64_t>(config.scan.seed)) {
  if (folder_ == nullptr) return;
  const Status status = folder_->writeText("config.yaml", toYaml(dumpOptions(config_)));
  if (!status) throw ConfigurationError(status.message());
}

void Scanner::addWarnings(const std::vector<std::string>& lines) {
  warnings_.insert(warnings_.end(), lines.begin(), lines.end());
}

Status Scanner::addImu(const ImuSample& sample) {
  const StageTimer timer(times_.inertial);
  return inertial_.add(sample);
}

Status Scanner::addFrame(const StereoFrame& frame) {
  pending_.push_back({next_index_++, frame});
  return processPending(false);
}

Status Scanner::processPending(bool last_call) {
  while (!pending_.empty()) {
    const PendingFrame& next = pending_.front();
    Result<inertial::OdometryState> state = [&] {
      const StageTimer timer(times_.inertial);
      return inertial_.predict(next.frame.stamp);
    }();
    // The odometry is still gathering the samples that it starts from; it will know this time then.
    const bool too_early = !state && state.status().code() == StatusCode::kNotEnoughData;
    if (too_early && !last_call) return Status::ok();
    const PendingFrame frame = next;
    pending_.pop_front();
    if (!state) {
      frames_.push_back({frame.index, frame.frame.stamp, false,
                         "no inertial prior: " + state.status().message(), 0, 0, 0});
      continue;
    }
    if (const Status status = processFrame(frame, *state); !status) return status;
  }
  return Status::ok();
}

Status Scanner::processFrame(const PendingFrame& pending, const inertial::OdometryState& state) {
  FrameOutcome outcome;
  outcome.index = pending.index;
  outcome.stamp = pending.frame.stamp;
  Result<stereo::StereoProcessor::Output> stereo = runStereo(pending.frame);
  Result<View> view = stereo ? makeView(pending, *stereo, state, &outcome) : stereo.status();
  Status status;
  if (view) {
    status = registerView(*std::move(view), state, &outcome);
  } else {
    outcome.reason = view.status().message();
  }
  if (outcome.registered && folder_ != nullptr) {
    pictures_.add(outcome.index, stereo->rectified.left_color, stereo->disparity);
  }
  frames_.push_back(outcome);
  return status;
}

Result<stereo::StereoProcessor::Output> Scanner::runStereo(const StereoFrame& frame) {
  const StageTimer timer(times_.stereo);
  return stereo_.process(frame, &range_);
}

Result<View> Scanner::makeView(const PendingFrame& pending,
                               const stereo::StereoProcessor::Output& stereo,
                               const inertial::OdometryState& state, FrameOutcome* outcome) {
  const StageTimer timer(times_.stereo);
  outcome->depth_pixels = stereo.statistics.points;
  Result<View> view = stereo::makeView(pending.index, stereo.cloud, T_base_optical_,
                                       state.T_odom_base, config_.stereo.conditioning, nullptr);
  if (view) outcome->points = view->cloud.size();
  if (!view && stereo.trouble) {
    return Status(view.status().code(), view.status().message() + "; " + stereo.trouble.line);
  }
  return view;
}

Status Scanner::registerView(View view, const inertial::OdometryState& state,
                             FrameOutcome* outcome) {
  Status written;
  if (folder_ != nullptr && config_.scan.write_views) {
    written = folder_->writeView(view);
    if (!written) return written;
  }
  const Time stamp = view.stamp;
  const Eigen::Isometry3d T_previous_current = motionSincePreviousView(view.index, state);
  registration::ViewOutcome result;
  {
    const StageTimer timer(times_.registration);
    result = registrar_.add(std::make_shared<const View>(std::move(view)), T_previous_current);
  }
  previous_ = state;
  outcome->registered = result.registered;
  outcome->trial = result.trial;
  if (!result.registered) outcome->reason = result.status.message();
  if (result.registered) {
    const StageTimer timer(times_.inertial);
    inertial_.correct(stamp, result.T_map_base);
  }
  return folder_ != nullptr ? folder_->writeTrajectory(trajectory()) : Status::ok();
}

Eigen::Isometry3d Scanner::motionSincePreviousView(int index,
                                                   const inertial::OdometryState& state) {
  if (!previous_) {
    registrar_.setFirstPose(state.T_odom_base);
    return Eigen::Isometry3d::Identity();
  }
  const StageTimer timer(times_.inertial);
  const Result<Eigen::Isometry3d> prior = inertial_.prior(previous_->stamp, state.stamp);
  if (prior) return *prior;
  // Samples are missing in between: the orientations still tell the rotation.
  warnings_.push_back("frame " + std::to_string(index) +
                      ": the prior is a rotation only: " + prior.status().message());
  Eigen::Isometry3d rotation = Eigen::Isometry3d::Identity();
  rotation.linear() = previous_->T_odom_base.linear().transpose() * state.T_odom_base.linear();
  return rotation;
}

Trajectory Scanner::trajectory() const {
  Trajectory trajectory;
  for (const registration::RegisteredView& view : registrar_.views()) {
    if (view.registered) trajectory.push_back({view.view->stamp, view.T_map_base});
  }
  return trajectory;
}

Result<evaluation::ScanReport> Scanner::finish(const std::optional<Trajectory>& truth) {
  if (const Status status = processPending(true); !status) return status;
  {
    const StageTimer timer(times_.global);
    global_ = registrar_.finish();
  }
  if (const Status status = buildModel(); !status) {
    // Poses and views are worth keeping when there is no mesh; a full disk is not to be hidden.
    if (status.code() == StatusCode::kIoError) return status;
    warnings_.push_back("no model: " + status.message());
  }
  if (const Status status = writeResults(); !status) return status;
  evaluation::ScanReport report = makeReport(truth);
  if (folder_ != nullptr) {
    if (const Status status = writeReport(report); !status) return status;
  }
  return report;
}

evaluation::ScanReport Scanner::makeReport(const std::optional<Trajectory>& truth) const {
  ReportInput input{registrar_,
                    config_.registration,
                    inertial_.statistics(),
                    frames_,
                    times_,
                    global_->loop,
                    truth,
                    std::nullopt,
                    warnings_};
  if (model_) input.model = surface_statistics_.model;
  return buildReport(input, threads_);
}

Status Scanner::writeReport(evaluation::ScanReport& report) {
  const auto json = [&] { return folder_->writeText("report.json", evaluation::toJson(report)); };
  // Nobody's scan is lost because its pictures could not be shown.
  if (const Status drawn = pictures_.write(*folder_); !drawn) {
    report.warnings.push_back("no sample pictures: " + drawn.message());
  }
  folder_->removeLeftovers();
  if (const Status status = json(); !status) return status;
  const Status page = evaluation::writeHtmlReport(folder_->path());
  if (page) return page;
  report.warnings.push_back("no report.html: " + page.message());
  return json();
}

Status Scanner::buildModel() {
  const StageTimer timer(times_.surface);
  std::vector<PointCloud> thinned;
  std::vector<surface::PosedCloud> posed;
  thinned.reserve(registrar_.views().size());
  for (const registration::RegisteredView& view : registrar_.views()) {
    if (!view.registered) continue;
    const PointCloud* cloud = &view.view->cloud;
    if (config_.scan.model_factor > 1) {
      thinned.push_back(decimated(*cloud, config_.scan.model_factor));
      cloud = &thinned.back();
    }
    posed.push_back({cloud, view.T_map_base});
  }
  PointCloud fused;
  Result<Mesh> mesh =
      surface::buildSurface(posed, config_.surface, threads_, &surface_statistics_, &fused);
  if (folder_ != nullptr && !fused.empty()) {
    if (const Status status = folder_->writeCloud(fused); !status) return status;
  }
  if (!mesh) return mesh.status();
  model_ = *std::move(mesh);
  return folder_ != nullptr ? folder_->writeModel(*model_) : Status::ok();
}

Status Scanner::writeResults() {
  if (folder_ == nullptr) return Status::ok();
  if (const Status status = folder_->writeTrajectory(trajectory()); !status) return status;
  if (!config_.scan.write_groups) return Status::ok();
  for (const registration::Group& group : registrar_.groups()) {
    PointCloud merged;
    for (const registration::GroupMember& member : group.members) {
      const registration::RegisteredView& view =
          registrar_.views()[static_cast<std::size_t>(member.view)];
      if (member.registered && view.registered) {
        merged.append(transformed(view.view->cloud, view.T_map_base));
      }
    }
    if (merged.empty()) continue;
    if (const Status status = folder_->writeGroup(group.id, merged); !status) return status;
  }
  return Status::ok();
}

}  // namespace scanner::pipeline
