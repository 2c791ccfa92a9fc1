#include "ros/mti_node_messages.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "scanner/ros/conversions.h"

namespace scanner::bridge {
namespace {

// Xsens MTi data sheet (table of the thesis' section 3.3).
constexpr double kGyroNoise_deg_s_sqrthz = 0.1;
constexpr double kAccelerationNoise_m_s2_sqrthz = 0.02;
constexpr double kBandwidth_hz = 40.0;

constexpr double kRadPerDeg = M_PI / 180.0;

using Covariance = sensor_msgs::Imu::_angular_velocity_covariance_type;

/// Row-major, of independent axes.
Covariance diagonal(const Eigen::Vector3d& sigmas) {
  Covariance covariance;
  covariance.fill(0.0);
  covariance[0] = sigmas.x() * sigmas.x();
  covariance[4] = sigmas.y() * sigmas.y();
  covariance[8] = sigmas.z() * sigmas.z();
  return covariance;
}

Covariance diagonal(double sigma) { return diagonal(Eigen::Vector3d::Constant(sigma)); }

/// How REP-145 and sensor_msgs/Imu say that a quantity is not measured.
Covariance absent() {
  Covariance covariance;
  covariance.fill(0.0);
  covariance[0] = -1.0;
  return covariance;
}

geometry_msgs::Vector3 vector(const Eigen::Vector3d& v) {
  geometry_msgs::Vector3 message;
  message.x = v.x();
  message.y = v.y();
  message.z = v.z();
  return message;
}

}  // namespace

MtiMessages::MtiMessages(const MtiNodeOptions& options, double rate_hz)
    : frame_id_(options.frame_id), field_strength_t_(options.field_strength_t) {
  if (frame_id_.empty() || frame_id_.front() == '/') {
    throw ConfigurationError("option 'frame_id' = '" + frame_id_ +
                             "': a name without a leading slash is expected");
  }
  // White noise up to the sensors' bandwidth, or as much of it as the samples can hold.
  const double root_band = std::sqrt(std::min(0.5 * rate_hz, kBandwidth_hz));
  const double rate_sigma_deg_s = options.angular_velocity_sigma_deg_s > 0.0
                                      ? options.angular_velocity_sigma_deg_s
                                      : kGyroNoise_deg_s_sqrthz * root_band;
  const double acceleration_sigma = options.acceleration_sigma_m_s2 > 0.0
                                        ? options.acceleration_sigma_m_s2
                                        : kAccelerationNoise_m_s2_sqrthz * root_band;
  angular_velocity_ = diagonal(rate_sigma_deg_s * kRadPerDeg);
  acceleration_ = diagonal(acceleration_sigma);
  magnetic_field_ = diagonal(options.magnetic_field_sigma_t);
  orientation_ = diagonal(kRadPerDeg * Eigen::Vector3d(options.roll_pitch_sigma_deg,
                                                       options.roll_pitch_sigma_deg,
                                                       options.heading_sigma_deg));
}

Result<MtiMessages::Messages> MtiMessages::of(const mti::Sample& sample) const {
  const Result<ros::Time> stamp = toRos(sample.stamp);
  if (!stamp) return stamp.status();
  std_msgs::Header header;
  header.stamp = *stamp;
  header.frame_id = frame_id_;
  Messages messages;
  messages.imu = imu(sample, header);
  if (sample.magnetic_field) {
    sensor_msgs::MagneticField field;
    field.header = header;
    field.magnetic_field = vector(field_strength_t_ * *sample.magnetic_field);
    field.magnetic_field_covariance = magnetic_field_;
    messages.magnetic_field = field;
  }
  if (sample.temperature_c) {
    sensor_msgs::Temperature temperature;
    temperature.header = header;
    temperature.temperature = *sample.temperature_c;
    temperature.variance = 0.0;  // unknown: the data sheet does not say
    messages.temperature = temperature;
  }
  return messages;
}

sensor_msgs::Imu MtiMessages::imu(const mti::Sample& sample, const std_msgs::Header& header) const {
  ImuSample known;
  known.stamp = sample.stamp;
  known.orientation = sample.orientation;
  known.angular_velocity = sample.angular_velocity.value_or(Eigen::Vector3d::Zero());
  known.linear_acceleration = sample.acceleration.value_or(Eigen::Vector3d::Zero());
  sensor_msgs::Imu message = toRos(known, frame_id_);
  message.header = header;
  message.orientation_covariance = sample.orientation ? orientation_ : absent();
  message.angular_velocity_covariance = sample.angular_velocity ? angular_velocity_ : absent();
  message.linear_acceleration_covariance = sample.acceleration ? acceleration_ : absent();
  return message;
}

}  // namespace scanner::bridge
