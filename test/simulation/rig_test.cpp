#include "scanner/simulation/rig.h"

#include <gtest/gtest.h>

#include "camera_fixtures.h"
#include "scanner/core/se3.h"
#include "scanner/simulation/random.h"

namespace scanner::simulation {
namespace {

/// Raw projections of the true cameras, rectified by OpenCV with the calibration.
std::vector<cv::Point2d> rectifiedProjections(const CameraModel& camera,
                                              const std::vector<cv::Point3d>& points) {
  std::vector<cv::Point2d> rectified;
  cv::undistortPoints(
      test::project(camera, points), rectified, test::toCv(camera.K), camera.D,
      test::toCv(camera.R), test::toCv(camera.P.leftCols<3>()),
      cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 100, 1e-12));
  return rectified;
}

TEST(SimulatedRigTest, CalibrationMatchesTheTrueCameras) {
  for (const int seed : {1, 2, 3}) {
    const SimulatedRig rig = makeRig(RigOptions(), seed);
    ASSERT_TRUE(validate(rig.calibration)) << validate(rig.calibration).message();
    Random random(9);
    std::vector<cv::Point3d> left, right;
    for (int i = 0; i < 200; ++i) {
      const double z = random.uniform(0.4, 1.3);
      const Eigen::Vector3d p(random.uniform(-0.4, 0.4) * z, random.uniform(-0.3, 0.3) * z, z);
      const Eigen::Vector3d q = rig.T_left_right.inverse() * p;
      left.emplace_back(p.x(), p.y(), p.z());
      right.emplace_back(q.x(), q.y(), q.z());
    }
    const auto l = rectifiedProjections(rig.calibration.left, left);
    const auto r = rectifiedProjections(rig.calibration.right, right);
    for (std::size_t i = 0; i < l.size(); ++i) {
      EXPECT_NEAR(l[i].y, r[i].y, 1e-3);
      const double exact = rig.calibration.focalLength() * rig.calibration.baseline() / left[i].z;
      EXPECT_NEAR(l[i].x - r[i].x, exact, 1e-3);
    }
  }
}

TEST(SimulatedRigTest, IsThePublishedRig) {
  const SimulatedRig rig = makeRig(RigOptions(), 1);
  EXPECT_NEAR(rig.calibration.focalLength(), 1098.0, 1e-9);
  EXPECT_NEAR(rig.calibration.baseline(), 0.12, 1e-12);
  EXPECT_TRUE(rig.calibration.left.R.isIdentity());
  // Thesis eq. 5.1: the optical axis is the sensor's x axis to within some degrees.
  EXPECT_NEAR(rig.T_base_camera.linear()(0, 2), 0.9986, 1e-3);
  EXPECT_NEAR(rig.T_base_camera.linear().determinant(), 1.0, 1e-12);
}

TEST(SimulatedRigTest, EffectsCanBeSwitchedOff) {
  RigOptions ideal;
  ideal.distortion = false;
  ideal.misalignment = false;
  const SimulatedRig rig = makeRig(ideal, 4);
  EXPECT_TRUE(rig.T_left_right.linear().isIdentity());
  EXPECT_TRUE(rig.calibration.left.K.isApprox(rig.calibration.left.P.leftCols<3>()));
  EXPECT_EQ(rig.calibration.right.D, std::vector<double>(5, 0.0));
  const SimulatedRig real = makeRig(RigOptions(), 4);
  EXPECT_GT(rotationAngle(real.T_left_right), 1e-4);
  EXPECT_NE(real.calibration.left.D, real.calibration.right.D);
}

TEST(SimulatedRigTest, RawPicturesCoverTheRectifiedOnes) {
  for (const int seed : {1, 2, 3, 4, 5, 6}) {
    const StereoCalibration c = makeRig(RigOptions(), seed).calibration;
    for (const CameraModel& camera : {c.left, c.right}) {
      const cv::Size size(camera.width, camera.height);
      cv::Mat x, y;
      cv::initUndistortRectifyMap(test::toCv(camera.K), camera.D, test::toCv(camera.R),
                                  test::toCv(camera.P.leftCols<3>()), size, CV_32FC1, x, y);
      const cv::Mat inside = (x > -0.5F) & (x < static_cast<float>(size.width) - 0.5F) &
                             (y > -0.5F) & (y < static_cast<float>(size.height) - 0.5F);
      EXPECT_GT(cv::countNonZero(inside), 0.98 * static_cast<double>(size.area())) << seed;
    }
  }
}

TEST(SimulatedRigTest, ResolutionScalesTheLens) {
  RigOptions small;
  small.width_px = 640;
  small.height_px = 480;
  EXPECT_NEAR(makeRig(small, 1).calibration.focalLength(), 1098.0 * 640 / 1024, 1e-9);
}

}  // namespace
}  // namespace scanner::simulation
