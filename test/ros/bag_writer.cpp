#include "ros/bag_writer.h"

#include <geometry_msgs/PoseStamped.h>
#include <tf2_msgs/TFMessage.h>

#include "scanner/ros/conversions.h"

namespace scanner::test {

using bridge::makeHeader;
using bridge::rosTime;
using bridge::toRos;

void BagWriter::writeTransforms(rosbag::Bag& bag, const SyntheticRig& rig) const {
  // Through a frame in between, as a real mount has it.
  Eigen::Isometry3d T_base_mount = Eigen::Isometry3d::Identity();
  T_base_mount.translation() = Eigen::Vector3d(0.1, 0.2, 0.3);
  const Time stamp = SyntheticRig::stamp(-0.5);
  tf2_msgs::TFMessage message;
  message.transforms = {
      toRos(T_base_mount, stamp, "/base_link", "mount"),
      toRos(T_base_mount.inverse() * rig.rig().T_base_camera, stamp, "mount", camera_frame)};
  bag.write(topics.tf_static, rosTime(stamp), message);
}

void BagWriter::writeFrame(rosbag::Bag& bag, const SyntheticRig& rig, int index) const {
  const StereoFrame frame = rig.frame(index * frame_step_s);
  for (const bool left : {true, false}) {
    const std_msgs::Header header =
        makeHeader(frame.stamp, left ? camera_frame : "bumblebee_right_optical");
    sensor_msgs::Image picture = toRos(left ? frame.left : frame.right, header);
    sensor_msgs::CameraInfo camera =
        toRos(left ? rig.calibration().left : rig.calibration().right, header);
    if (!image || image(index, left, picture)) {
      bag.write(left ? topics.left_image : topics.right_image, header.stamp, picture);
    }
    if (!info || info(index, left, camera)) {
      bag.write(left ? topics.left_info : topics.right_info, header.stamp, camera);
    }
  }
}

void BagWriter::write(const std::string& path, const SyntheticRig& rig) const {
  rosbag::Bag bag(path, rosbag::bagmode::Write);
  if (transforms) writeTransforms(bag, rig);
  for (int i = 0; i < frames; ++i) writeFrame(bag, rig, i);
  const double end_s = (frames - 1) * frame_step_s + 0.2;
  const int samples = static_cast<int>((end_s + 0.3) / imu_step_s);
  for (int i = 0; i < samples; ++i) {
    const ImuSample sample = rig.imu(i * imu_step_s - 0.3);
    sensor_msgs::Imu message = toRos(sample, "base_link");
    const ros::Time recorded = message.header.stamp;
    if (!imu || imu(i, message)) bag.write(topics.imu, recorded, message);
    if (!truth) continue;
    geometry_msgs::PoseStamped pose;
    pose.header = makeHeader(sample.stamp, "map");
    pose.pose = toRos(rig.pose(i * imu_step_s - 0.3));
    bag.write(topics.ground_truth, recorded, pose);
  }
  bag.close();
}

}  // namespace scanner::test
