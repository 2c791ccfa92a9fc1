#include "scanner/core/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "scanner/core/se3.h"
#include "support/temporary_folder.h"

namespace scanner {
namespace {

StereoCalibration goodPair() {
  StereoCalibration c;
  for (CameraModel* camera : {&c.left, &c.right}) {
    camera->width = 640;
    camera->height = 480;
    camera->K << 500, 0, 320, 0, 500, 240, 0, 0, 1;
    camera->P << 500, 0, 320, 0, 0, 500, 240, 0, 0, 0, 1, 0;
  }
  c.right.P(0, 3) = -60.0;
  return c;
}

TEST(StereoCalibration, DerivedQuantities) {
  StereoCalibration c = goodPair();
  c.right.P(0, 2) = 310.0;
  EXPECT_DOUBLE_EQ(c.baseline(), 0.12);
  EXPECT_DOUBLE_EQ(c.focalLength(), 500.0);
  EXPECT_DOUBLE_EQ(c.disparityOffset(), 10.0);
}

TEST(Validate, AcceptsAGoodPair) { EXPECT_TRUE(validate(goodPair())); }

TEST(Validate, NamesWhatIsWrong) {
  const auto message = [](void (*spoil)(StereoCalibration&)) {
    StereoCalibration c = goodPair();
    spoil(c);
    return validate(c).message();
  };
  const auto expect = [](const std::string& text, const char* part) {
    EXPECT_NE(text.find(part), std::string::npos) << "'" << text << "' lacks '" << part << "'";
  };
  expect(message([](StereoCalibration& c) { c.right.P(0, 3) = 0.0; }), "P[3] = 0");
  expect(message([](StereoCalibration& c) { c.right.P(0, 3) = 60.0; }), "P[3] = 60");
  expect(message([](StereoCalibration& c) { c.left.width = 0; }), "left camera: size is 0x480");
  expect(message([](StereoCalibration& c) { c.right.height = 479; }), "differ in size");
  expect(message([](StereoCalibration& c) { c.right.P(0, 0) = 510; }), "P[0] differ");
  expect(message([](StereoCalibration& c) { c.left.K(0, 0) = 0; }), "K[0]");
  expect(message([](StereoCalibration& c) { c.left.K(0, 2) = std::nan(""); }), "NaN");
  expect(message([](StereoCalibration& c) { c.right.D = {std::nan("")}; }), "D holds a NaN");
  expect(message([](StereoCalibration& c) { c.left.R *= 1.1; }), "not a rotation");
}

TEST(Rig, RectifiedPoseUndoesTheRectifyingRotation) {
  StereoCalibration c = goodPair();
  c.left.R = expSo3({0.0, 0.02, 0.0}).toRotationMatrix();
  Rig rig;
  rig.T_base_camera = makePose({0.1, 0.2, 0.3}, expSo3({1.0, 0.0, 0.0}));
  const Eigen::Isometry3d T = rig.rectifiedCameraPose(c);
  // A ray of the raw camera and the same ray after rectification meet in base_link.
  const Eigen::Vector3d raw(0.1, -0.2, 1.0);
  EXPECT_TRUE((T * (c.left.R * raw)).isApprox(rig.T_base_camera * raw, 1e-12));
}

TEST(LoadRig, ReadsAndRefuses) {
  const test::TemporaryFolder folder;
  const std::string pose =
      "T_base_link_bumblebee_left_optical:\n  translation: [0.1, 0, 0]\n"
      "  rotation_xyzw: [0, 0, 0, 1]\n";
  std::ofstream(folder / "good.yaml") << pose;
  EXPECT_DOUBLE_EQ(loadRig(folder / "good.yaml").T_base_camera.translation().x(), 0.1);
  EXPECT_FALSE(loadRig(folder / "good.yaml").cameras.has_value());
  std::ofstream(folder / "bad.yaml")
      << "T_base_link_bumblebee_left_optical:\n  translation: [0.1, 0]\n";
  std::ofstream(folder / "quaternion.yaml")
      << "T_base_link_bumblebee_left_optical:\n  translation: [0.1, 0, 0]\n"
         "  rotation_xyzw: [0, 0, 0, 2]\n";
  std::ofstream(folder / "other.yaml") << "a: 1\n";
  for (const char* name : {"bad.yaml", "quaternion.yaml", "other.yaml", "absent.yaml"}) {
    EXPECT_THROW(loadRig(folder / name), ConfigurationError) << name;
  }
}

}  // namespace
}  // namespace scanner
