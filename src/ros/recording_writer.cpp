#include "ros/recording_writer.h"

#include <geometry_msgs/PoseStamped.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Imu.h>
#include <tf2_msgs/TFMessage.h>

#include <boost/make_shared.hpp>
#include <filesystem>

#include "scanner/ros/conversions.h"

namespace scanner::bridge {
namespace fs = std::filesystem;

RecordingWriter::RecordingWriter(const std::string& path, bool compressed) : path_(path) {
  bag_.open(path_ + ".active", rosbag::bagmode::Write);
  if (compressed) bag_.setCompression(rosbag::compression::BZ2);
}

RecordingWriter::~RecordingWriter() {
  if (committed_) return;
  try {
    bag_.close();
  } catch (const std::exception&) {  // A full disk: the file goes away in any case.
  }
  std::error_code ignored;
  fs::remove(path_ + ".active", ignored);
}

void RecordingWriter::writeTransforms(Time stamp, const Eigen::Isometry3d& T_base_left,
                                      const Eigen::Isometry3d& T_left_right) {
  tf2_msgs::TFMessage message;
  message.transforms = {toRos(T_base_left, stamp, topics_.base_frame, topics_.camera_frame),
                        toRos(T_left_right, stamp, topics_.camera_frame, kRightCameraFrame)};
  // Latched, so that a player offers it to nodes that come later.
  const auto connection = boost::make_shared<ros::M_string>();
  (*connection)["type"] = ros::message_traits::datatype(message);
  (*connection)["md5sum"] = ros::message_traits::md5sum(message);
  (*connection)["message_definition"] = ros::message_traits::definition(message);
  (*connection)["latching"] = "1";
  bag_.write(topics_.tf_static, rosTime(stamp), message, connection);
}

void RecordingWriter::writeEye(Time stamp, const Image& image, const CameraModel& camera,
                               const std::string& frame, const std::string& image_topic,
                               const std::string& info_topic) {
  const std_msgs::Header header = makeHeader(stamp, frame);
  bag_.write(image_topic, header.stamp, toRos(image, header));
  bag_.write(info_topic, header.stamp, toRos(camera, header));
}

void RecordingWriter::writeFrame(const StereoFrame& frame, const StereoCalibration& calibration) {
  writeEye(frame.stamp, frame.left, calibration.left, topics_.camera_frame, topics_.left_image,
           topics_.left_info);
  writeEye(frame.stamp, frame.right, calibration.right, kRightCameraFrame, topics_.right_image,
           topics_.right_info);
}

void RecordingWriter::writeImu(const ImuSample& sample) {
  bag_.write(topics_.imu, rosTime(sample.stamp), toRos(sample, topics_.base_frame));
}

void RecordingWriter::writeTruth(const StampedPose& pose) {
  geometry_msgs::PoseStamped message;
  message.header = makeHeader(pose.stamp, "map");
  message.pose = toRos(pose.T_map_base);
  bag_.write(topics_.ground_truth, rosTime(pose.stamp), message);
}

void RecordingWriter::commit() {
  bag_.close();
  fs::rename(path_ + ".active", path_);
  committed_ = true;
}

Status writeRecording(const std::string& path, bool compressed,
                      const std::function<Status(RecordingWriter&)>& write) {
  try {
    RecordingWriter writer(path, compressed);
    if (Status status = write(writer); !status) return status;
    writer.commit();
    return Status::ok();
  } catch (const std::exception& e) {
    return Status(StatusCode::kIoError, path + ": cannot be written (" + e.what() + ")");
  }
}

}  // namespace scanner::bridge
