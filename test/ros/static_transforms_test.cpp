#include "scanner/ros/static_transforms.h"

#include <gtest/gtest.h>

#include "scanner/core/se3.h"

namespace scanner::bridge {
namespace {

Eigen::Isometry3d pose(double x, double angle) {
  return makePose({x, 0.0, 0.0},
                  Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ())));
}

TEST(StaticTransforms, ChainsInBothDirections) {
  StaticTransforms tree;
  tree.add("/base", "mount", pose(1.0, 0.5));
  tree.add("mount", "camera", pose(2.0, -0.2));
  tree.add("base", "other", pose(5.0, 1.0));
  const Eigen::Isometry3d T_base_camera = pose(1.0, 0.5) * pose(2.0, -0.2);
  EXPECT_TRUE(tree.lookup("base", "camera")->isApprox(T_base_camera));
  EXPECT_TRUE(tree.lookup("camera", "/base")->isApprox(T_base_camera.inverse()));
  EXPECT_TRUE(tree.lookup("other", "camera")->isApprox(pose(5.0, 1.0).inverse() * T_base_camera));
  EXPECT_TRUE(tree.lookup("base", "base")->isApprox(Eigen::Isometry3d::Identity()));
}

TEST(StaticTransforms, NamesBothFramesWhenTheyAreNotConnected) {
  StaticTransforms tree;
  tree.add("base", "mount", pose(1.0, 0.0));
  tree.add("island", "camera", pose(1.0, 0.0));
  const auto missing = tree.lookup("base", "camera");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.status().code(), StatusCode::kNotEnoughData);
  EXPECT_NE(missing.status().message().find("'base' and 'camera'"), std::string::npos);
}

}  // namespace
}  // namespace scanner::bridge
