// mti_node with an emulated device: values, stamps, resets, faults, cables. Run by mti_node.test,
// whose nodes wait for the devices that come and go here.
#include <gtest/gtest.h>
#include <ros/init.h>
#include <ros/service.h>
#include <ros/spinner.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/MagneticField.h>
#include <sensor_msgs/Temperature.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "ros/node_listener.h"
#include "scanner/ResetOrientation.h"
#include "scanner/core/se3.h"
#include "scanner/ros/conversions.h"
#include "scanner/simulation/emulated_mti.h"

namespace scanner::bridge {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using simulation::EmulatedMti;
using simulation::MtiSample;
using test::DiagnosticsInbox;
using test::eventually;
using test::Inbox;

constexpr int kOk = diagnostic_msgs::DiagnosticStatus::OK;
constexpr int kWarn = diagnostic_msgs::DiagnosticStatus::WARN;
constexpr int kError = diagnostic_msgs::DiagnosticStatus::ERROR;
constexpr const char* kStatus = "mti_node: mti";
constexpr const char* kOtherStatus = "other/mti_node: mti";

const Vector3d kEarthField(0.0, 0.5, -0.8);  ///< ENU: northwards and down
const Vector3d kGravity(0.0, 0.0, 9.82);
const Vector3d kRates(0.1, -0.2, 0.3);
constexpr double kTemperature_c = 24.5;
/// Roll, pitch, heading.
const Vector3d kAttitude(0.2, -0.4, 0.7);

Quaterniond attitude(const Vector3d& roll_pitch_yaw) {
  return Eigen::AngleAxisd(roll_pitch_yaw.z(), Vector3d::UnitZ()) *
         Eigen::AngleAxisd(roll_pitch_yaw.y(), Vector3d::UnitY()) *
         Eigen::AngleAxisd(roll_pitch_yaw.x(), Vector3d::UnitX());
}

MtiSample sampleAt(double time_s, const Quaterniond& R_enu_sensor, const Vector3d& rates) {
  MtiSample sample;
  sample.time_s = time_s;
  sample.imu.angular_velocity = rates;
  sample.imu.linear_acceleration = R_enu_sensor.conjugate() * kGravity;
  sample.imu.orientation = R_enu_sensor;
  sample.magnetic_field = R_enu_sensor.conjugate() * kEarthField;
  sample.temperature_c = kTemperature_c;
  return sample;
}

/// Stands still for ever.
std::vector<MtiSample> standing() { return {sampleAt(0.0, attitude(kAttitude), kRates)}; }

/// From the start on about the vertical, 1 rad/s.
std::vector<MtiSample> turning() {
  std::vector<MtiSample> samples;
  for (int i = 0; i <= 250; ++i) {
    samples.push_back(
        sampleAt(0.01 * i, attitude({0.0, 0.0, 0.01 * i}), i > 0 ? Vector3d::UnitZ() : kRates));
  }
  return samples;
}

Vector3d toEigen(const geometry_msgs::Vector3& v) { return {v.x, v.y, v.z}; }
Quaterniond orientationOf(const sensor_msgs::Imu& message) {
  const auto& q = message.orientation;
  return {q.w, q.x, q.y, q.z};
}
double headingOf(const sensor_msgs::Imu& message) {
  return rollPitchYaw(orientationOf(message).toRotationMatrix()).z();
}

/// Whether this is what the device that stands measures, with this heading, but for what a damaged
/// line can hide in the sensor's noise (mti/plausibility.h).
bool isStanding(const sensor_msgs::Imu& message, double heading = kAttitude.z()) {
  const Quaterniond expected = attitude({kAttitude.x(), kAttitude.y(), heading});
  const Quaterniond orientation = orientationOf(message);
  return orientation.angularDistance(expected) < 1e-3 &&
         std::abs(orientation.norm() - 1.0) < 1e-6 &&
         (toEigen(message.angular_velocity) - kRates).norm() < 0.02 &&
         (orientation * toEigen(message.linear_acceleration) - kGravity).norm() < 0.09;
}

template <typename Message>
std::vector<Time> stamps(const Inbox<Message>& inbox) {
  std::vector<Time> times;
  for (const Message& message : inbox.all()) times.push_back(fromRos(message.header.stamp));
  return times;
}

void expectIncreasing(const std::vector<Time>& times) {
  for (std::size_t i = 1; i < times.size(); ++i) ASSERT_LT(times[i - 1], times[i]) << i;
}

void expectDiagonal(const boost::array<double, 9>& covariance, const Vector3d& sigmas) {
  for (std::size_t i = 0; i < 9; ++i) {
    const double sigma = i % 4 == 0 ? sigmas[static_cast<int>(i / 4)] : 0.0;
    EXPECT_NEAR(covariance[i], sigma * sigma, 1e-9 * sigma * sigma) << i;
  }
}

struct Ended {
  int code = -1;
  std::string output;
};

/// Runs a command of the node to its end where no master is.
Ended runWithoutMaster(const std::string& arguments) {
  Ended ended;
  const std::string command =
      "ROS_MASTER_URI=http://localhost:1 timeout 60 rosrun scanner mti_node " + arguments + " 2>&1";
  FILE* pipe = popen(command.c_str(), "r");
  std::array<char, 512> buffer{};
  while (pipe != nullptr && std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) {
    ended.output += buffer.data();
  }
  if (pipe != nullptr) ended.code = WEXITSTATUS(pclose(pipe));
  return ended;
}

class MtiNodeTest : public testing::Test {
 protected:
  MtiNodeTest() : imu_(nh_, "/mti/imu/data"), diagnostics_(nh_), spinner_(2) { spinner_.start(); }

  std::string link(const std::string& node) {
    std::string path;
    EXPECT_TRUE(nh_.getParam(node + "/mti/port", path));
    return path;
  }
  std::unique_ptr<EmulatedMti> device(std::vector<MtiSample> samples,
                                      const std::string& node = "/mti_node") {
    EmulatedMti::Options options;
    options.link = link(node);
    return std::make_unique<EmulatedMti>(options, std::move(samples));
  }
  static ResetOrientation::Response reset(const std::string& name) {
    ResetOrientation call;
    call.request.reset = name;
    EXPECT_TRUE(ros::service::call("/mti_node/reset_orientation", call));
    return call.response;
  }

  ros::NodeHandle nh_;
  Inbox<sensor_msgs::Imu> imu_;
  DiagnosticsInbox diagnostics_;
  ros::AsyncSpinner spinner_;
};

TEST_F(MtiNodeTest, SamplesHaveTheirValuesFramesAndCovariances) {
  const Inbox<sensor_msgs::MagneticField> fields(nh_, "/mti/imu/mag");
  const Inbox<sensor_msgs::Temperature> temperatures(nh_, "/mti/temperature");
  const auto mti = device(standing());
  ASSERT_TRUE(eventually([&] {
    return imu_.size() > 100 && fields.size() > 100 && temperatures.size() > 100;
  })) << diagnostics_.of(kStatus).message;
  for (const sensor_msgs::Imu& message : imu_.all()) {
    ASSERT_TRUE(isStanding(message)) << message;
    EXPECT_EQ(message.header.frame_id, "base_link");
  }
  const sensor_msgs::Imu imu = imu_.all().back();
  const double rad = M_PI / 180.0;
  // Data sheet, 40 Hz of bandwidth.
  expectDiagonal(imu.angular_velocity_covariance, Vector3d::Constant(0.1 * rad * std::sqrt(40.0)));
  expectDiagonal(imu.linear_acceleration_covariance, Vector3d::Constant(0.02 * std::sqrt(40.0)));
  expectDiagonal(imu.orientation_covariance, Vector3d::Constant(2.0 * rad));
  const sensor_msgs::MagneticField field = fields.all().back();
  const Vector3d field_enu = orientationOf(imu) * toEigen(field.magnetic_field);
  EXPECT_LT((field_enu - 50e-6 * kEarthField).norm(), 0.05e-6) << field_enu.transpose();
  EXPECT_EQ(field.header.frame_id, "base_link");
  expectDiagonal(field.magnetic_field_covariance, Vector3d::Constant(50e-9));
  const sensor_msgs::Temperature temperature = temperatures.all().back();
  EXPECT_NEAR(temperature.temperature, kTemperature_c, 1e-4);
  EXPECT_EQ(temperature.header.frame_id, "base_link");
  ASSERT_TRUE(diagnostics_.says(kStatus, kOk, "measuring"));
  EXPECT_EQ(diagnostics_.of(kStatus).hardware_id, "00300123");
  EXPECT_EQ(diagnostics_.value(kStatus, "baud rate"), "460800");
  EXPECT_EQ(diagnostics_.value(kStatus, "temperature (deg C)"), "24.5");
}

TEST_F(MtiNodeTest, EverySampleOnceAtTheTimeWhenItWasTaken) {
  const Inbox<sensor_msgs::Temperature> temperatures(nh_, "/mti/temperature");
  const auto mti = device(turning());
  ASSERT_TRUE(imu_.more(50));
  const Time zero = fromRos(ros::Time::now());
  mti->start();
  ASSERT_TRUE(eventually([&] { return headingOf(imu_.all().back()) > 2.4; }));
  const std::vector<sensor_msgs::Imu> messages = imu_.all();
  expectIncreasing(stamps(imu_));
  std::size_t moving = 0;
  for (const sensor_msgs::Imu& message : messages) {
    const double heading = headingOf(message);
    if (heading < 0.02 || heading > 2.49) continue;
    ++moving;
    EXPECT_NEAR(toSeconds(fromRos(message.header.stamp) - zero), heading, 0.03);
    EXPECT_LT((toEigen(message.angular_velocity) - Vector3d::UnitZ()).norm(), 1e-3);
  }
  EXPECT_NEAR(static_cast<double>(moving), 240.0, 20.0) << "10 ms apart";
  // The topics' samples are the same ones.
  const std::vector<Time> all = stamps(imu_);
  std::size_t common = 0;
  for (const Time stamp : stamps(temperatures)) {
    if (std::binary_search(all.begin(), all.end(), stamp)) ++common;
  }
  EXPECT_GT(common + 20, all.size());
}

TEST_F(MtiNodeTest, TheCableOutAndInAgain) {
  const auto mti = device(standing());
  ASSERT_TRUE(imu_.more(20));
  ASSERT_TRUE(diagnostics_.says(kStatus, kOk, "measuring"));
  const int connections = std::stoi(diagnostics_.value(kStatus, "connections"));
  for (int i = 1; i <= 2; ++i) {
    mti->unplug();
    EXPECT_TRUE(diagnostics_.says(kStatus, kError, ""));
    EXPECT_FALSE(diagnostics_.of(kStatus).message.empty());
    EXPECT_NE(diagnostics_.value(kStatus, "state"), "measuring");
    const ResetOrientation::Response refused = reset("heading");
    EXPECT_FALSE(refused.success);
    EXPECT_FALSE(refused.message.empty());
    mti->plug();
    EXPECT_TRUE(imu_.more(20));
    EXPECT_TRUE(eventually([&] { return diagnostics_.of(kStatus).level < kError; }));
    EXPECT_EQ(std::stoi(diagnostics_.value(kStatus, "connections")), connections + i);
  }
  expectIncreasing(stamps(imu_));
  for (const sensor_msgs::Imu& message : imu_.all()) ASSERT_TRUE(isStanding(message)) << message;
}

TEST_F(MtiNodeTest, OrientationIsResetAndStored) {
  const auto mti = device(standing());
  ASSERT_TRUE(imu_.more(20));
  const ResetOrientation::Response unknown = reset("sideways");
  EXPECT_FALSE(unknown.success);
  EXPECT_NE(unknown.message.find("sideways"), std::string::npos);
  for (const char* known : {"store", "heading", "global", "object", "align"}) {
    EXPECT_NE(unknown.message.find(known), std::string::npos) << unknown.message;
  }
  EXPECT_FALSE(reset("").success);
  EXPECT_TRUE(isStanding(imu_.all().back()));
  // The sensor's x axis becomes north, which is y of ENU.
  const ResetOrientation::Response done = reset("heading");
  EXPECT_TRUE(done.success) << done.message;
  EXPECT_TRUE(eventually([&] { return isStanding(imu_.all().back(), M_PI_2); }))
      << imu_.all().back();
  const ResetOrientation::Response stored = reset("store");
  EXPECT_TRUE(stored.success) << stored.message;
  ASSERT_TRUE(imu_.more(20));
  mti->unplug();
  ASSERT_TRUE(diagnostics_.says(kStatus, kError, ""));
  mti->plug();
  ASSERT_TRUE(imu_.more(20));
  EXPECT_TRUE(isStanding(imu_.all().back(), M_PI_2)) << imu_.all().back();
  for (const sensor_msgs::Imu& message : imu_.all()) {
    ASSERT_TRUE(isStanding(message) || isStanding(message, M_PI_2)) << "nothing in between";
  }
}

TEST_F(MtiNodeTest, ADamagedLineCostsSamplesAndSpoilsNone) {
  const auto mti = device(standing());
  ASSERT_TRUE(imu_.more(20));
  mti->setFaults({0.01, 0.0, false, false});
  EXPECT_TRUE(imu_.more(200));
  EXPECT_TRUE(diagnostics_.says(kStatus, kWarn, "checksum errors"));
  EXPECT_GT(std::stoi(diagnostics_.value(kStatus, "checksum errors")), 10);
  EXPECT_GT(std::stoi(diagnostics_.value(kStatus, "lost")), 10);
  EXPECT_GT(std::stoi(diagnostics_.value(kStatus, "skipped bytes")), 10);
  for (const sensor_msgs::Imu& message : imu_.all()) ASSERT_TRUE(isStanding(message)) << message;
  expectIncreasing(stamps(imu_));
}

TEST_F(MtiNodeTest, SilenceIsSaidAndOvercome) {
  const auto mti = device(standing());
  ASSERT_TRUE(imu_.more(20));
  mti->setFaults({0.0, 0.0, false, true});
  EXPECT_TRUE(diagnostics_.says(kStatus, kError, ""));
  mti->setFaults({});
  EXPECT_TRUE(imu_.more(20));
}

TEST_F(MtiNodeTest, ParametersReachDeviceAndMessages) {
  const Inbox<sensor_msgs::Imu> imu(nh_, "/other/mti/imu/data");
  const Inbox<sensor_msgs::MagneticField> fields(nh_, "/other/mti/imu/mag");
  const Inbox<sensor_msgs::Temperature> temperatures(nh_, "/other/mti/temperature");
  const std::string path = link("/other/mti_node");
  EXPECT_TRUE(diagnostics_.says(kOtherStatus, kError, path)) << "waits for its port";
  const auto mti = device(standing(), "/other/mti_node");
  ASSERT_TRUE(imu.more(60)) << diagnostics_.of(kOtherStatus).message;
  const std::vector<sensor_msgs::Imu> messages = imu.all();
  const double span_s = (messages.back().header.stamp - messages.front().header.stamp).toSec();
  EXPECT_NEAR(static_cast<double>(messages.size() - 1) / span_s, 50.0, 5.0);
  for (const sensor_msgs::Imu& message : messages) {
    ASSERT_TRUE(isStanding(message)) << message;
    EXPECT_EQ(message.header.frame_id, "mti");
  }
  const double rad = M_PI / 180.0;
  expectDiagonal(messages[0].angular_velocity_covariance, Vector3d::Constant(2.0 * rad));
  expectDiagonal(messages[0].linear_acceleration_covariance, Vector3d::Constant(0.5));
  expectDiagonal(messages[0].orientation_covariance, rad * Vector3d(3.0, 3.0, 10.0));
  EXPECT_EQ(fields.size(), 0U);
  EXPECT_EQ(temperatures.size(), 0U);
}

TEST_F(MtiNodeTest, ProbingNamesTheDeviceWithoutAMaster) {
  EmulatedMti::Options options;
  options.link = link("/mti_node") + "_probed";
  EmulatedMti mti(options, standing());
  const Ended ended = runWithoutMaster("--probe " + options.link);
  EXPECT_EQ(ended.code, 0) << ended.output;
  for (const char* part : {"device_id: \"00300123\"", "baud_rate: 115200", "firmware: \""}) {
    EXPECT_NE(ended.output.find(part), std::string::npos) << ended.output;
  }
  EXPECT_NE(ended.output.find("port: " + options.link), std::string::npos) << ended.output;
}

}  // namespace
}  // namespace scanner::bridge

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "mti_node_test");
  const ros::NodeHandle keep_running;
  return RUN_ALL_TESTS();
}
