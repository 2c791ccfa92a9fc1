#include "ros/imu_frame.h"

#include "scanner/ros/conversions.h"
#include "scanner/ros/static_transforms.h"

namespace scanner::bridge {

Result<ImuSample> imuInBase(const sensor_msgs::Imu& message, const tf2_ros::Buffer& tf,
                            const std::string& base_frame) {
  Result<ImuSample> sample = fromRos(message);
  const std::string frame = frameName(message.header.frame_id);
  if (!sample || frame.empty() || frame == base_frame) return sample;
  if (!tf.canTransform(base_frame, frame, ros::Time(0))) return sample;
  const Result<Eigen::Isometry3d> T_base_imu =
      fromRos(tf.lookupTransform(base_frame, frame, ros::Time(0)).transform);
  if (!T_base_imu) return T_base_imu.status();
  return turned(*sample, Eigen::Quaterniond(T_base_imu->linear()));
}

}  // namespace scanner::bridge
