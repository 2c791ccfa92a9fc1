#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <ros/console.h>

#include "ros/imu_frame.h"
#include "ros/registration_node_impl.h"
#include "scanner/core/camera.h"
#include "scanner/ros/parameters.h"
#include "scanner/ros/static_transforms.h"

namespace scanner::bridge {
namespace {

constexpr const char* kCameraFrame = "bumblebee_left_optical";
constexpr auto kRecheck = std::chrono::milliseconds(100);

}  // namespace

void describe(OptionVisitor& v, RegistrationNodeOptions& o) {
  v.option("threads", o.threads, {0, 256}, "", "threads to use; 0: all processors");
  v.option("autostart", o.autostart, "scan from the start; else wait for ~start");
  v.option("start_delay_s", o.start_delay_s, {0.0, 86400.0}, "s", "start by itself after this");
  v.option("rig", o.rig, "rig file; empty: tf knows where the camera sits");
  v.option("out", o.out, "scan folder written to as views come; empty: none");
  v.option("preview_rate_hz", o.preview_rate_hz, {0.01, 100.0}, "Hz", "of registration/cloud");
  v.option("preview_voxel_m", o.preview_voxel_m, {1e-4, 10.0}, "m", "spacing of the same");
  v.option("finish_timeout_s", o.finish_timeout_s, {0.1, 3600.0}, "s",
           "~finish gives up on clouds or odometry after so long without news");
  v.option("map_frame", o.map_frame, "frame of the map");
  v.option("odom_frame", o.odom_frame, "frame of the odometry");
  v.option("base_frame", o.base_frame, "frame of the inertial sensor");
}

RegistrationNode::Impl::Impl(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : nh_(nh) {
  loadParameters(private_nh);
  session_ = std::make_unique<RegistrationSession>(config_, threads_, options_.preview_voxel_m);
  odometry_ = std::make_unique<OdometryBuffer>(fromSeconds(config_.inertial.max_gap_s));
  if (!options_.out.empty()) folder_ = std::make_unique<pipeline::ScanFolder>(options_.out);
  if (!options_.rig.empty()) {
    T_base_camera_ = loadRig(options_.rig).T_base_camera;
    publishRig(kCameraFrame);
  }
  advertise(private_nh);
  if (options_.autostart && options_.start_delay_s == 0.0) state_ = RegistrationStatus::SCANNING;
  if (options_.start_delay_s > 0.0) {
    start_timer_ = nh_.createTimer(
        ros::Duration(options_.start_delay_s), [this](const ros::TimerEvent&) { start(); }, true);
  }
  worker_ = std::thread([this] { work(); });
  subscribe();
  services_->start();
  publishStatus();
}

RegistrationNode::Impl::~Impl() {
  points_sub_.shutdown();
  imu_sub_.shutdown();
  odometry_sub_.shutdown();
  info_sub_.shutdown();
  truth_sub_.shutdown();
  map_timer_.stop();
  start_timer_.stop();
  diagnostics_.reset();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  services_->stop();
  if (worker_.joinable()) worker_.join();
}

void RegistrationNode::Impl::loadParameters(const ros::NodeHandle& private_nh) {
  loadPrivate(private_nh, {"registration", "inertial", "stereo", "scan"}, options_);
  loadBlock(nh_, private_nh, "registration", config_.registration);
  loadBlock(nh_, private_nh, "inertial", config_.inertial);
  loadBlock(nh_, private_nh, "stereo", config_.stereo);
  loadBlock(nh_, private_nh, "scan", config_.scan);
  threads_ = options_.threads > 0
                 ? options_.threads
                 : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

void RegistrationNode::Impl::advertise(const ros::NodeHandle& private_nh) {
  pose_ = nh_.advertise<geometry_msgs::PoseWithCovarianceStamped>("registration/pose", 100);
  path_ = nh_.advertise<nav_msgs::Path>("registration/path", 10, true);
  views_ = nh_.advertise<RegisteredView>("registration/views", 0);
  groups_ = nh_.advertise<GroupArray>("registration/groups", 10, true);
  group_markers_ =
      nh_.advertise<visualization_msgs::Marker>("registration/group_markers", 10, true);
  cloud_ = nh_.advertise<sensor_msgs::PointCloud2>("registration/cloud", 1, true);
  status_ = nh_.advertise<RegistrationStatus>("registration/status", 100, true);
  services_ = std::make_unique<ServiceThread>(private_nh);
  services_->add("start", [this] { return start(); });
  services_->add("stop", [this] { return stop(); });
  services_->add("finish", [this] { return finish(); });
  services_->add("discard_last", [this] { return discardLast(); });
  services_->addSave("save", [this](const std::string& folder) { return save(folder); });
  diagnostics_ = std::make_unique<Diagnostics>(
      nh_, private_nh, "registration", [this](DiagnosticStatus& status) { report(status); });
  constexpr double kMapPeriod_s = 0.1;
  map_timer_ = nh_.createTimer(ros::Duration(kMapPeriod_s), &Impl::onMapTimer, this);
}

void RegistrationNode::Impl::subscribe() {
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  info_sub_ = nh_.subscribe("bumblebee/left/camera_info", 0, &Impl::onCameraInfo, this, hints);
  imu_sub_ = nh_.subscribe("mti/imu/data", 0, &Impl::onImu, this, hints);
  odometry_sub_ = nh_.subscribe("odometry", 0, &Impl::onOdometry, this, hints);
  points_sub_ = nh_.subscribe("stereo/points", 0, &Impl::onCloud, this, hints);
  truth_sub_ = nh_.subscribe("ground_truth/pose", 0, &Impl::onTruth, this, hints);
}

void RegistrationNode::Impl::onCameraInfo(const sensor_msgs::CameraInfoConstPtr& message) {
  const Time stamp = fromRos(message->header.stamp);
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool wanted = state_ == RegistrationStatus::SCANNING ||
                      (state_ == RegistrationStatus::FINISHING && stamp <= finish_at_);
  if (!wanted) return;
  announced_.insert(stamp);
  news_ = cloud_news_ = SteadyClock::now();
}

void RegistrationNode::Impl::onCloud(const sensor_msgs::PointCloud2ConstPtr& message) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    news_ = cloud_news_ = SteadyClock::now();
    ++clouds_;
    const Time stamp = fromRos(message->header.stamp);
    const bool announced = announced_.count(stamp) > 0;
    // Clouds come in order: what was announced before this one and has not come never will.
    announced_.erase(announced_.begin(), announced_.upper_bound(stamp));
    const bool wanted = state_ == RegistrationStatus::SCANNING || announced;
    if (!wanted) {
      ++ignored_;
      return;
    }
    waiting_.push_back(message);
  }
  wake_.notify_all();
}

void RegistrationNode::Impl::onImu(const sensor_msgs::ImuConstPtr& message) {
  const Result<ImuSample> sample = imuInBase(*message, tf_, options_.base_frame);
  if (!sample) return;  // inertial_odometry_node reports it
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++samples_received_;
    news_ = SteadyClock::now();
    samples_.push_back(*sample);
    newest_sample_ = std::max(newest_sample_.value_or(sample->stamp), sample->stamp);
    // While nothing is scanned only the latest minutes are worth keeping.
    constexpr double kIdleHistory_s = 300.0;
    const Time oldest = *newest_sample_ - fromSeconds(kIdleHistory_s);
    while (toCome() == 0 && !busy_ && samples_.front().stamp < oldest) samples_.pop_front();
  }
  wake_.notify_all();
}

void RegistrationNode::Impl::onOdometry(const nav_msgs::OdometryConstPtr& message) {
  const Result<inertial::OdometryState> state = fromRos(*message);
  if (!state) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  odometry_->add(*state);
  // Nothing older than the first cloud that waits is asked for; stereo lags by less than this.
  constexpr double kHistory_s = 600.0;
  const Time oldest = waiting_.empty() ? state->stamp : fromRos(waiting_.front()->header.stamp);
  odometry_->forgetBefore(std::min(oldest, state->stamp) - fromSeconds(kHistory_s));
}

void RegistrationNode::Impl::onTruth(const geometry_msgs::PoseStampedConstPtr& message) {
  const Result<Eigen::Isometry3d> pose = fromRos(message->pose);
  if (!pose) return;  // no truth at this moment; the report counts the views that lack it
  const Time stamp = fromRos(message->header.stamp);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (truth_.empty() || truth_.back().stamp < stamp) truth_.push_back({stamp, *pose});
}

void RegistrationNode::Impl::onMapTimer(const ros::TimerEvent&) {
  const ros::Time now = ros::Time::now();
  Eigen::Isometry3d T_map_odom;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (now <= broadcast_) return;  // the clock stands still
    broadcast_ = now;
    T_map_odom = T_map_odom_;
  }
  tf_broadcaster_.sendTransform(
      toRos(T_map_odom, fromRos(now), options_.map_frame, options_.odom_frame));
}

void RegistrationNode::Impl::publishRig(const std::string& camera_frame) {
  if (!T_base_camera_ || !rig_frames_.insert(camera_frame).second) return;
  static_tf_->send({toRos(*T_base_camera_, Time(), options_.base_frame, camera_frame)});
}

Result<Eigen::Isometry3d> RegistrationNode::Impl::cloudPose(const std::string& frame) {
  // The rig file holds under whatever name the images give their camera.
  const std::size_t suffix = frame.rfind("_rectified");
  if (suffix != std::string::npos) publishRig(frame.substr(0, suffix));
  if (!tf_.canTransform(options_.base_frame, frame, ros::Time(0))) {
    return Status(StatusCode::kNotEnoughData,
                  "no transform from " + options_.base_frame + " to " + frame);
  }
  return fromRos(tf_.lookupTransform(options_.base_frame, frame, ros::Time(0)).transform);
}

bool RegistrationNode::Impl::ready(Result<Eigen::Isometry3d>& T_base_cloud) {
  const sensor_msgs::PointCloud2& cloud = *waiting_.front();
  T_base_cloud = cloudPose(frameName(cloud.header.frame_id));
  waiting_for_.clear();
  if (!newest_sample_ || *newest_sample_ < fromRos(cloud.header.stamp) ||
      (starved_ && samples_.empty())) {
    waiting_for_ = "the inertial samples have not reached the cloud";
  }
  if (!T_base_cloud) waiting_for_ = T_base_cloud.status().message();
  return waiting_for_.empty() || give_up_;
}

std::vector<ImuSample> RegistrationNode::Impl::takeSamples(Time stamp) {
  // As scan_bag gives them: up to the first one at or after the stamp, and more only when asked
  // for.
  constexpr std::size_t kExtra = 20;
  std::size_t n = 0;
  while (n < samples_.size() && samples_[n].stamp < stamp) ++n;
  n = std::min(samples_.size(), n + (starved_ ? kExtra : 1));
  std::vector<ImuSample> taken(samples_.begin(), samples_.begin() + static_cast<std::ptrdiff_t>(n));
  samples_.erase(samples_.begin(), samples_.begin() + static_cast<std::ptrdiff_t>(n));
  return taken;
}

void RegistrationNode::Impl::work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_) {
    Result<Eigen::Isometry3d> T_base_cloud = Status(StatusCode::kNotEnoughData, "no transform");
    if (waiting_.empty() || !ready(T_base_cloud)) {
      wake_.wait_for(lock, kRecheck);
      continue;
    }
    const sensor_msgs::PointCloud2ConstPtr message = waiting_.front();
    const std::vector<ImuSample> samples = takeSamples(fromRos(message->header.stamp));
    const bool last_call = give_up_ && samples_.empty();
    busy_ = true;
    lock.unlock();
    const bool done = process(*message, samples, T_base_cloud, last_call);
    lock.lock();
    busy_ = false;
    starved_ = !done;
    if (!done) continue;
    waiting_.pop_front();
    news_ = SteadyClock::now();
    lock.unlock();
    publishStatus();
    lock.lock();
    wake_.notify_all();
  }
}

bool RegistrationNode::Impl::process(const sensor_msgs::PointCloud2& message,
                                     const std::vector<ImuSample>& samples,
                                     const Result<Eigen::Isometry3d>& T_base_cloud,
                                     bool last_call) {
  const Time stamp = fromRos(message.header.stamp);
  const std::lock_guard<std::mutex> lock(session_mutex_);
  for (const ImuSample& sample : samples) session_->addImu(sample);
  const Result<inertial::OdometryState> state = session_->predict(stamp);
  if (state.status().code() == StatusCode::kNotEnoughData && !last_call) return false;
  const Result<OrganizedCloud> cloud = fromRos(message);
  RegistrationSession::Outcome outcome;
  if (!state) {
    outcome = session_->discard(stamp, "no inertial prior: " + state.status().message());
  } else if (!T_base_cloud || !cloud) {
    outcome = session_->discard(
        stamp, !cloud ? cloud.status().message() : T_base_cloud.status().message());
  } else {
    outcome = session_->add(*cloud, *state, *T_base_cloud);
  }
  last_trial_ = outcome.trial;
  mean_distance_m_ = outcome.mean_distance_m;
  publish(outcome);
  moveMap(outcome);
  write(outcome);
  publishMap(false);
  return true;
}

void RegistrationNode::Impl::moveMap(const RegistrationSession::Outcome& outcome) {
  if (!outcome.registered) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  const Result<inertial::OdometryState> state = odometry_->at(outcome.stamp);
  if (state) T_map_odom_ = outcome.T_map_base * state->T_odom_base.inverse();
}

void RegistrationNode::Impl::publish(const RegistrationSession::Outcome& outcome) {
  const auto view = boost::make_shared<const RegisteredView>(
      toRos(outcome, options_.map_frame, options_.base_frame));
  views_.publish(view);
  if (!outcome.registered) {
    ROS_WARN_STREAM("registration: view " << outcome.index << " discarded: " << outcome.reason);
    return;
  }
  geometry_msgs::PoseWithCovarianceStamped pose;
  pose.header = view->header;
  pose.pose = view->pose;
  pose_.publish(pose);
}

void RegistrationNode::Impl::write(const RegistrationSession::Outcome& outcome) {
  if (!folder_ || !outcome.view) return;
  Status status = folder_->writeView(*outcome.view);
  if (status) status = session_->writeTrajectory(*folder_);
  const std::lock_guard<std::mutex> lock(mutex_);
  message_ = status ? "" : status.message();
}

void RegistrationNode::Impl::publishMap(bool all) {
  path_.publish(toRos(session_->trajectory(), options_.map_frame));
  groups_.publish(session_->groups(options_.map_frame));
  group_markers_.publish(session_->groupMarker(options_.map_frame));
  const SteadyClock::time_point now = SteadyClock::now();
  const std::chrono::duration<double> since = now - preview_at_;
  if (!all && since.count() < 1.0 / options_.preview_rate_hz) return;
  if (session_->registered() == 0) return;
  preview_at_ = now;
  cloud_.publish(
      toRos(session_->preview(), makeHeader(session_->newestStamp(), options_.map_frame)));
}

void RegistrationNode::Impl::publishStatus() {
  RegistrationStatus status;
  {
    const std::lock_guard<std::mutex> lock(session_mutex_);
    status.header = makeHeader(session_->newestStamp(), options_.map_frame);
    status.views_total = static_cast<std::uint32_t>(session_->total());
    status.views_registered = static_cast<std::uint32_t>(session_->registered());
    status.last_trial = static_cast<std::uint8_t>(last_trial_);
    status.mean_distance = mean_distance_m_;
    const auto total = session_->trials().total();
    for (std::size_t i = 0; i < 8; ++i) {
      status.trials[i] = static_cast<std::uint32_t>(total[i + 1]);
    }
  }
  status.views_discarded = status.views_total - status.views_registered;
  const std::lock_guard<std::mutex> lock(mutex_);
  status.state = state_;
  status.queue_length = static_cast<std::uint32_t>(waiting_.size());
  status.message = message_;
  status_.publish(status);
}

RegistrationNode::RegistrationNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : impl_(std::make_unique<Impl>(nh, private_nh)) {}
RegistrationNode::~RegistrationNode() = default;

}  // namespace scanner::bridge
