#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include "scanner/core/se3.h"
#include "scanner/inertial/odometry.h"

namespace scanner::inertial {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180.0;

std::string dataFolder() {
  const char* folder = std::getenv("SCANNER_DATA");
  return folder != nullptr ? folder : std::string(SCANNER_SOURCE_DIR) + "/../shared/data";
}

// Rows of numbers; the first column also as an exact integer where it is one.
struct Table {
  std::vector<std::int64_t> first;
  std::vector<std::vector<double>> rows;
};

Table readTable(const std::string& path, char separator, int header) {
  Table table;
  std::ifstream in(path);
  std::string line;
  for (int i = 0; std::getline(in, line); ++i) {
    if (i < header) continue;
    std::stringstream cells(line);
    std::string cell;
    std::vector<double> row;
    while (std::getline(cells, cell, separator)) row.push_back(std::strtod(cell.c_str(), nullptr));
    if (row.empty()) continue;
    table.first.push_back(std::strtoll(line.c_str(), nullptr, 10));
    table.rows.push_back(row);
  }
  return table;
}

Eigen::Vector3d vector3(const std::vector<double>& row, std::size_t i) {
  return {row.at(i), row.at(i + 1), row.at(i + 2)};
}

Eigen::Quaterniond attitudeAt(const InertialOdometry& odometry, Time stamp) {
  const Result<OdometryState> state = odometry.predict(stamp);
  EXPECT_TRUE(state.isOk()) << state.status().message();
  return Eigen::Quaterniond(state.value().T_odom_base.linear());
}

TEST(RealDataEuroc, AttitudeHoldsWhileTheVehicleStandsAndVibrates) {
  const std::string path = dataFolder() + "/euroc_v1_01/mav0/imu0/data.csv";
  const Table table = readTable(path, ',', 1);
  if (table.rows.empty()) GTEST_SKIP() << "no recording at " << path;
  InertialOdometry odometry{InertialOptions()};
  const Time start = fromNanoseconds(table.first.front());
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    ImuSample s;
    s.stamp = fromNanoseconds(table.first[i]);
    if (s.stamp - start > fromSeconds(5.0)) break;
    s.angular_velocity = vector3(table.rows[i], 1);
    s.linear_acceleration = vector3(table.rows[i], 4);
    ASSERT_TRUE(odometry.add(s).isOk());
  }
  const InertialStatistics& statistics = odometry.statistics();
  EXPECT_NEAR(statistics.sample_rate_hz, 200.0, 0.1);
  EXPECT_FALSE(statistics.has_orientation);
  ASSERT_TRUE(statistics.bias_known);
  // Bias that the recording's own estimator gives.
  EXPECT_LT((statistics.gyro_bias - Eigen::Vector3d(-0.00225, 0.02154, 0.07703)).norm(), 0.003);
  const auto at = [&](double t) { return attitudeAt(odometry, start + fromSeconds(t)); };
  const double drift = angleBetween(at(0.5), at(4.4)) / kDegree;
  double step = 0.0;
  for (double t = 0.0; t < 4.6; t += 0.1) step = std::max(step, angleBetween(at(t), at(t + 0.1)));
  std::cout << "drift 0.5-4.4 s: " << drift << " deg, largest turn in 0.1 s: " << step / kDegree
            << " deg\n";
  EXPECT_LT(drift, 0.2);
  EXPECT_LT(step, 1.0 * kDegree);
  const Eigen::Vector3d up = at(2.0).conjugate() * Eigen::Vector3d::UnitZ();
  // First orientation of the recording's ground truth: it says where gravity is.
  const Eigen::Quaterniond truth(0.069433, -0.824237, -0.106942, -0.551702);
  const Eigen::Vector3d truth_up = truth.conjugate() * Eigen::Vector3d::UnitZ();
  EXPECT_LT(std::acos(std::min(1.0, up.dot(truth_up.normalized()))), 1.0 * kDegree);
}

struct Tracking {
  double tilt_rms_deg = 0.0, tilt_max_deg = 0.0, angle_rms_deg = 0.0;
  int compared = 0;
};

// Attitude without magnetometer and without the sensor's own filter, against Vicon. Vicon gives the
// rotation since its first sample.
Tracking track(const Table& table) {
  InertialOptions options;
  options.gravity_mps2 = 9.8;
  options.history_s = 1000.0;
  InertialOdometry odometry(options);
  for (const auto& row : table.rows) {
    ImuSample s;
    s.stamp = fromSeconds(row.at(0)) + Time();
    s.linear_acceleration = vector3(row, 5);
    s.angular_velocity = vector3(row, 8);
    odometry.add(s);
  }
  Tracking out;
  bool started = false;
  Eigen::Quaterniond R_odom_vicon = Eigen::Quaterniond::Identity();
  for (const auto& row : table.rows) {
    // The gyro saturates at 420 deg/s: from there on nothing without a magnetometer can follow.
    if (vector3(row, 8).cwiseAbs().maxCoeff() > 7.3) break;
    const Eigen::Quaterniond vicon(row.at(1), row.at(2), row.at(3), row.at(4));
    if (std::abs(vicon.norm() - 1.0) > 0.01) continue;
    const auto state = odometry.predict(fromSeconds(row.at(0)) + Time());
    if (!state) continue;
    const Eigen::Quaterniond estimate(state->T_odom_base.linear());
    if (!started) {
      R_odom_vicon = estimate * vicon.conjugate();
      started = true;
    }
    const Eigen::Quaterniond error = estimate * (R_odom_vicon * vicon).conjugate();
    const double tilt = std::acos(std::min(1.0, (error * Eigen::Vector3d::UnitZ()).z())) / kDegree;
    const double angle = angleBetween(error, Eigen::Quaterniond::Identity()) / kDegree;
    out.tilt_rms_deg += tilt * tilt;
    out.tilt_max_deg = std::max(out.tilt_max_deg, tilt);
    out.angle_rms_deg += angle * angle;
    ++out.compared;
  }
  out.tilt_rms_deg = std::sqrt(out.tilt_rms_deg / std::max(1, out.compared));
  out.angle_rms_deg = std::sqrt(out.angle_rms_deg / std::max(1, out.compared));
  return out;
}

class RepoImu : public ::testing::TestWithParam<const char*> {};

TEST_P(RepoImu, AttitudeFollowsVicon) {
  const std::string path = dataFolder() + "/imu/" + GetParam();
  const Table table = readTable(path, ';', 2);
  if (table.rows.empty()) GTEST_SKIP() << "no recording at " << path;
  const Tracking result = track(table);
  std::cout << GetParam() << ": tilt rms " << result.tilt_rms_deg << " max " << result.tilt_max_deg
            << ", all axes rms " << result.angle_rms_deg << " deg, " << result.compared
            << " samples\n";
  ASSERT_GT(result.compared, 300);
  EXPECT_LT(result.tilt_rms_deg, 4.0);
  EXPECT_LT(result.angle_rms_deg, 8.0);
}

INSTANTIATE_TEST_SUITE_P(RealData, RepoImu,
                         ::testing::Values("TStick_Test02_Trial1.csv", "TStick_Test05_Trial1.csv",
                                           "TStick_Test08_Trial1.csv", "TStick_Test10_Trial1.csv"));

TEST(RealDataRepoImuStatic, StandsStillForThreeMinutes) {
  const std::string path = dataFolder() + "/imu/TStick_Test01_Static.csv";
  const Table table = readTable(path, ';', 2);
  if (table.rows.empty()) GTEST_SKIP() << "no recording at " << path;
  InertialOptions options;
  options.history_s = 1000.0;
  InertialOdometry odometry(options);
  for (const auto& row : table.rows) {
    ImuSample s;
    s.stamp = fromSeconds(row.at(0)) + Time();
    s.linear_acceleration = vector3(row, 5);
    s.angular_velocity = vector3(row, 8);
    odometry.add(s);
  }
  const InertialStatistics& statistics = odometry.statistics();
  EXPECT_GT(statistics.stationary_s, 0.95 * statistics.duration_s);
  const auto attitude = [&](double t) { return attitudeAt(odometry, Time() + fromSeconds(t)); };
  std::cout << "drift over 5 s: " << angleBetween(attitude(10), attitude(15)) / kDegree
            << " deg, over 150 s: " << angleBetween(attitude(10), attitude(160)) / kDegree
            << " deg\n";
  EXPECT_LT(angleBetween(attitude(10), attitude(15)), 0.2 * kDegree);
  EXPECT_LT(angleBetween(attitude(10), attitude(160)), 3.0 * kDegree);
}

}  // namespace
}  // namespace scanner::inertial
