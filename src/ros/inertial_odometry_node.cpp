#include "scanner/ros/inertial_odometry_node.h"

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <ros/console.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <deque>

#include "ros/diagnostics.h"
#include "ros/imu_frame.h"
#include "scanner/ros/conversions.h"
#include "scanner/ros/odometry_buffer.h"
#include "scanner/ros/parameters.h"

namespace scanner::bridge {
namespace {

constexpr int kImuQueue = 5000;
constexpr double kLogPeriod_s = 5.0;

struct InertialNodeOptions {
  std::string odom_frame = "odom";
  std::string base_frame = "base_link";
};

void describe(OptionVisitor& v, InertialNodeOptions& o) {
  v.option("odom_frame", o.odom_frame, "frame of the odometry");
  v.option("base_frame", o.base_frame, "frame of the inertial sensor");
}

}  // namespace

class InertialOdometryNode::Impl {
 public:
  Impl(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);

 private:
  void onImu(const sensor_msgs::ImuConstPtr& message);
  void onPose(const geometry_msgs::PoseWithCovarianceStampedConstPtr& message);
  bool onReset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  void publishReady();
  void publish(const inertial::OdometryState& state, const ImuSample& sample);
  void report(DiagnosticStatus& status);

  ros::NodeHandle nh_, private_nh_;
  InertialNodeOptions options_;
  inertial::InertialOptions inertial_options_;
  std::unique_ptr<inertial::InertialOdometry> odometry_;
  std::deque<ImuSample> waiting_;  ///< added, but their states are not known yet
  std::size_t received_ = 0, refused_ = 0, published_ = 0, lost_ = 0;
  std::string trouble_;

  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener tf_listener_{tf_};
  tf2_ros::TransformBroadcaster tf_broadcaster_;
  ros::Publisher odometry_publisher_;
  ros::Subscriber imu_, pose_;
  ros::ServiceServer reset_;
  std::unique_ptr<Diagnostics> diagnostics_;
};

InertialOdometryNode::Impl::Impl(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : nh_(nh), private_nh_(private_nh) {
  loadPrivate(private_nh_, {"inertial"}, options_);
  loadBlock(nh_, private_nh_, "inertial", inertial_options_);
  odometry_ = std::make_unique<inertial::InertialOdometry>(inertial_options_);
  odometry_publisher_ = nh_.advertise<nav_msgs::Odometry>("odometry", 0);
  diagnostics_ = std::make_unique<Diagnostics>(
      nh_, private_nh_, "inertial odometry", [this](DiagnosticStatus& status) { report(status); });
  reset_ = private_nh_.advertiseService("reset", &Impl::onReset, this);
  pose_ = nh_.subscribe("registration/pose", kImuQueue, &Impl::onPose, this);
  imu_ = nh_.subscribe("mti/imu/data", kImuQueue, &Impl::onImu, this,
                       ros::TransportHints().tcpNoDelay());
}

void InertialOdometryNode::Impl::onImu(const sensor_msgs::ImuConstPtr& message) {
  ++received_;
  const Result<ImuSample> sample = imuInBase(*message, tf_, options_.base_frame);
  if (!sample) {
    ++refused_;
    trouble_ = sample.status().message();
    ROS_WARN_STREAM_THROTTLE(kLogPeriod_s, "inertial: sample skipped: " << trouble_);
    return;
  }
  const Status status = odometry_->add(*sample);
  if (!status) {
    trouble_ = status.message();
    ROS_WARN_STREAM_THROTTLE(kLogPeriod_s, "inertial: " << trouble_);
  }
  if (status.code() == StatusCode::kInvalidInput) return;  // skipped; behind a gap it is used
  waiting_.push_back(*sample);
  publishReady();
}

void InertialOdometryNode::Impl::publishReady() {
  while (!waiting_.empty()) {
    const Result<inertial::OdometryState> state = odometry_->predict(waiting_.front().stamp);
    if (!state && state.status().code() == StatusCode::kNotEnoughData) return;
    if (state) {
      publish(*state, waiting_.front());
    } else {
      ++lost_;
      trouble_ = state.status().message();
    }
    waiting_.pop_front();
  }
}

void InertialOdometryNode::Impl::publish(const inertial::OdometryState& state,
                                         const ImuSample& sample) {
  ++published_;
  odometry_publisher_.publish(
      toRos(state, sample.angular_velocity, options_.odom_frame, options_.base_frame));
  tf_broadcaster_.sendTransform(
      toRos(state.T_odom_base, state.stamp, options_.odom_frame, options_.base_frame));
}

void InertialOdometryNode::Impl::onPose(
    const geometry_msgs::PoseWithCovarianceStampedConstPtr& message) {
  const Result<Eigen::Isometry3d> pose = fromRos(message->pose.pose);
  if (pose) odometry_->correct(fromRos(message->header.stamp), *pose);
}

bool InertialOdometryNode::Impl::onReset(std_srvs::Trigger::Request&,
                                         std_srvs::Trigger::Response& response) {
  odometry_ = std::make_unique<inertial::InertialOdometry>(inertial_options_);
  waiting_.clear();
  received_ = refused_ = published_ = lost_ = 0;
  trouble_.clear();
  response.success = true;
  response.message = "the odometry starts anew with the next sample";
  return true;
}

void InertialOdometryNode::Impl::report(DiagnosticStatus& status) {
  const inertial::InertialStatistics& s = odometry_->statistics();
  status.summary(kDiagnosticOk, "working");
  if (s.gaps + refused_ + s.non_finite + s.backwards + s.duplicates > 0) {
    status.summary(kDiagnosticWarn, trouble_.empty() ? "samples were skipped" : trouble_);
  }
  if (published_ == 0) status.summary(kDiagnosticWarn, "gathering the samples that it starts from");
  if (received_ == 0) status.summary(kDiagnosticError, "no samples on " + imu_.getTopic());
  status.add("samples received", received_);
  status.add("samples refused", refused_ + s.non_finite);
  status.add("samples backwards or twice", s.backwards + s.duplicates);
  status.add("gaps", s.gaps);
  status.add("longest gap (s)", s.longest_gap_s);
  status.add("sample rate (Hz)", s.sample_rate_hz);
  status.add("states published", published_);
  status.add("states lost in gaps", lost_);
  status.add("corrections", s.corrections);
  status.add("corrections ignored", s.corrections_ignored);
  status.add("orientation in use", s.has_orientation);
  status.add("gyro bias (rad/s)", s.gyro_bias.norm());
}

InertialOdometryNode::InertialOdometryNode(const ros::NodeHandle& nh,
                                           const ros::NodeHandle& private_nh)
    : impl_(std::make_unique<Impl>(nh, private_nh)) {}
InertialOdometryNode::~InertialOdometryNode() = default;

}  // namespace scanner::bridge
