// Messages and diagnostics of mti_node, without a master.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "ros/mti_node_diagnostics.h"
#include "ros/mti_node_messages.h"

namespace scanner::bridge {
namespace {

using Eigen::Vector3d;

mti::Sample fullSample() {
  mti::Sample sample;
  sample.stamp = fromNanoseconds(1'700'000'000'123'456'789);
  sample.angular_velocity = Vector3d(0.1, 0.2, 0.3);
  sample.acceleration = Vector3d(1.0, 2.0, 9.0);
  sample.magnetic_field = Vector3d(0.4, -0.2, 0.8);
  sample.orientation = Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5);
  sample.temperature_c = 21.5;
  return sample;
}

double sigma(const boost::array<double, 9>& covariance, std::size_t axis) {
  return std::sqrt(covariance[4 * axis]);
}

TEST(MtiMessages, ValuesUnitsAndStamp) {
  MtiNodeOptions options;
  options.field_strength_t = 40e-6;
  const auto messages = MtiMessages(options, 100.0).of(fullSample());
  ASSERT_TRUE(messages) << messages.status().message();
  EXPECT_EQ(messages->imu.header.stamp, ros::Time(1'700'000'000, 123'456'789));
  EXPECT_EQ(messages->imu.header.frame_id, "base_link");
  EXPECT_EQ(messages->imu.angular_velocity.y, 0.2);
  EXPECT_EQ(messages->imu.linear_acceleration.z, 9.0);
  EXPECT_EQ(messages->imu.orientation.w, 0.5);
  EXPECT_EQ(messages->imu.orientation.y, -0.5);
  ASSERT_TRUE(messages->magnetic_field && messages->temperature);
  EXPECT_EQ(messages->magnetic_field->header, messages->imu.header);
  EXPECT_DOUBLE_EQ(messages->magnetic_field->magnetic_field.z, 32e-6);
  EXPECT_EQ(messages->temperature->header, messages->imu.header);
  EXPECT_EQ(messages->temperature->temperature, 21.5);
}

TEST(MtiMessages, CovariancesAreVariancesOfWhatTheSamplesHold) {
  const double rad = M_PI / 180.0;
  MtiNodeOptions options;
  options.roll_pitch_sigma_deg = 0.5;
  options.heading_sigma_deg = 1.0;
  for (const auto& [rate_hz, band_hz] :
       {std::pair(20.0, 10.0), std::pair(100.0, 40.0), std::pair(512.0, 40.0)}) {
    const auto imu = MtiMessages(options, rate_hz).of(fullSample())->imu;
    for (const std::size_t axis : {0U, 1U, 2U}) {
      EXPECT_NEAR(sigma(imu.angular_velocity_covariance, axis), 0.1 * rad * std::sqrt(band_hz),
                  1e-12);
      EXPECT_NEAR(sigma(imu.linear_acceleration_covariance, axis), 0.02 * std::sqrt(band_hz),
                  1e-12);
      // Heading is the rotation about z, which points up.
      EXPECT_NEAR(sigma(imu.orientation_covariance, axis), (axis == 2 ? 1.0 : 0.5) * rad, 1e-12);
    }
    EXPECT_EQ(imu.orientation_covariance[1], 0.0);
  }
  options.angular_velocity_sigma_deg_s = 3.0;
  options.acceleration_sigma_m_s2 = 0.3;
  options.magnetic_field_sigma_t = 2e-6;
  const auto messages = MtiMessages(options, 100.0).of(fullSample());
  EXPECT_NEAR(sigma(messages->imu.angular_velocity_covariance, 1), 3.0 * rad, 1e-12);
  EXPECT_NEAR(sigma(messages->imu.linear_acceleration_covariance, 1), 0.3, 1e-12);
  EXPECT_NEAR(sigma(messages->magnetic_field->magnetic_field_covariance, 1), 2e-6, 1e-15);
}

TEST(MtiMessages, WhatTheDeviceDoesNotSendIsMarkedAbsent) {
  mti::Sample sample;
  sample.stamp = fullSample().stamp;
  const MtiMessages messages(MtiNodeOptions(), 100.0);
  const auto nothing = messages.of(sample);
  EXPECT_EQ(nothing->imu.orientation_covariance[0], -1.0);
  EXPECT_EQ(nothing->imu.angular_velocity_covariance[0], -1.0);
  EXPECT_EQ(nothing->imu.linear_acceleration_covariance[0], -1.0);
  EXPECT_EQ(nothing->imu.orientation.w, 1.0) << "a rotation nevertheless";
  EXPECT_FALSE(nothing->magnetic_field || nothing->temperature);
  sample.angular_velocity = Vector3d::Zero();
  sample.acceleration = Vector3d::Zero();
  const auto plain = messages.of(sample);
  EXPECT_EQ(plain->imu.orientation_covariance[0], -1.0);
  EXPECT_GT(plain->imu.angular_velocity_covariance[0], 0.0);
  EXPECT_GT(plain->imu.linear_acceleration_covariance[0], 0.0);
}

TEST(MtiMessages, RefusesWhatTfOrRosTimeDoNotTake) {
  for (const char* frame : {"", "/base_link"}) {
    MtiNodeOptions options;
    options.frame_id = frame;
    EXPECT_THROW(MtiMessages(options, 100.0), ConfigurationError) << frame;
  }
  mti::Sample early = fullSample();
  early.stamp = fromNanoseconds(-1);
  EXPECT_EQ(MtiMessages(MtiNodeOptions(), 100.0).of(early).status().code(),
            StatusCode::kOutOfRange);
}

TEST(MtiMessages, OptionsOutOfBoundsAreRefused) {
  for (const char* tree : {R"({"field_strength_t": 50.0})", R"({"heading_sigma_deg": 0.0})",
                           R"({"acceleration_sigma_m_s2": -0.1})", R"({"frame": "mti"})"}) {
    MtiNodeOptions options;
    EXPECT_THROW(loadOptions(ParameterTree::parse(tree), "", options), ConfigurationError) << tree;
  }
}

class MtiReportTest : public testing::Test {
 protected:
  MtiReportTest() {
    now_.state = mti::DriverState::kMeasuring;
    now_.device_id = "00300123";
    now_.rate_hz = 100.0;
    now_.connections = 1;
  }
  DiagnosticStatus after(double seconds) {
    time_ += std::chrono::duration_cast<MtiReport::Clock::duration>(
        std::chrono::duration<double>(seconds));
    DiagnosticStatus status;
    report_.fill(now_, 100.0, 24.0, time_, status);
    return status;
  }

  mti::DriverStatistics now_;
  MtiReport report_;
  MtiReport::Clock::time_point time_{};
};

TEST_F(MtiReportTest, MeasuringIsFineAndNamesTheDevice) {
  const DiagnosticStatus status = after(1.0);
  EXPECT_EQ(status.level, kDiagnosticOk);
  EXPECT_EQ(status.message, "measuring");
  EXPECT_EQ(status.hardware_id, "00300123");
}

TEST_F(MtiReportTest, LossesWarnForAWhile) {
  after(1.0);
  now_.lost = 3;
  now_.checksum_errors = 2;
  const DiagnosticStatus status = after(1.0);
  EXPECT_EQ(status.level, kDiagnosticWarn);
  EXPECT_NE(status.message.find("3 samples lost"), std::string::npos) << status.message;
  EXPECT_NE(status.message.find("2 checksum errors"), std::string::npos) << status.message;
  EXPECT_EQ(after(5.0).level, kDiagnosticWarn);
  EXPECT_EQ(after(6.0).level, kDiagnosticOk);
}

TEST_F(MtiReportTest, AWrongRateWarnsOnceItCounts) {
  now_.rate_hz = 80.0;
  EXPECT_EQ(after(1.0).level, kDiagnosticOk) << "not settled";
  EXPECT_EQ(after(6.0).level, kDiagnosticWarn);
  ++now_.connections;
  EXPECT_EQ(after(1.0).level, kDiagnosticOk) << "begun anew";
  now_.rate_hz = 99.9;
  EXPECT_EQ(after(6.0).level, kDiagnosticOk);
  now_.rate_hz = 80.0;
  DiagnosticStatus status;
  report_.fill(now_, 0.0, {}, time_, status);
  EXPECT_EQ(status.level, kDiagnosticOk) << "no rate was asked for";
}

TEST_F(MtiReportTest, NotMeasuringIsAnErrorWithItsReason) {
  now_.state = mti::DriverState::kSearching;
  now_.problem = "no such port";
  now_.lost = 5;
  DiagnosticStatus status = after(1.0);
  EXPECT_EQ(status.level, kDiagnosticError);
  EXPECT_EQ(status.message, "no such port");
  now_.problem.clear();
  now_.device_id.clear();
  status = after(1.0);
  EXPECT_EQ(status.level, kDiagnosticError);
  EXPECT_EQ(status.message, "searching");
  EXPECT_EQ(status.hardware_id, "none");
}

}  // namespace
}  // namespace scanner::bridge
