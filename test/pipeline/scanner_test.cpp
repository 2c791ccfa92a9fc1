#include "scanner/pipeline/scanner.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "scanner/evaluation/summary.h"
#include "support/synthetic_rig.h"
#include "support/temporary_folder.h"

namespace scanner::pipeline {
namespace {

constexpr double kImuStep = 0.01;
constexpr double kFrameStep = 0.5;
constexpr int kFrames = 8;

ScannerConfig smallConfig() {
  ScannerConfig config = loadConfig(SCANNER_SOURCE_DIR "/config/field.yaml");
  config.stereo.matcher.min_disparity_px = 40;
  config.stereo.matcher.max_disparity_px = 104;
  config.stereo.matcher.validation.surface_size_px = 60;
  config.stereo.conditioning.remove_ground = false;
  config.stereo.conditioning.min_points = 300;
  return config;
}

using SpoilFrame = void (*)(int index, StereoFrame& frame);

/// Feeds the synthetic orbit; `spoil` may damage frames on the way.
void feed(Scanner& scanner, const test::SyntheticRig& rig, SpoilFrame spoil = nullptr) {
  double imu_time = -1.5;
  for (int i = 0; i < kFrames; ++i) {
    const double t = i * kFrameStep;
    for (; imu_time < t + kImuStep; imu_time += kImuStep) scanner.addImu(rig.imu(imu_time));
    StereoFrame frame = rig.frame(t);
    if (spoil != nullptr) spoil(i, frame);
    ASSERT_TRUE(scanner.addFrame(frame));
  }
}

Trajectory truthOf(const test::SyntheticRig& rig) {
  Trajectory truth;
  for (double t = -1.0; t < kFrames * kFrameStep; t += 0.05) {
    truth.push_back({test::SyntheticRig::stamp(t), rig.pose(t)});
  }
  return truth;
}

std::string contents(const std::string& path) {
  std::ostringstream out;
  out << std::ifstream(path, std::ios::binary).rdbuf();
  return out.str();
}

TEST(Scanner, ScansTheSyntheticOrbit) {
  const test::SyntheticRig rig;
  const test::TemporaryFolder place;
  ScanFolder folder(place / "scan");
  Scanner scanner(smallConfig(), rig.rig(), rig.calibration(), 2, &folder);
  feed(scanner, rig);
  const auto report = scanner.finish(truthOf(rig));
  ASSERT_TRUE(report) << report.status().message();
  for (const FrameOutcome& frame : scanner.frames()) {
    EXPECT_TRUE(frame.registered) << frame.index << ": " << frame.reason;
  }
  const auto json = nlohmann::json::parse(contents(place / "scan/report.json"));
  EXPECT_EQ(json["views"]["total"], kFrames);
  EXPECT_EQ(json["views"]["registered"], kFrames);
  // Depth noise is 1-2 mm at this size of picture; poses average it.
  EXPECT_LT(json["truth"]["position_rmse_m"].get<double>(), 0.010);
  EXPECT_LT(json["truth"]["rotation_rmse_deg"].get<double>(), 1.0);
  EXPECT_FALSE(json["tables"]["group_prior_relative"].empty());
  const std::string page = contents(place / "scan/report.html");
  EXPECT_NE(page.find("All 8 views were registered"), std::string::npos);
  EXPECT_NE(page.find("view 000 left disparity"), std::string::npos);

  ASSERT_TRUE(scanner.model().has_value());
  std::vector<double> distances;
  // The first pose is given by the inertial sensor's orientation at an arbitrary place.
  const Eigen::Isometry3d T_truth_map =
      rig.pose(0.0) * scanner.trajectory().front().T_map_base.inverse();
  for (const Eigen::Vector3f& p : scanner.model()->vertices.points) {
    distances.push_back(
        std::abs(test::SyntheticRig::surfaceDistance(T_truth_map * p.cast<double>())));
  }
  ASSERT_GT(distances.size(), 1000U);
  std::nth_element(distances.begin(),
                   distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2),
                   distances.end());
  EXPECT_LT(distances[distances.size() / 2], 0.003);
}

TEST(Scanner, TablesOfSamplingHaveTheShapeOfThePublishedOnes) {
  const test::SyntheticRig rig;
  Scanner scanner(smallConfig(), rig.rig(), rig.calibration(), 2, nullptr);
  feed(scanner, rig);
  const auto report = scanner.finish(std::nullopt);
  ASSERT_TRUE(report);
  ASSERT_EQ(report->sampling.size(), 5U);
  double points = 0.0;
  for (const evaluation::ReportView& view : report->views) {
    points += static_cast<double>(view.points) / kFrames;
  }
  for (std::size_t i = 1; i < report->sampling.size(); ++i) {
    const evaluation::ReportSampling &fine = report->sampling[i - 1], &row = report->sampling[i];
    EXPECT_LT(row.buckets, fine.buckets);
    EXPECT_LE(row.empty / row.buckets, fine.empty / fine.buckets);
    EXPECT_GT(row.per_bucket, fine.per_bucket);
    EXPECT_LE((row.buckets - row.empty) * row.per_bucket, 1.1 * points);
  }
  EXPECT_EQ(report->sampling[1].buckets, 1296.0);  // as in table 4.2
  ASSERT_EQ(report->compatible.size(), 5U);
  for (std::size_t i = 1; i < report->compatible.size(); ++i) {
    EXPECT_GE(report->compatible[i].share, report->compatible[i - 1].share);
    EXPECT_LE(report->compatible[i].share, 1.0);
  }
}

TEST(ReportBuilder, AddsAModelToTheReportOfAnotherNode) {
  const test::TemporaryFolder place;
  ScanFolder folder(place / "scan");
  const surface::MeshStatistics model{10, 20, 1, 0, 0, 0.002};
  EXPECT_TRUE(addModelToReport(folder, model, 2.0));  // nothing there to add to
  EXPECT_EQ(contents(place / "scan/report.json"), "");

  evaluation::ScanReport report;
  report.time_s = {1.0, 1.0, 1.0, 1.0, evaluation::kUnknown, evaluation::kUnknown};
  ASSERT_TRUE(folder.writeText("report.json", evaluation::toJson(report)));
  ASSERT_TRUE(addModelToReport(folder, model, 2.0));
  const auto json = nlohmann::json::parse(contents(place / "scan/report.json"));
  EXPECT_EQ(json["model"]["faces"], 20);
  EXPECT_EQ(json["time_s"]["surface"], 2.0);
  EXPECT_EQ(json["time_s"]["total"], 6.0);
  EXPECT_NE(contents(place / "scan/report.html").find("20 triangles"), std::string::npos);

  ASSERT_TRUE(folder.writeText("report.json", "{"));
  const Status broken = addModelToReport(folder, model, 2.0);
  EXPECT_NE(broken.message().find("report.json"), std::string::npos);
}

TEST(Scanner, SameBytesForEveryThreadCount) {
  const test::SyntheticRig rig;
  const test::TemporaryFolder place;
  for (const int threads : {1, 2}) {
    ScanFolder folder(place / std::to_string(threads));
    Scanner scanner(smallConfig(), rig.rig(), rig.calibration(), threads, &folder);
    feed(scanner, rig);
    ASSERT_TRUE(scanner.finish(std::nullopt));
  }
  for (const char* name : {"model.ply", "cloud.ply", "trajectory.tum", "groups/group_000.ply"}) {
    const std::string one = contents(place / "1" + std::string("/") + name);
    EXPECT_FALSE(one.empty()) << name;
    EXPECT_EQ(one, contents(place / "2" + std::string("/") + name)) << name;
  }
}

TEST(Scanner, BadFramesAreDiscardedWithAReasonAndTheRestGoesOn) {
  const test::SyntheticRig rig;
  Scanner scanner(smallConfig(), rig.rig(), rig.calibration(), 2, nullptr);
  feed(scanner, rig, [](int index, StereoFrame& frame) {
    if (index == 3) frame.left.data = cv::Mat::zeros(frame.left.data.size(), CV_8UC1);
    if (index == 5) frame.right.data = cv::Mat::zeros(10, 10, CV_8UC1);
  });
  const auto report = scanner.finish(std::nullopt);
  ASSERT_TRUE(report) << report.status().message();
  ASSERT_EQ(scanner.frames().size(), static_cast<std::size_t>(kFrames));
  for (const FrameOutcome& frame : scanner.frames()) {
    const bool spoiled = frame.index == 3 || frame.index == 5;
    EXPECT_EQ(frame.registered, !spoiled) << frame.index << ": " << frame.reason;
    EXPECT_EQ(frame.reason.empty(), !spoiled) << frame.index;
  }
  EXPECT_EQ(evaluation::registeredViews(*report), static_cast<std::size_t>(kFrames - 2));
}

TEST(Scanner, WithoutInertialSamplesEveryFrameSaysSo) {
  const test::SyntheticRig rig;
  Scanner scanner(smallConfig(), rig.rig(), rig.calibration(), 1, nullptr);
  ASSERT_TRUE(scanner.addFrame(rig.frame(0.0)));
  const auto report = scanner.finish(std::nullopt);
  ASSERT_TRUE(report);
  ASSERT_EQ(scanner.frames().size(), 1U);
  EXPECT_NE(scanner.frames()[0].reason.find("no inertial prior"), std::string::npos);
  EXPECT_FALSE(scanner.model().has_value());
}

TEST(Scanner, AnInertialGapCostsNoViewThatTheImagesCanPlace) {
  const test::SyntheticRig rig;
  Scanner scanner(smallConfig(), rig.rig(), rig.calibration(), 2, nullptr);
  double imu_time = -1.5;
  for (int i = 0; i < kFrames; ++i) {
    const double t = i * kFrameStep;
    for (; imu_time < t + kImuStep; imu_time += kImuStep) {
      const bool gap = imu_time > 1.6 && imu_time < 1.9;  // between two frames
      if (!gap) scanner.addImu(rig.imu(imu_time));
    }
    ASSERT_TRUE(scanner.addFrame(rig.frame(t)));
  }
  ASSERT_TRUE(scanner.finish(std::nullopt));
  for (const FrameOutcome& frame : scanner.frames()) {
    EXPECT_TRUE(frame.registered) << frame.index << ": " << frame.reason;
  }
}

TEST(Scanner, RefusesACalibrationThatCannotGiveDepth) {
  const test::SyntheticRig rig;
  StereoCalibration broken = rig.calibration();
  broken.right.P(0, 3) = 0.0;
  EXPECT_THROW(Scanner(smallConfig(), rig.rig(), broken, 1, nullptr), ConfigurationError);
}

}  // namespace
}  // namespace scanner::pipeline
