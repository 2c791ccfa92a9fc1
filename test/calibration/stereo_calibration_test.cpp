#include "scanner/calibration/stereo_calibration.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>

#include "calibration/boards.h"
#include "scanner/calibration/calibration_files.h"

namespace scanner::calibration {
namespace {

using boards::TrueRig;

constexpr double kDegrees = 180.0 / CV_PI;

StereoCalibrationReport calibrated(const std::vector<BoardObservation>& views, const TrueRig& rig,
                                   const StereoCalibrationOptions& options = {},
                                   const Board& board = boards::usualBoard()) {
  auto report = calibrateStereo(views, board, rig.size, options, 2);
  if (!report) throw std::runtime_error(report.status().message());
  return std::move(report).value();
}

std::map<std::string, double> truthOf(const TrueRig& rig) {
  std::map<std::string, double> truth;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    const std::string side = eye == 0 ? "left " : "right ";
    truth[side + "fx"] = rig.K[eye].at<double>(0, 0);
    truth[side + "fy"] = rig.K[eye].at<double>(1, 1);
    truth[side + "cx"] = rig.K[eye].at<double>(0, 2);
    truth[side + "cy"] = rig.K[eye].at<double>(1, 2);
    truth[side + "k1"] = rig.D[eye].at<double>(0);
    truth[side + "k2"] = rig.D[eye].at<double>(1);
  }
  truth["baseline"] = 1e3 * rig.baseline();
  truth["rotation x"] = kDegrees * rig.rotation.at<double>(0);
  truth["rotation y"] = kDegrees * rig.rotation.at<double>(1);
  truth["rotation z"] = kDegrees * rig.rotation.at<double>(2);
  return truth;
}

TEST(CalibrateStereo, ExactCornersGiveTheExactRig) {
  const TrueRig rig = boards::usualRig();
  const auto report = calibrated(boards::chanceViews(rig, boards::usualBoard(), 10, 0.0, 1), rig);
  EXPECT_EQ(report.distortion, Distortion::kK1K2);
  // Corners are stored as floats: 3e-5 px.
  EXPECT_LT(report.rms_px, 1e-4);
  EXPECT_LT(report.epipolar.max_px, 1e-3);
  for (const auto& [name, value] : truthOf(rig)) {
    EXPECT_NEAR(report.parameter(name).value, value, 1e-3) << name;
  }
  EXPECT_NEAR(report.T_right_left.translation().x(), rig.translation.at<double>(0), 1e-6);
  EXPECT_EQ(report.usedViews(), 10U);
  EXPECT_THROW(report.parameter("left k3"), std::out_of_range);
}

TEST(CalibrateStereo, MinimumIsThatOfOpenCv) {
  const TrueRig rig = boards::usualRig();
  const Board board = boards::usualBoard();
  const auto views = boards::chanceViews(rig, board, 8, 0.2, 2);
  StereoCalibrationOptions options;
  options.distortion = Distortion::kK1K2P1P2K3;
  const auto report = calibrated(views, rig, options);
  std::vector<std::vector<cv::Point2f>> left, right;
  for (const BoardObservation& view : views) {
    left.push_back(view.left);
    right.push_back(view.right);
  }
  const auto points = boards::corners(board);
  const std::vector<std::vector<cv::Point3f>> object(8, {points.begin(), points.end()});
  std::array<cv::Mat, 2> K = {rig.K[0].clone(), rig.K[1].clone()};
  std::array<cv::Mat, 2> D = {rig.D[0].clone(), rig.D[1].clone()};
  cv::Mat R, t, E, F;
  const double rms = cv::stereoCalibrate(
      object, left, right, K[0], D[0], K[1], D[1], rig.size, R, t, E, F,
      cv::CALIB_USE_INTRINSIC_GUESS,
      cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 200, 1e-12));
  EXPECT_NEAR(report.rms_px, rms, 1e-6);
  EXPECT_NEAR(report.calibration.left.K(0, 0), K[0].at<double>(0, 0), 1e-2);
  EXPECT_NEAR(report.calibration.right.K(1, 2), K[1].at<double>(1, 2), 1e-2);
  EXPECT_NEAR(report.calibration.right.D[4], D[1].at<double>(4), 1e-3);
  EXPECT_NEAR(report.calibration.baseline(), cv::norm(t), 1e-6);
}

TEST(CalibrateStereo, TruthLiesWithinTheStatedUncertainty) {
  const TrueRig rig = boards::usualRig();
  StereoCalibrationOptions options;
  options.distortion = Distortion::kK1K2;
  double squares = 0.0;
  int count = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const auto views = boards::chanceViews(rig, boards::usualBoard(), 12, 0.1, seed);
    const auto report = calibrated(views, rig, options);
    for (const auto& [name, value] : truthOf(rig)) {
      const Parameter& p = report.parameter(name);
      ASSERT_GT(p.sigma, 0.0) << name;
      const double sigmas = (p.value - value) / p.sigma;
      EXPECT_LT(std::abs(sigmas), 5.0) << name << ", seed " << seed;
      squares += sigmas * sigmas;
      ++count;
    }
  }
  // 1 if the sigmas were perfect; too small ones (the dangerous side) make it larger.
  const double spread = std::sqrt(squares / count);
  EXPECT_GT(spread, 0.4);
  EXPECT_LT(spread, 1.6);
}

TEST(CalibrateStereo, ResidualsAreTheNoiseOfTheCorners) {
  const TrueRig rig = boards::usualRig();
  const double sigma = 0.15;
  const auto views = boards::chanceViews(rig, boards::usualBoard(), 12, sigma, 3);
  const auto report = calibrated(views, rig);
  // Two coordinates; the fit takes a little of the noise.
  EXPECT_NEAR(report.rms_px, sigma * std::sqrt(2.0), 0.1 * sigma);
  EXPECT_GT(report.held_out_px, report.rms_px);
  EXPECT_LT(report.held_out_px, 1.2 * report.rms_px);
  // The difference of two eyes' noise: mean |.| of a normal variable with sqrt(2) sigma.
  EXPECT_NEAR(report.epipolar.mean_px, sigma * std::sqrt(2.0) * 0.798, 0.25 * sigma);
  EXPECT_LT(report.epipolar.mean_px, report.epipolar.p95_px);
  EXPECT_LE(report.epipolar.p95_px, report.epipolar.max_px);
  double squares = 0.0;
  for (const ViewReport& view : report.views) {
    ASSERT_TRUE(view.used);
    double left = 0.0, longest = 0.0;
    for (const cv::Point2f& r : view.left_residual) left += r.ddot(r);
    for (const auto* residuals : {&view.left_residual, &view.right_residual}) {
      ASSERT_EQ(residuals->size(), 54U);
      for (const cv::Point2f& r : *residuals) longest = std::max(longest, cv::norm(r));
    }
    EXPECT_NEAR(view.left_rms_px, std::sqrt(left / 54.0), 1e-6);
    EXPECT_NEAR(view.max_px, longest, 1e-6);
    squares += 0.5 * (std::pow(view.left_rms_px, 2) + std::pow(view.right_rms_px, 2));
  }
  EXPECT_NEAR(report.rms_px, std::sqrt(squares / 12.0), 1e-9);
}

TEST(CalibrateStereo, CalibrationRectifiesThePair) {
  const TrueRig rig = boards::usualRig();
  const auto report = calibrated(boards::chanceViews(rig, boards::usualBoard(), 12, 0.05, 4), rig);
  const StereoCalibration& c = report.calibration;
  EXPECT_TRUE(validate(c)) << validate(c).message();
  EXPECT_LT(c.right.P(0, 3), 0.0);
  EXPECT_NEAR(c.baseline(), rig.baseline(), 1e-4);
  EXPECT_NEAR(c.focalLength(), c.left.K(0, 0), 0.15 * c.left.K(0, 0));
  EXPECT_GE(report.left_kept_share, 0.95);
  EXPECT_GE(report.right_kept_share, 0.95);
  // A point of space, through the true lenses and back: in one row, at its depth.
  const std::vector<cv::Point3d> point = {{0.1, -0.15, 1.3}};
  std::array<cv::Point2d, 2> at;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    const cv::Mat zero = cv::Mat::zeros(3, 1, CV_64F);
    const CameraModel& camera = eye == 0 ? c.left : c.right;
    std::vector<cv::Point2d> pixel, rectified;
    cv::projectPoints(point, eye == 0 ? zero : rig.rotation, eye == 0 ? zero : rig.translation,
                      rig.K[eye], rig.D[eye], pixel);
    cv::Mat K, R, P;
    cv::eigen2cv(camera.K, K);
    cv::eigen2cv(camera.R, R);
    cv::eigen2cv(camera.P, P);
    cv::undistortPoints(pixel, rectified, K, camera.D, R, P,
                        cv::TermCriteria(cv::TermCriteria::COUNT, 50, 0.0));
    at[eye] = rectified[0];
  }
  EXPECT_NEAR(at[0].y, at[1].y, 0.05);
  const double depth = c.focalLength() * c.baseline() / (at[0].x - at[1].x - c.disparityOffset());
  const Eigen::Vector3d there = c.left.R * Eigen::Vector3d(point[0].x, point[0].y, point[0].z);
  EXPECT_NEAR(depth, there.z(), 0.005 * there.z());
}

TEST(CalibrateStereo, ViewThatMovedBetweenTheEyesIsLeftOutAndNamed) {
  const TrueRig rig = boards::usualRig();
  const Board board = boards::usualBoard();
  auto views = boards::chanceViews(rig, board, 11, 0.08, 5);
  const auto clean = calibrated(views, rig);
  auto pose = boards::chancePoses(rig, board, 11, {}, 5)[6];
  pose.translation += cv::Vec3d(0.001, 0.004, 0.0);
  views[6].right = boards::project(rig, 1, board, pose);
  const auto report = calibrated(views, rig);
  EXPECT_EQ(report.usedViews(), 10U);
  for (const ViewReport& view : report.views) {
    EXPECT_EQ(view.used, view.name != "view7") << view.name << ": " << view.note;
  }
  EXPECT_NE(report.views[6].note.find("left out"), std::string::npos) << report.views[6].note;
  EXPECT_GT(report.views[6].left_rms_px + report.views[6].right_rms_px, 1.0);
  ASSERT_FALSE(report.warnings.empty());
  EXPECT_NE(report.warnings[0].find("1 view(s) left out"), std::string::npos);
  EXPECT_LT(report.rms_px, 1.1 * clean.rms_px);
  EXPECT_NEAR(report.calibration.baseline(), rig.baseline(), 3e-4);
}

TEST(CalibrateStereo, StretchedPrintIsNoticedAndCorrected) {
  const TrueRig rig = boards::usualRig();
  Board printed = boards::usualBoard();
  printed.square_height_m = 1.01 * printed.square_m;
  const auto views = boards::chanceViews(rig, printed, 12, 0.05, 6);
  const auto stretched = [](const StereoCalibrationReport& report) {
    return std::count_if(report.warnings.begin(), report.warnings.end(), [](const auto& w) {
      return w.find("--square-height") != std::string::npos;
    });
  };
  EXPECT_EQ(stretched(calibrated(views, rig)), 1);
  const auto corrected = calibrated(views, rig, {}, printed);
  EXPECT_EQ(stretched(corrected), 0);
  EXPECT_NEAR(corrected.parameter("baseline").value, 1e3 * rig.baseline(), 0.2);
}

TEST(CalibrateStereo, VergingEyesAreRectifiedWithinTheLimitOfTheFocalLength) {
  TrueRig rig = boards::usualRig();
  rig.rotation.at<double>(1) = 0.14;  // 8 deg towards each other
  const auto report = calibrated(boards::chanceViews(rig, boards::usualBoard(), 10, 0.05, 7), rig);
  EXPECT_TRUE(validate(report.calibration));
  EXPECT_NEAR(report.parameter("rotation y").value, kDegrees * 0.14, 0.1);
  const double change = report.calibration.focalLength() / report.calibration.left.K(0, 0) - 1.0;
  EXPECT_GT(change, -0.16);
}

TEST(CalibrateStereo, SameReportOnAnyNumberOfThreads) {
  const TrueRig rig = boards::usualRig();
  const auto views = boards::chanceViews(rig, boards::usualBoard(), 7, 0.1, 8);
  const auto one = calibrateStereo(views, boards::usualBoard(), rig.size, {}, 1);
  const auto five = calibrateStereo(views, boards::usualBoard(), rig.size, {}, 5);
  ASSERT_TRUE(one && five);
  EXPECT_EQ(reportJson(*one), reportJson(*five));
  EXPECT_EQ(reportText(*one), reportText(*five));
}

}  // namespace
}  // namespace scanner::calibration
