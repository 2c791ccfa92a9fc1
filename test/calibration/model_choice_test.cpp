#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>

#include "calibration/boards.h"
#include "scanner/calibration/stereo_calibration.h"

/// The simplest distortion model that the pictures support, and no more.
namespace scanner::calibration {
namespace {

using boards::TrueRig;

StereoCalibrationReport calibrated(const std::vector<BoardObservation>& views, const TrueRig& rig,
                                   Distortion distortion = Distortion::kAutomatic) {
  StereoCalibrationOptions options;
  options.distortion = distortion;
  auto report = calibrateStereo(views, boards::usualBoard(), rig.size, options, 2);
  if (!report) throw std::runtime_error(report.status().message());
  return std::move(report).value();
}

TrueRig rigWith(const cv::Mat& distortion) {
  TrueRig rig = boards::usualRig();
  rig.D = {distortion.clone(), distortion.clone()};
  return rig;
}

/// Largest error of the rays of the left picture's corners relative to its middle's, px.
double cornerError(const StereoCalibrationReport& report, const TrueRig& rig) {
  const double w = rig.size.width - 1.0, h = rig.size.height - 1.0;
  const std::vector<cv::Point2d> pixels = {{0.5 * w, 0.5 * h}, {0, 0}, {w, 0}, {0, h}, {w, h}};
  const cv::TermCriteria stop(cv::TermCriteria::COUNT, 100, 0.0);
  std::vector<cv::Point2d> found, truth;
  cv::Mat K;
  cv::eigen2cv(report.calibration.left.K, K);
  cv::undistortPoints(pixels, found, K, report.calibration.left.D, cv::noArray(), cv::noArray(),
                      stop);
  cv::undistortPoints(pixels, truth, rig.K[0], rig.D[0], cv::noArray(), cv::noArray(), stop);
  double largest = 0.0;
  for (std::size_t i = 1; i < pixels.size(); ++i) {
    const cv::Point2d off = (found[i] - found[0]) - (truth[i] - truth[0]);
    largest = std::max(largest, K.at<double>(0, 0) * cv::norm(off));
  }
  return largest;
}

TEST(ModelChoice, WeakLensTakesOneCoefficient) {
  const TrueRig rig = rigWith((cv::Mat_<double>(1, 5) << -0.08, 0, 0, 0, 0));
  const auto report = calibrated(boards::chanceViews(rig, boards::usualBoard(), 12, 0.1, 1), rig);
  EXPECT_EQ(report.distortion, Distortion::kK1) << toString(report.distortion);
  EXPECT_EQ(report.models.size(), 5U);
  for (const ModelScore& m : report.models) EXPECT_FALSE(m.verdict.empty());
}

TEST(ModelChoice, UsualLensTakesTwo) {
  const TrueRig rig = boards::usualRig();
  const auto report = calibrated(boards::chanceViews(rig, boards::usualBoard(), 12, 0.1, 2), rig);
  EXPECT_EQ(report.distortion, Distortion::kK1K2) << toString(report.distortion);
  EXPECT_EQ(report.calibration.left.distortion_model, "plumb_bob");
  ASSERT_EQ(report.calibration.left.D.size(), 5U);
  EXPECT_EQ(report.calibration.left.D[2], 0.0);
  EXPECT_EQ(report.calibration.left.D[4], 0.0);
}

TEST(ModelChoice, DecentredLensTakesTangentialTerms) {
  const TrueRig rig = rigWith((cv::Mat_<double>(1, 5) << -0.35, 0.16, 0.004, -0.003, 0));
  const auto report = calibrated(boards::chanceViews(rig, boards::usualBoard(), 12, 0.1, 3), rig);
  EXPECT_EQ(report.distortion, Distortion::kK1K2P1P2) << toString(report.distortion);
  EXPECT_NEAR(report.calibration.left.D[2], 0.004, 0.001);
  EXPECT_NEAR(report.calibration.left.D[3], -0.003, 0.001);
}

TEST(ModelChoice, WideLensTakesTheRationalModel) {
  // Close to r = tan(theta) -> theta, which no short polynomial follows over this angle.
  TrueRig rig = rigWith((cv::Mat_<double>(1, 8) << 1.3, 0.2, 0, 0, 0.002, 1.63, 0.52, 0.022));
  rig.K = {boards::cameraMatrix(400, 400, 320, 240), boards::cameraMatrix(401, 401, 318, 242)};
  rig.translation *= 0.25;  // so that near boards reach every corner of both pictures
  boards::Spread near;
  near.nearest_m = 0.2;
  near.farthest_m = 0.4;
  near.share = 1.0;
  const auto views = boards::chanceViews(rig, boards::usualBoard(), 20, 0.02, 4, near);
  const auto report = calibrated(views, rig);
  EXPECT_EQ(report.distortion, Distortion::kRationalP1P2) << toString(report.distortion);
  EXPECT_EQ(report.calibration.left.distortion_model, "rational_polynomial");
  ASSERT_EQ(report.calibration.left.D.size(), 8U);
  EXPECT_EQ(report.calibration.left.D[7], 0.0);
  EXPECT_EQ(report.usedViews(), 20U);  // no view is blamed for the lens
  EXPECT_LT(report.rms_px, 0.032);
}

TEST(ModelChoice, BoardsInTheMiddleDoNotTemptIntoAFreeModel) {
  const TrueRig rig = boards::usualRig();
  boards::Spread middle;
  middle.nearest_m = 0.8;
  middle.farthest_m = 1.4;
  middle.share = 0.8;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const auto views = boards::chanceViews(rig, boards::usualBoard(), 9, 0.15, seed, middle);
    const auto report = calibrated(views, rig);
    EXPECT_LE(report.distortion, Distortion::kK1K2) << toString(report.distortion);
    const double f = report.calibration.left.K(0, 0);
    EXPECT_NEAR(report.calibration.focalLength(), f, 0.15 * f);
    // Told, and as large as told.
    const auto& chosen = *std::find_if(report.models.begin(), report.models.end(),
                                       [](const auto& m) { return m.verdict == "chosen"; });
    EXPECT_LT(cornerError(report, rig), 4.0 * chosen.corner_sigma_px);
    EXPECT_NE(report.warnings.end(),
              std::find_if(report.warnings.begin(), report.warnings.end(), [](const auto& w) {
                return w.find("extrapolated") != std::string::npos;
              }));
    std::cout << "corners off by " << cornerError(report, rig) << " px, told "
              << chosen.corner_sigma_px << " px\n";
  }
}

TEST(ModelChoice, ModelThatFoldsThePictureIsNeverTaken) {
  const TrueRig rig = boards::usualRig();
  const auto views = boards::chanceViews(rig, boards::usualBoard(), 8, 0.1, 5);
  StereoCalibrationOptions options;
  // One coefficient of such a lens, -0.3 r^2, turns back before the picture's corners.
  options.distortion = Distortion::kK1;
  const auto report = calibrateStereo(views, boards::usualBoard(), rig.size, options, 2);
  if (report) {
    EXPECT_GT(report->calibration.left.D[0], -0.27);
  } else {
    EXPECT_NE(report.status().message().find("turns back"), std::string::npos)
        << report.status().message();
  }
}

TEST(ModelChoice, ChosenByHandIsUsed) {
  const TrueRig rig = boards::usualRig();
  const auto views = boards::chanceViews(rig, boards::usualBoard(), 8, 0.1, 6);
  const auto report = calibrated(views, rig, Distortion::kK1K2P1P2);
  EXPECT_EQ(report.distortion, Distortion::kK1K2P1P2);
  EXPECT_EQ(report.models.size(), 1U);
  EXPECT_NE(report.calibration.left.D[2], 0.0);
}

}  // namespace
}  // namespace scanner::calibration
