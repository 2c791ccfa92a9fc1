#include "scanner/ros/mti_node.h"

#include <ros/console.h>

#include <mutex>
#include <optional>
#include <utility>

#include "ros/diagnostics.h"
#include "ros/mti_node_diagnostics.h"
#include "ros/mti_node_messages.h"
#include "scanner/ResetOrientation.h"
#include "scanner/mti/driver.h"
#include "scanner/ros/parameters.h"

namespace scanner::bridge {
namespace {

using mti::DriverOptions;
using mti::DriverState;
using mti::DriverStatistics;
using mti::OrientationReset;

constexpr const char* kBlock = "mti";
/// Half a minute at the highest rate for a subscriber that does not take them; then the oldest go.
constexpr int kTopicQueue = 15000;
constexpr double kLogPeriod_s = 5.0;

constexpr std::pair<const char*, OrientationReset> kResets[] = {
    {"store", OrientationReset::kStore},   {"heading", OrientationReset::kHeading},
    {"global", OrientationReset::kGlobal}, {"object", OrientationReset::kObject},
    {"align", OrientationReset::kAlign},
};

MtiNodeOptions loadNodeOptions(const ros::NodeHandle& private_nh) {
  MtiNodeOptions options;
  loadPrivate(private_nh, {kBlock}, options);
  return options;
}

DriverOptions loadDriverOptions(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh) {
  DriverOptions options;
  loadBlock(nh, private_nh, kBlock, options);
  return options;
}

/// What the driver says about the device, in the log, when it changes.
class StateLog {
 public:
  void tell(const DriverStatistics& now) {
    const bool measuring = now.state == DriverState::kMeasuring;
    if (measuring && now.connections != connections_) {
      if (measuring_) ROS_WARN("measuring was interrupted");
      ROS_INFO("measuring: MTi %s on %s, %d baud", now.device_id.c_str(), now.port.c_str(),
               now.baud_rate);
      if (!now.notes.empty()) ROS_WARN("%s", now.notes.c_str());
      connections_ = now.connections;
      problem_.clear();
    } else if (!measuring && !now.problem.empty() && now.problem != problem_) {
      ROS_WARN("no samples: %s", now.problem.c_str());
      problem_ = now.problem;
    }
    // Without a problem the search goes on as before.
    if (measuring || !now.problem.empty()) measuring_ = measuring;
  }

 private:
  bool measuring_ = false;
  std::uint64_t connections_ = 0;
  std::string problem_;
};

}  // namespace

void describe(OptionVisitor& v, MtiNodeOptions& o) {
  v.option("frame_id", o.frame_id, "tf frame of the sensor, without a leading slash");
  v.option("field_strength_t", o.field_strength_t, {1e-6, 1e-3}, "T",
           "field per unit of the device, which calls the field at its calibration about 1");
  v.option("angular_velocity_sigma_deg_s", o.angular_velocity_sigma_deg_s, {0.0, 100.0}, "deg/s",
           "standard deviation of a rate; 0: data sheet, 0.1 deg/s/sqrt(Hz) up to half the rate, "
           "40 Hz at most");
  v.option("acceleration_sigma_m_s2", o.acceleration_sigma_m_s2, {0.0, 50.0}, "m/s^2",
           "standard deviation of an acceleration; 0: data sheet, 0.02 m/s^2/sqrt(Hz) up to half "
           "the rate, 40 Hz at most");
  v.option("magnetic_field_sigma_t", o.magnetic_field_sigma_t, {1e-12, 1e-3}, "T",
           "standard deviation of the magnetic field (data sheet: 0.5 mGauss)");
  v.option("roll_pitch_sigma_deg", o.roll_pitch_sigma_deg, {1e-3, 180.0}, "deg",
           "standard deviation of the orientation about the horizontal axes (data sheet: 0.5 "
           "standing still, 2 in motion)");
  v.option("heading_sigma_deg", o.heading_sigma_deg, {1e-3, 180.0}, "deg",
           "standard deviation of the orientation about the vertical (data sheet: 1 standing "
           "still, 2 in motion; iron nearby: more)");
}

class MtiNode::Impl {
 public:
  Impl(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  using Reset = scanner::ResetOrientation;

  void onSample(const mti::Sample& sample);
  void onReset(const std::string& name, Reset::Response& response);
  void report(DiagnosticStatus& status);

  const DriverOptions options_;
  const MtiMessages messages_;
  ros::Publisher imu_, magnetic_field_, temperature_;
  std::mutex mutex_;  ///< of latest_temperature_c_
  std::optional<double> latest_temperature_c_;
  StateLog log_;
  MtiReport report_;
  std::unique_ptr<mti::Driver> driver_;  ///< its thread uses what stands above
  ros::ServiceServer reset_;
  std::unique_ptr<Diagnostics> diagnostics_;
};

MtiNode::Impl::Impl(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : options_(loadDriverOptions(nh, private_nh)),
      messages_(loadNodeOptions(private_nh), options_.rate_hz),
      imu_(nh.advertise<sensor_msgs::Imu>("mti/imu/data", kTopicQueue)),
      magnetic_field_(nh.advertise<sensor_msgs::MagneticField>("mti/imu/mag", kTopicQueue)),
      temperature_(nh.advertise<sensor_msgs::Temperature>("mti/temperature", kTopicQueue)),
      driver_(std::make_unique<mti::Driver>(
          options_, [this](const mti::Sample& sample) { onSample(sample); })) {
  reset_ = private_nh.advertiseService<Reset::Request, Reset::Response>(
      "reset_orientation", [this](Reset::Request& request, Reset::Response& response) {
        onReset(request.reset, response);
        return true;
      });
  diagnostics_ = std::make_unique<Diagnostics>(
      nh, private_nh, kBlock, [this](DiagnosticStatus& status) { report(status); });
}

void MtiNode::Impl::onSample(const mti::Sample& sample) {
  const Result<MtiMessages::Messages> messages = messages_.of(sample);
  if (!messages) {
    ROS_WARN_STREAM_THROTTLE(kLogPeriod_s, "sample not published: " << messages.status().message());
    return;
  }
  imu_.publish(messages->imu);
  if (messages->magnetic_field) magnetic_field_.publish(*messages->magnetic_field);
  if (!messages->temperature) return;
  temperature_.publish(*messages->temperature);
  const std::lock_guard<std::mutex> lock(mutex_);
  latest_temperature_c_ = messages->temperature->temperature;
}

void MtiNode::Impl::onReset(const std::string& name, Reset::Response& response) {
  std::string known;
  for (const auto& [candidate, reset] : kResets) {
    known += (known.empty() ? "" : ", ") + std::string(candidate);
    if (name != candidate) continue;
    const Status status = driver_->resetOrientation(reset);
    response.success = status.isOk();
    response.message = status.isOk() ? "done: " + name : status.message();
    if (status) ROS_INFO("orientation reset: %s", candidate);
    return;
  }
  response.success = false;
  response.message = "unknown reset '" + name + "'; known are " + known;
}

void MtiNode::Impl::report(DiagnosticStatus& status) {
  const DriverStatistics now = driver_->statistics();
  log_.tell(now);
  std::optional<double> temperature_c;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    temperature_c = latest_temperature_c_;
  }
  report_.fill(now, options_.configure ? options_.rate_hz : 0.0, temperature_c,
               MtiReport::Clock::now(), status);
}

MtiNode::MtiNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : impl_(std::make_unique<Impl>(nh, private_nh)) {}
MtiNode::~MtiNode() = default;

}  // namespace scanner::bridge
