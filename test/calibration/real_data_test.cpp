#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "scanner/calibration/calibration_files.h"

/// The chessboard pairs of a real Bumblebee2, with a calibration by another program beside them.
namespace scanner::calibration {
namespace {

namespace fs = std::filesystem;

const Board kBoard{4, 6, 0.03};

fs::path folder() {
  const char* given = std::getenv("SCANNER_DATA");
  const fs::path data =
      given != nullptr ? fs::path(given) : fs::path(SCANNER_SOURCE_DIR) / "../shared/data";
  return data / "bumblebee2" / "chessboard";
}

class RealDataCalibration : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(folder() / "left01.jpg")) GTEST_SKIP() << "no recording at " << folder();
    const PictureFolder pictures = findPicturePairs(folder().string());
    ASSERT_EQ(pictures.pairs.size(), 11U);
    auto found = detectBoards(pictures.pairs, kBoard, {}, 2, nullptr);
    ASSERT_TRUE(found) << found.status().message();
    boards_ = std::move(found).value();
  }
  Result<StereoCalibrationReport> calibrated(const StereoCalibrationOptions& options = {}) {
    return calibrateStereo(boards_.observations, kBoard, boards_.image_size, options, 2);
  }
  DetectedBoards boards_;
};

TEST_F(RealDataCalibration, FitsToATenthOfAPixelAndFindsTheBaseline) {
  ASSERT_EQ(boards_.observations.size(), 11U);
  const auto report = calibrated();
  ASSERT_TRUE(report) << report.status().message();
  std::cout << reportText(*report);
  EXPECT_LE(report->rms_px, 0.12);
  EXPECT_LE(report->held_out_px, 0.12);
  EXPECT_LE(report->epipolar.p95_px, 0.12);
  const double baseline_mm = 1e3 * report->calibration.baseline();
  EXPECT_NEAR(baseline_mm, 120.04, 0.3);
  EXPECT_NEAR(baseline_mm, 120.04, 4.0 * report->parameter("baseline").sigma);
  EXPECT_EQ(report->usedViews(), 11U);
  // The other program's.
  EXPECT_NEAR(report->parameter("left fx").value, 524.6, 3.0);
  EXPECT_NEAR(report->parameter("right fx").value, 526.4, 3.0);
}

TEST_F(RealDataCalibration, DistortionIsNotOverFitted) {
  const auto report = calibrated();
  ASSERT_TRUE(report) << report.status().message();
  EXPECT_EQ(report->distortion, Distortion::kK1K2);
  const StereoCalibration& c = report->calibration;
  EXPECT_TRUE(validate(c));
  for (const CameraModel* camera : {&c.left, &c.right}) {
    EXPECT_NEAR(camera->P(0, 0), camera->K(0, 0), 0.15 * camera->K(0, 0));
  }
  EXPECT_GE(report->left_kept_share, 0.95);
  EXPECT_GE(report->right_kept_share, 0.95);
  // The stone lantern of the pairs: its tip, eaves and foot in the raw left picture, by eye.
  cv::Mat K, R, P;
  cv::eigen2cv(c.left.K, K);
  cv::eigen2cv(c.left.R, R);
  cv::eigen2cv(c.left.P, P);
  const std::vector<cv::Point2d> lantern = {{346, 15}, {226, 116}, {485, 87}, {391, 390}};
  std::vector<cv::Point2d> rectified;
  cv::undistortPoints(lantern, rectified, K, c.left.D, R, P);
  for (const cv::Point2d& p : rectified) {
    EXPECT_TRUE(cv::Rect2d(0, 0, 640, 480).contains(p)) << p;
  }
}

TEST_F(RealDataCalibration, WrongPairingIsRefused) {
  auto& views = boards_.observations;
  views.resize(7);
  std::rotate(views.begin(), views.begin() + 1, views.end());
  const auto moved = views;
  std::rotate(views.begin(), views.begin() + 1, views.end());
  for (std::size_t i = 0; i < views.size(); ++i) views[i].right = moved[i].right;
  const auto report = calibrated();
  ASSERT_FALSE(report);
  std::cout << report.status().message() << "\n";
}

TEST_F(RealDataCalibration, FourViewsAreTooFew) {
  boards_.observations.resize(4);
  const auto report = calibrated();
  ASSERT_FALSE(report);
  EXPECT_EQ(report.status().code(), StatusCode::kNotEnoughData);
}

}  // namespace
}  // namespace scanner::calibration
