// The processing nodes on synthetic messages: what goes in, what comes out, stamps, frames,
// services. Run by nodes.test (executables) and nodelets.test (one manager); the nodes must be up
// already.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <ros/callback_queue.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <ros/service.h>
#include <ros/spinner.h>
#include <sensor_msgs/CompressedImage.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <filesystem>
#include <functional>
#include <map>
#include <mutex>

#include "scanner/GroupArray.h"
#include "scanner/MeshStatus.h"
#include "scanner/RegisteredView.h"
#include "scanner/RegistrationStatus.h"
#include "scanner/Save.h"
#include "scanner/core/ply.h"
#include "scanner/core/trajectory_io.h"
#include "scanner/ros/conversions.h"
#include "support/synthetic_rig.h"
#include "support/temporary_folder.h"

namespace scanner::bridge {
namespace {

constexpr double kPatience_s = 60.0;
constexpr double kImuStep_s = 0.01;
constexpr double kFrameStep_s = 0.5;
constexpr const char* kRectified = "bumblebee_left_optical_rectified";

/// Keeps everything that came on one topic.
template <typename Message>
class Inbox {
 public:
  Inbox(ros::NodeHandle& nh, const std::string& topic)
      : subscriber_(nh.subscribe<Message>(
            topic, 0, [this](const typename Message::ConstPtr& m) { take(m); })) {}
  std::size_t size() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_.size();
  }
  std::vector<typename Message::ConstPtr> all() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }
  typename Message::ConstPtr last() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_.empty() ? nullptr : messages_.back();
  }
  bool connected() const { return subscriber_.getNumPublishers() > 0; }

 private:
  void take(const typename Message::ConstPtr& m) {
    const std::lock_guard<std::mutex> lock(mutex_);
    messages_.push_back(m);
  }
  mutable std::mutex mutex_;
  std::vector<typename Message::ConstPtr> messages_;
  ros::Subscriber subscriber_;
};

/// Polls until `done` or out of patience.
bool eventually(const std::function<bool()>& done) {
  const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(kPatience_s);
  while (!done()) {
    if (ros::WallTime::now() > deadline || !ros::ok()) return false;
    ros::WallDuration(0.02).sleep();
  }
  return true;
}

class NodeChainTest : public testing::Test {
 protected:
  NodeChainTest() {
    left_ = nh_.advertise<sensor_msgs::Image>("bumblebee/left/image_raw", 100);
    right_ = nh_.advertise<sensor_msgs::Image>("bumblebee/right/image_raw", 100);
    left_info_ = nh_.advertise<sensor_msgs::CameraInfo>("bumblebee/left/camera_info", 100);
    right_info_ = nh_.advertise<sensor_msgs::CameraInfo>("bumblebee/right/camera_info", 100);
    imu_ = nh_.advertise<sensor_msgs::Imu>("mti/imu/data", 10000);
    static_tf_.sendTransform(toRos(rig_.rig().T_base_camera, test::SyntheticRig::stamp(-1.5),
                                   "base_link", "bumblebee_left_optical"));
    spinner_.start();
  }

  bool connected() {
    return eventually([this] {
      return left_.getNumSubscribers() > 0 && right_.getNumSubscribers() > 0 &&
             left_info_.getNumSubscribers() > 0 && right_info_.getNumSubscribers() > 0 &&
             imu_.getNumSubscribers() > 0 && points_.connected() && odometry_.connected() &&
             views_.connected() && status_.connected() && mesh_status_.connected() &&
             disparity_.connected() && viewfinder_.connected();
    });
  }
  void publishImu(double from_s, double to_s) {
    for (double t = from_s; t < to_s; t += kImuStep_s) {
      imu_.publish(toRos(rig_.imu(t), "base_link"));
    }
  }
  void publishFrame(double t, double right_p3_factor = 1.0, double right_shift_s = 0.0) {
    const StereoFrame frame = rig_.frame(t);
    const std_msgs::Header left = makeHeader(frame.stamp, "bumblebee_left_optical");
    const std_msgs::Header right =
        makeHeader(frame.stamp + fromSeconds(right_shift_s), "bumblebee_right_optical");
    sensor_msgs::CameraInfo info = toRos(rig_.calibration().right, right);
    info.P[3] *= right_p3_factor;
    left_.publish(toRos(frame.left, left));
    right_.publish(toRos(frame.right, right));
    left_info_.publish(toRos(rig_.calibration().left, left));
    right_info_.publish(info);
  }
  static std::string trigger(const std::string& name, bool expected = true) {
    std_srvs::Trigger service;
    EXPECT_TRUE(ros::service::call(name, service)) << name;
    EXPECT_EQ(static_cast<bool>(service.response.success), expected)
        << name << ": " << service.response.message;
    return service.response.message;
  }
  static std::string save(const std::string& name, const std::string& folder, bool expected) {
    scanner::Save service;
    service.request.folder = folder;
    EXPECT_TRUE(ros::service::call(name, service)) << name;
    EXPECT_EQ(static_cast<bool>(service.response.success), expected)
        << name << ": " << service.response.message;
    return service.response.message;
  }
  bool becomes(std::uint8_t state) {
    return eventually([&] { return status_.last()->state == state; });
  }
  bool diagnosed(const std::string& text) {
    return eventually([&] {
      for (const auto& array : diagnostics_.all()) {
        for (const auto& status : array->status) {
          if (status.message.find(text) != std::string::npos) return true;
        }
      }
      return false;
    });
  }

  void checkIdle();
  void checkStereo(int frames);
  void checkOdometry();
  void checkRegistration(std::size_t views);
  void checkTrouble(double t);
  void checkFinish(std::size_t views);
  void checkMesh(std::size_t views);

  test::SyntheticRig rig_;
  test::TemporaryFolder folder_;
  ros::NodeHandle nh_;
  ros::Publisher left_, right_, left_info_, right_info_, imu_;
  tf2_ros::StaticTransformBroadcaster static_tf_;
  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener tf_listener_{tf_};
  Inbox<sensor_msgs::PointCloud2> points_{nh_, "stereo/points"};
  Inbox<stereo_msgs::DisparityImage> disparity_{nh_, "stereo/disparity"};
  Inbox<sensor_msgs::CompressedImage> viewfinder_{nh_, "stereo/left/viewfinder/compressed"};
  Inbox<nav_msgs::Odometry> odometry_{nh_, "odometry"};
  Inbox<geometry_msgs::PoseWithCovarianceStamped> poses_{nh_, "registration/pose"};
  Inbox<nav_msgs::Path> path_{nh_, "registration/path"};
  Inbox<RegisteredView> views_{nh_, "registration/views"};
  Inbox<GroupArray> groups_{nh_, "registration/groups"};
  Inbox<sensor_msgs::PointCloud2> cloud_{nh_, "registration/cloud"};
  Inbox<RegistrationStatus> status_{nh_, "registration/status"};
  Inbox<visualization_msgs::Marker> mesh_{nh_, "mesh/preview"};
  Inbox<MeshStatus> mesh_status_{nh_, "mesh/status"};
  Inbox<diagnostic_msgs::DiagnosticArray> diagnostics_{nh_, "/diagnostics"};
  ros::AsyncSpinner spinner_{1};
};

void NodeChainTest::checkIdle() {
  // autostart is off in the launch files of this test.
  ASSERT_TRUE(eventually([this] { return status_.size() > 0; }));
  EXPECT_EQ(status_.last()->state, RegistrationStatus::IDLE);
  EXPECT_TRUE(diagnosed("no images on /bumblebee/left/image_raw"));
  EXPECT_TRUE(diagnosed("no samples on /mti/imu/data"));
  trigger("registration_node/discard_last", false);
  trigger("mesh_node/build", false);
  trigger("registration_node/start");
  EXPECT_TRUE(becomes(RegistrationStatus::SCANNING));
}

void NodeChainTest::checkStereo(int frames) {
  ASSERT_TRUE(eventually([&] { return points_.size() == static_cast<std::size_t>(frames); }));
  for (int i = 0; i < frames; ++i) {
    const auto cloud = points_.all()[static_cast<std::size_t>(i)];
    EXPECT_EQ(fromRos(cloud->header.stamp), test::SyntheticRig::stamp(i * kFrameStep_s));
    EXPECT_EQ(cloud->header.frame_id, kRectified);
    EXPECT_EQ(cloud->width, static_cast<std::uint32_t>(rig_.calibration().left.width));
    EXPECT_EQ(cloud->height, static_cast<std::uint32_t>(rig_.calibration().left.height));
    const Result<OrganizedCloud> points = fromRos(*cloud);
    ASSERT_TRUE(points);
    EXPECT_TRUE(points->cloud.hasNormals() && points->cloud.hasColors());
    EXPECT_GT(finitePoints(points->cloud, true).size(), 1000U);
  }
  ASSERT_TRUE(eventually([this] { return disparity_.size() > 0 && viewfinder_.size() > 0; }));
  EXPECT_EQ(disparity_.last()->header.frame_id, kRectified);
  EXPECT_GT(disparity_.last()->T, 0.0F);
  EXPECT_EQ(viewfinder_.last()->header.frame_id, kRectified);
  // camera_info's R is the identity here: both frames coincide.
  ASSERT_TRUE(eventually(
      [this] { return tf_.canTransform("bumblebee_left_optical", kRectified, ros::Time(0)); }));
}

void NodeChainTest::checkOdometry() {
  ASSERT_TRUE(eventually([this] { return odometry_.size() > 300; }));
  const auto messages = odometry_.all();
  EXPECT_EQ(messages.front()->header.frame_id, "odom");
  EXPECT_EQ(messages.front()->child_frame_id, "base_link");
  // The filters start from the first second; its states come late, but they come.
  EXPECT_EQ(fromRos(messages.front()->header.stamp), test::SyntheticRig::stamp(-1.5));
  for (std::size_t i = 1; i < messages.size(); ++i) {
    ASSERT_GT(messages[i]->header.stamp, messages[i - 1]->header.stamp);
  }
  EXPECT_TRUE(eventually([this] { return tf_.canTransform("odom", "base_link", ros::Time(0)); }));
}

void NodeChainTest::checkRegistration(std::size_t views) {
  ASSERT_TRUE(eventually([&] { return views_.size() == views; }));
  for (std::size_t i = 0; i < views; ++i) {
    const auto view = views_.all()[i];
    EXPECT_TRUE(view->registered) << view->index << ": " << view->reason;
    EXPECT_EQ(view->index, i);
    EXPECT_EQ(view->header.frame_id, "map");
    EXPECT_EQ(view->cloud.header.frame_id, "base_link");
    EXPECT_EQ(fromRos(view->header.stamp),
              test::SyntheticRig::stamp(static_cast<double>(i) * kFrameStep_s));
    EXPECT_GT(view->cloud.width, 300U);
  }
  ASSERT_TRUE(eventually([&] { return poses_.size() == views; }));
  // The motion between first and last view against the truth.
  const auto T_map_first = fromRos(poses_.all().front()->pose.pose);
  const auto T_map_last = fromRos(poses_.last()->pose.pose);
  ASSERT_TRUE(T_map_first && T_map_last);
  const Eigen::Isometry3d truth =
      rig_.pose(0.0).inverse() * rig_.pose(static_cast<double>(views - 1) * kFrameStep_s);
  const Eigen::Isometry3d error = truth.inverse() * (T_map_first->inverse() * *T_map_last);
  EXPECT_LT(error.translation().norm(), 0.02);
  EXPECT_LT(rotationAngle(error), 0.03);
  EXPECT_EQ(poses_.last()->header.frame_id, "map");
  EXPECT_EQ(cloud_.last()->header.frame_id, "map");
  EXPECT_TRUE(eventually([this] { return tf_.canTransform("map", "odom", ros::Time(0)); }));
}

void NodeChainTest::checkTrouble(double t) {
  const std::size_t clouds = points_.size();
  const std::size_t views = views_.size();
  // The right camera's P[3] has the wrong sign: an empty cloud, a discarded view, both with reason.
  publishFrame(t, -1.0);
  publishImu(t, t + 0.1);
  ASSERT_TRUE(eventually([&] { return points_.size() == clouds + 1; }));
  EXPECT_EQ(points_.last()->width, 0U);
  EXPECT_TRUE(diagnosed("P[3]"));
  ASSERT_TRUE(eventually([&] { return views_.size() == views + 1; }));
  EXPECT_FALSE(views_.last()->registered);
  EXPECT_FALSE(views_.last()->reason.empty());
  // Stamps that differ are no pair; NaN is no sample.
  publishFrame(t + 0.2, 1.0, 0.001);
  sensor_msgs::Imu broken = toRos(rig_.imu(t + 0.2), "base_link");
  broken.angular_velocity.x = std::numeric_limits<double>::quiet_NaN();
  imu_.publish(broken);
  EXPECT_TRUE(diagnosed("angular_velocity is not finite"));
  trigger("registration_node/stop");
  EXPECT_TRUE(becomes(RegistrationStatus::IDLE));
}

void NodeChainTest::checkFinish(std::size_t views) {
  trigger("registration_node/finish");
  ASSERT_TRUE(becomes(RegistrationStatus::DONE));
  const auto status = status_.last();
  EXPECT_EQ(status->views_registered, views);
  EXPECT_EQ(status->views_total, views + 1);
  EXPECT_EQ(status->views_discarded, 1U);
  EXPECT_EQ(status->queue_length, 0U);
  ASSERT_TRUE(eventually([&] { return path_.last()->poses.size() == views; }));
  EXPECT_EQ(path_.last()->header.frame_id, "map");
  EXPECT_FALSE(groups_.last()->groups.empty());
  EXPECT_EQ(groups_.last()->groups.front().first_view, 0U);
  EXPECT_GT(groups_.last()->groups.front().points, 0U);
  save("registration_node/save", folder_ / "scan", true);
  const Result<Trajectory> trajectory = readTum(folder_ / "scan/trajectory.tum");
  ASSERT_TRUE(trajectory);
  EXPECT_EQ(trajectory->size(), views);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "scan/views/view_000.ply"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "scan/groups/group_000.ply"));
  EXPECT_NE(save("registration_node/save", "/proc/nowhere", false).find("/proc/nowhere"),
            std::string::npos);
}

void NodeChainTest::checkMesh(std::size_t views) {
  trigger("mesh_node/build");
  ASSERT_TRUE(eventually([this] { return mesh_.size() > 0; }));
  EXPECT_EQ(mesh_.last()->header.frame_id, "map");
  EXPECT_EQ(mesh_.last()->type, visualization_msgs::Marker::TRIANGLE_LIST);
  EXPECT_EQ(mesh_.last()->points.size(), mesh_.last()->colors.size());
  ASSERT_TRUE(eventually([this] { return mesh_status_.last()->state == MeshStatus::DONE; }));
  EXPECT_EQ(mesh_status_.last()->views, views);
  save("mesh_node/save", folder_ / "scan", true);
  const Result<Mesh> mesh = readPly(folder_ / "scan/model.ply");
  ASSERT_TRUE(mesh) << mesh.status().message();
  EXPECT_EQ(mesh->faces.size(), mesh_status_.last()->faces);
  EXPECT_TRUE(mesh->vertices.hasColors());
}

TEST_F(NodeChainTest, FromRawPairsToAMesh) {
  constexpr int kFrames = 4;
  ASSERT_TRUE(connected());
  checkIdle();
  publishImu(-1.5, 0.0);
  for (int i = 0; i < kFrames; ++i) {
    publishFrame(i * kFrameStep_s);
    publishImu(i * kFrameStep_s, (i + 1) * kFrameStep_s);
  }
  checkStereo(kFrames);
  checkOdometry();
  checkRegistration(kFrames);
  checkTrouble(kFrames * kFrameStep_s);
  checkFinish(kFrames);
  checkMesh(kFrames);
  trigger("registration_node/discard_last");
  EXPECT_TRUE(eventually([this] { return path_.last()->poses.size() == kFrames - 1; }));
  trigger("inertial_odometry_node/reset");
}

}  // namespace
}  // namespace scanner::bridge

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "node_chain_test");
  return RUN_ALL_TESTS();
}
