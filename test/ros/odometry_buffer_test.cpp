#include "scanner/ros/odometry_buffer.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scanner/core/se3.h"

namespace scanner::bridge {
namespace {

inertial::OdometryState state(double seconds, double x) {
  inertial::OdometryState s;
  s.stamp = Time() + fromSeconds(seconds);
  s.T_odom_base = makePose({x, 0.0, 0.0}, Eigen::Quaterniond::Identity());
  s.velocity = {x, 0.0, 0.0};
  return s;
}

TEST(OdometryBuffer, InterpolatesAndTellsLaterFromNever) {
  OdometryBuffer buffer(fromSeconds(0.1));
  EXPECT_EQ(buffer.at(Time()).status().code(), StatusCode::kNotEnoughData);
  EXPECT_TRUE(buffer.add(state(1.00, 1.0)));
  EXPECT_TRUE(buffer.add(state(1.02, 2.0)));
  EXPECT_FALSE(buffer.add(state(1.02, 9.0)));
  EXPECT_FALSE(buffer.add(state(0.50, 9.0)));
  const auto middle = buffer.at(Time() + fromSeconds(1.005));
  ASSERT_TRUE(middle);
  EXPECT_NEAR(middle->T_odom_base.translation().x(), 1.25, 1e-12);
  EXPECT_NEAR(middle->velocity.x(), 1.25, 1e-12);
  EXPECT_EQ(middle->stamp, Time() + fromSeconds(1.005));
  EXPECT_EQ(buffer.at(Time() + fromSeconds(1.03)).status().code(), StatusCode::kNotEnoughData);
  EXPECT_EQ(buffer.at(Time() + fromSeconds(0.9)).status().code(), StatusCode::kOutOfRange);
}

TEST(OdometryBuffer, AGapSeparatesSegments) {
  OdometryBuffer buffer(fromSeconds(0.1));
  buffer.add(state(1.0, 1.0));
  buffer.add(state(1.5, 2.0));
  EXPECT_EQ(buffer.at(Time() + fromSeconds(1.2)).status().code(), StatusCode::kOutOfRange);
  EXPECT_NE(buffer.at(Time() + fromSeconds(1.0))->segment,
            buffer.at(Time() + fromSeconds(1.5))->segment);
}

TEST(OdometryBuffer, ForgetsButKeepsWhatAnInterpolationNeeds) {
  OdometryBuffer buffer(fromSeconds(1.0));
  for (int i = 0; i < 10; ++i) buffer.add(state(0.1 * i, i));
  buffer.forgetBefore(Time() + fromSeconds(0.55));
  EXPECT_EQ(buffer.size(), 5U);
  EXPECT_TRUE(buffer.at(Time() + fromSeconds(0.55)));
}

TEST(OdometryMessage, TwistIsInTheChildFrame) {
  inertial::OdometryState s = state(3.0, 0.0);
  s.T_odom_base.linear() = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  s.velocity = {0.0, 2.0, 0.0};  // odom y is base x
  s.position_sigma_m = 0.1;
  s.rotation_sigma_rad = 0.2;
  nav_msgs::Odometry message = toRos(s, {0.1, 0.2, 0.3}, "odom", "base_link");
  EXPECT_EQ(message.header.frame_id, "odom");
  EXPECT_EQ(message.child_frame_id, "base_link");
  EXPECT_NEAR(message.twist.twist.linear.x, 2.0, 1e-12);
  EXPECT_NEAR(message.twist.twist.linear.y, 0.0, 1e-12);
  const auto back = fromRos(message);
  ASSERT_TRUE(back);
  EXPECT_TRUE(back->velocity.isApprox(s.velocity));
  EXPECT_TRUE(back->T_odom_base.isApprox(s.T_odom_base));
  EXPECT_DOUBLE_EQ(back->position_sigma_m, 0.1);
  EXPECT_DOUBLE_EQ(back->rotation_sigma_rad, 0.2);
  message.twist.twist.linear.x = std::nan("");
  EXPECT_EQ(fromRos(message).status().code(), StatusCode::kInvalidInput);
}

}  // namespace
}  // namespace scanner::bridge
