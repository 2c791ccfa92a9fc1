#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <ros/node_handle.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "ros/diagnostics.h"
#include "ros/registration_session.h"
#include "ros/static_broadcast.h"
#include "scanner/RegistrationStatus.h"
#include "scanner/ros/conversions.h"
#include "scanner/ros/odometry_buffer.h"
#include "scanner/ros/registration_node.h"
#include "scanner/ros/service_thread.h"

namespace scanner::bridge {

struct RegistrationNodeOptions {
  int threads = 0;
  bool autostart = true;
  double start_delay_s = 0.0;
  std::string rig;
  std::string out;
  double preview_rate_hz = 1.0;
  double preview_voxel_m = 0.01;
  double finish_timeout_s = 15.0;
  std::string map_frame = "map";
  std::string odom_frame = "odom";
  std::string base_frame = "base_link";
};

void describe(OptionVisitor& v, RegistrationNodeOptions& o);

/// Topics in registration_node.cpp, services and diagnostics in registration_services.cpp.
/// Callbacks only queue; one worker thread registers; services have a thread of their own.
class RegistrationNode::Impl {
 public:
  using SteadyClock = std::chrono::steady_clock;

  Impl(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~Impl();

 private:
  void loadParameters(const ros::NodeHandle& private_nh);
  void advertise(const ros::NodeHandle& private_nh);
  void subscribe();

  void onCloud(const sensor_msgs::PointCloud2ConstPtr& message);
  void onImu(const sensor_msgs::ImuConstPtr& message);
  void onOdometry(const nav_msgs::OdometryConstPtr& message);
  void onCameraInfo(const sensor_msgs::CameraInfoConstPtr& message);
  void onTruth(const geometry_msgs::PoseStampedConstPtr& message);
  void onMapTimer(const ros::TimerEvent& event);

  void work();
  bool ready(Result<Eigen::Isometry3d>& T_base_cloud);
  std::vector<ImuSample> takeSamples(Time stamp);
  Result<Eigen::Isometry3d> cloudPose(const std::string& frame);
  void publishRig(const std::string& camera_frame);
  bool process(const sensor_msgs::PointCloud2& message, const std::vector<ImuSample>& samples,
               const Result<Eigen::Isometry3d>& T_base_cloud, bool last_call);
  void moveMap(const RegistrationSession::Outcome& outcome);
  void publish(const RegistrationSession::Outcome& outcome);
  void write(const RegistrationSession::Outcome& outcome);
  void publishMap(bool all);
  void publishStatus();

  std::pair<bool, std::string> start();
  std::pair<bool, std::string> stop();
  std::pair<bool, std::string> finish();
  std::pair<bool, std::string> discardLast();
  std::pair<bool, std::string> save(const std::string& folder);
  std::size_t waitForClouds();
  Trajectory truth() const;
  std::size_t toCome() const;
  void report(DiagnosticStatus& status);

  ros::NodeHandle nh_;
  RegistrationNodeOptions options_;
  pipeline::ScannerConfig config_;
  int threads_ = 1;
  std::unique_ptr<pipeline::ScanFolder> folder_;

  // Guarded by mutex_.
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<sensor_msgs::PointCloud2ConstPtr> waiting_;
  std::deque<ImuSample> samples_;  ///< not given to the session yet
  std::optional<Time> newest_sample_;
  bool busy_ = false, stopping_ = false, give_up_ = false;
  bool starved_ = false;  ///< the session needs more samples for the first cloud that waits
  std::uint8_t state_ = RegistrationStatus::IDLE;
  std::unique_ptr<OdometryBuffer> odometry_;
  Trajectory truth_;          ///< for the report only
  std::set<Time> announced_;  ///< camera_infos whose clouds have not come
  std::size_t clouds_ = 0, ignored_ = 0, samples_received_ = 0;
  SteadyClock::time_point news_ = SteadyClock::now();        ///< of anything
  SteadyClock::time_point cloud_news_ = SteadyClock::now();  ///< of pairs that are wanted
  Time finish_at_;  ///< pairs taken after ~finish was called do not count
  std::string message_, waiting_for_;
  Eigen::Isometry3d T_map_odom_ = Eigen::Isometry3d::Identity();
  ros::Time broadcast_;

  std::optional<Eigen::Isometry3d> T_base_camera_;  ///< of the rig file
  std::set<std::string> rig_frames_;                ///< published with it

  // Guarded by session_mutex_, which is never taken while mutex_ is held.
  std::mutex session_mutex_;
  std::unique_ptr<RegistrationSession> session_;
  int last_trial_ = 0;
  double mean_distance_m_ = 0.0;
  SteadyClock::time_point preview_at_;

  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener tf_listener_{tf_};
  tf2_ros::TransformBroadcaster tf_broadcaster_;
  std::shared_ptr<StaticBroadcast> static_tf_ = StaticBroadcast::shared();
  ros::Publisher pose_, path_, views_, groups_, group_markers_, cloud_, status_;
  ros::Subscriber points_sub_, imu_sub_, odometry_sub_, info_sub_, truth_sub_;
  ros::Timer map_timer_, start_timer_;
  std::unique_ptr<ServiceThread> services_;
  std::unique_ptr<Diagnostics> diagnostics_;
  std::thread worker_;
};

}  // namespace scanner::bridge
