#include "ros/registration_session.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "scanner/evaluation/html_report.h"
#include "scanner/ros/conversions.h"
#include "scanner/stereo/stereo_processor.h"

namespace scanner::bridge {
namespace {

double sigmaOf(const Eigen::Matrix3d& covariance) {
  const double variance = covariance.trace() / 3.0;
  return std::isfinite(variance) && variance > 0.0 ? std::sqrt(variance) : 0.0;
}

/// Neighbouring groups get colours far apart: steps of the golden ratio round the hues.
std_msgs::ColorRGBA groupColor(int id) {
  constexpr double kGolden = 0.618033988749895;
  const double hue = std::fmod(id * kGolden, 1.0) * 6.0;
  const auto channel = [hue](double shift) {
    const double h = std::fmod(hue + shift, 6.0);
    return static_cast<float>(std::min(1.0, std::max(0.0, std::abs(h - 3.0) - 1.0)));
  };
  std_msgs::ColorRGBA color;
  color.r = channel(0.0);
  color.g = channel(4.0);
  color.b = channel(2.0);
  color.a = 1.0F;
  return color;
}

}  // namespace

PointCloud thinnedByVoxel(const PointCloud& cloud, double voxel_m) {
  std::set<std::array<std::int64_t, 3>> taken;
  PointCloud out;
  const double scale = 1.0 / voxel_m;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Eigen::Vector3d p = cloud.points[i].cast<double>() * scale;
    if (!p.allFinite()) continue;
    const std::array<std::int64_t, 3> key = {static_cast<std::int64_t>(std::floor(p.x())),
                                             static_cast<std::int64_t>(std::floor(p.y())),
                                             static_cast<std::int64_t>(std::floor(p.z()))};
    if (taken.insert(key).second) out.appendFrom(cloud, i);
  }
  return out;
}

RegistrationSession::RegistrationSession(const pipeline::ScannerConfig& config, int threads,
                                         double preview_voxel_m)
    : config_(config),
      threads_(threads),
      preview_voxel_m_(preview_voxel_m),
      registrar_(config.registration, threads, static_cast<std::uint64_t>(config.scan.seed)),
      inertial_(config.inertial) {
  // Other nodes do these and do not tell how long they took.
  times_.stereo = times_.surface = evaluation::kUnknown;
}

void RegistrationSession::addImu(const ImuSample& sample) {
  const pipeline::StageTimer timer(times_.inertial);
  inertial_.add(sample);  // what it skips is in its statistics, and in /odometry's diagnostics
}

RegistrationSession::Outcome RegistrationSession::discard(Time stamp, const std::string& reason) {
  Outcome outcome;
  outcome.index = static_cast<int>(frames_.size());
  outcome.stamp = stamp;
  outcome.reason = reason;
  frames_.push_back({outcome.index, stamp, false, reason, 0, 0, 0});
  outcome.mean_distance_m = std::numeric_limits<double>::quiet_NaN();
  newest_ = stamp;
  return outcome;
}

RegistrationSession::Outcome RegistrationSession::add(const OrganizedCloud& cloud,
                                                      const inertial::OdometryState& state,
                                                      const Eigen::Isometry3d& T_base_optical) {
  if (cloud.cloud.empty()) return discard(cloud.stamp, "the pair gave no depth");
  const auto index = static_cast<int>(frames_.size());
  Result<View> view = stereo::makeView(index, cloud, T_base_optical, state.T_odom_base,
                                       config_.stereo.conditioning, nullptr);
  if (!view) return discard(cloud.stamp, view.status().message());
  frames_.push_back({index, cloud.stamp, false, "", 0, view->cloud.size(), 0});
  newest_ = cloud.stamp;
  return place(std::make_shared<const View>(std::move(*view)), state);
}

RegistrationSession::Outcome RegistrationSession::place(std::shared_ptr<const View> view,
                                                        const inertial::OdometryState& state) {
  const Eigen::Isometry3d T_previous_current = motionSincePreviousView(state);
  registration::ViewOutcome result;
  {
    const pipeline::StageTimer timer(times_.registration);
    result = registrar_.add(view, T_previous_current);
  }
  previous_ = state;
  thinned_.push_back(thinnedByVoxel(view->cloud, preview_voxel_m_));
  Outcome outcome;
  outcome.index = view->index;
  outcome.stamp = view->stamp;
  outcome.view = std::move(view);
  outcome.registered = result.registered;
  outcome.trial = result.trial;
  outcome.resampled = result.resampled;
  outcome.mean_distance_m = result.mean_distance_m;
  if (result.registered) {
    outcome.T_map_base = result.T_map_base;
    const pipeline::StageTimer timer(times_.inertial);
    inertial_.correct(outcome.stamp, result.T_map_base);
    T_map_state_ = result.T_map_base * state.T_odom_base.inverse();
    if (result.trial > 0) {
      const Eigen::Matrix<double, 6, 6> covariance = result.information.inverse();
      outcome.position_sigma_m = sigmaOf(covariance.topLeftCorner<3, 3>());
      outcome.rotation_sigma_rad = sigmaOf(covariance.bottomRightCorner<3, 3>());
    }
  } else {
    outcome.T_map_base = T_map_state_ * state.T_odom_base;
    outcome.reason = result.status.message();
  }
  return outcome;
}

Eigen::Isometry3d RegistrationSession::motionSincePreviousView(
    const inertial::OdometryState& state) {
  if (!previous_) {
    registrar_.setFirstPose(state.T_odom_base);
    return Eigen::Isometry3d::Identity();
  }
  const pipeline::StageTimer timer(times_.inertial);
  const Result<Eigen::Isometry3d> prior = inertial_.prior(previous_->stamp, state.stamp);
  if (prior) return *prior;
  // Samples are missing in between: the orientations still tell the rotation.
  warn("frame " + std::to_string(frames_.back().index) +
       ": the prior is a rotation only: " + prior.status().message());
  Eigen::Isometry3d rotation = Eigen::Isometry3d::Identity();
  rotation.linear() = previous_->T_odom_base.linear().transpose() * state.T_odom_base.linear();
  return rotation;
}

registration::GlobalOutcome RegistrationSession::finish() {
  const pipeline::StageTimer timer(times_.global);
  const registration::GlobalOutcome outcome = registrar_.finish();
  loop_ = outcome.loop;
  return outcome;
}

bool RegistrationSession::discardLast() { return registrar_.discardLast(); }

void RegistrationSession::warn(const std::string& line) { warnings_.push_back(line); }

std::size_t RegistrationSession::registered() const {
  std::size_t n = 0;
  for (const registration::RegisteredView& view : registrar_.views()) n += view.registered;
  return n;
}

Trajectory RegistrationSession::trajectory() const {
  Trajectory trajectory;
  for (const registration::RegisteredView& view : registrar_.views()) {
    if (view.registered) trajectory.push_back({view.view->stamp, view.T_map_base});
  }
  return trajectory;
}

GroupArray RegistrationSession::groups(const std::string& frame) const {
  GroupArray message;
  message.header = makeHeader(newest_, frame);
  for (const registration::Group& group : registrar_.groups()) {
    Group out;
    out.index = static_cast<std::uint32_t>(group.id);
    for (const registration::GroupMember& member : group.members) {
      const auto& view = registrar_.views()[static_cast<std::size_t>(member.view)];
      if (member.view == group.first_view) {
        out.first_view = static_cast<std::uint32_t>(view.view->index);
        out.pose = toRos(view.registered ? view.T_map_base : group.T_map_group);
      }
      if (!member.registered || !view.registered) continue;
      out.views.push_back(static_cast<std::uint32_t>(view.view->index));
      out.points += static_cast<std::uint32_t>(view.view->cloud.size());
    }
    message.groups.push_back(out);
  }
  return message;
}

visualization_msgs::Marker RegistrationSession::groupMarker(const std::string& frame) const {
  visualization_msgs::Marker marker;
  marker.header = makeHeader(Time(), frame);
  marker.ns = "groups";
  marker.type = visualization_msgs::Marker::LINE_LIST;
  marker.pose.orientation.w = 1.0;
  constexpr double kLineWidth_m = 0.004;
  marker.scale.x = kLineWidth_m;
  const auto at = [this](int view) -> const registration::RegisteredView& {
    return registrar_.views()[static_cast<std::size_t>(view)];
  };
  for (const registration::Group& group : registrar_.groups()) {
    if (group.first_view < 0 || !at(group.first_view).registered) continue;
    const std_msgs::ColorRGBA color = groupColor(group.id);
    for (const registration::GroupMember& member : group.members) {
      if (member.view == group.first_view || !at(member.view).registered) continue;
      marker.points.push_back(toRos(at(group.first_view).T_map_base).position);
      marker.points.push_back(toRos(at(member.view).T_map_base).position);
      marker.colors.insert(marker.colors.end(), 2, color);
    }
  }
  if (marker.points.empty()) marker.action = visualization_msgs::Marker::DELETE;
  return marker;
}

PointCloud RegistrationSession::preview() const {
  PointCloud cloud;
  for (std::size_t i = 0; i < thinned_.size(); ++i) {
    const registration::RegisteredView& view = registrar_.views()[i];
    if (view.registered) cloud.append(transformed(thinned_[i], view.T_map_base));
  }
  return cloud;
}

Status RegistrationSession::writeTrajectory(pipeline::ScanFolder& folder) const {
  return folder.writeTrajectory(trajectory());
}

PointCloud RegistrationSession::merged(const registration::Group& group) const {
  PointCloud cloud;
  for (const registration::GroupMember& member : group.members) {
    const auto& view = registrar_.views()[static_cast<std::size_t>(member.view)];
    if (member.registered && view.registered) {
      cloud.append(transformed(view.view->cloud, view.T_map_base));
    }
  }
  return cloud;
}

evaluation::ScanReport RegistrationSession::report(const Trajectory& truth) const {
  pipeline::ReportInput input{
      registrar_, config_.registration, inertial_.statistics(), frames_,  times_,
      loop_,      std::nullopt,         std::nullopt,           warnings_};
  if (!truth.empty()) input.truth = truth;
  return pipeline::buildReport(input, threads_);
}

Status RegistrationSession::save(pipeline::ScanFolder& folder, const Trajectory& truth) const {
  for (const registration::RegisteredView& view : registrar_.views()) {
    if (Status status = folder.writeView(*view.view); !status) return status;
  }
  for (const registration::Group& group : registrar_.groups()) {
    const PointCloud cloud = merged(group);
    if (cloud.empty()) continue;
    if (Status status = folder.writeGroup(group.id, cloud); !status) return status;
  }
  if (Status status = folder.writeText("config.yaml", toYaml(dumpOptions(config_))); !status) {
    return status;
  }
  if (Status status = writeTrajectory(folder); !status) return status;
  if (Status status = folder.writeText("report.json", evaluation::toJson(report(truth))); !status) {
    return status;
  }
  return evaluation::writeHtmlReport(folder.path());
}

RegisteredView toRos(const RegistrationSession::Outcome& outcome, const std::string& map_frame,
                     const std::string& base_frame) {
  RegisteredView message;
  message.header = makeHeader(outcome.stamp, map_frame);
  message.index = static_cast<std::uint32_t>(outcome.index);
  message.registered = outcome.registered;
  message.reason = outcome.reason;
  message.trial = static_cast<std::uint8_t>(outcome.trial);
  message.resampled = outcome.resampled;
  message.mean_distance = outcome.mean_distance_m;
  message.pose =
      withCovariance(outcome.T_map_base, outcome.position_sigma_m, outcome.rotation_sigma_rad);
  message.cloud = toRos(outcome.view ? outcome.view->cloud : PointCloud(),
                        makeHeader(outcome.stamp, base_frame));
  return message;
}

}  // namespace scanner::bridge
