#pragma once

#include <geometry_msgs/Pose.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovariance.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Path.h>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/Header.h>
#include <stereo_msgs/DisparityImage.h>
#include <visualization_msgs/Marker.h>

#include <string>

#include "scanner/core/camera.h"
#include "scanner/core/cloud.h"
#include "scanner/core/image.h"
#include "scanner/core/imu.h"
#include "scanner/core/mesh.h"
#include "scanner/core/se3.h"
#include "scanner/core/status.h"
#include "scanner/core/time.h"

/// Everything that knows ROS. The folder is `ros`; the namespace is not, because inside
/// `scanner::ros` (and inside the generated messages' namespace `scanner`) the name `ros` would
/// hide roscpp's.
///
/// Conversions between messages and the project's types. They are pure and thread-safe. A message
/// that cannot be converted gives a Status naming the field and its value; nothing is guessed.
namespace scanner::bridge {

/// Exact to the nanosecond. ROS time covers 1970..2106; a Time outside gives kOutOfRange.
Time fromRos(const ros::Time& time);
Result<ros::Time> toRos(Time time);
/// For stamps that came from ROS in the first place; throws std::logic_error when out of range.
ros::Time rosTime(Time time);
std_msgs::Header makeHeader(Time stamp, const std::string& frame_id);

/// mono8, bgr8, rgb8 (swapped to BGR) and bayer_{rggb,bggr,gbrg,grbg}8; anything else is
/// kUnsupported with the encoding's name. Copies the pixels; a padded step is removed.
Result<Image> fromRos(const sensor_msgs::Image& message);
sensor_msgs::Image toRos(const Image& image, const std_msgs::Header& header);

/// kUnsupported for binning or a region of interest, kInvalidInput for an uncalibrated camera
/// (K[0] = 0) or a wrong size.
Result<CameraModel> fromRos(const sensor_msgs::CameraInfo& message);
sensor_msgs::CameraInfo toRos(const CameraModel& camera, const std_msgs::Header& header);

/// rad/s, m/s^2 (REP-145). Orientation is absent when orientation_covariance[0] < 0 or the
/// quaternion is all zero (both mean "no orientation"). kInvalidInput for NaN, for a quaternion
/// that is not of unit length, and where the covariance says that rates or accelerations are
/// absent.
Result<ImuSample> fromRos(const sensor_msgs::Imu& message);
/// Covariances are left 0 (unknown), orientation_covariance[0] = -1 without orientation.
sensor_msgs::Imu toRos(const ImuSample& sample, const std::string& frame_id);

/// The sample as a sensor would give it that is mounted as base_link is. The lever arm is ignored.
ImuSample turned(const ImuSample& sample, const Eigen::Quaterniond& q_base_imu);

/// kInvalidInput for NaN or a quaternion that is not of unit length (1 %).
Result<Eigen::Isometry3d> fromRos(const geometry_msgs::Pose& message);
Result<Eigen::Isometry3d> fromRos(const geometry_msgs::Transform& message);
geometry_msgs::Pose toRos(const Eigen::Isometry3d& T);
/// T_parent_child as tf wants it.
geometry_msgs::TransformStamped toRos(const Eigen::Isometry3d& T_parent_child, Time stamp,
                                      const std::string& parent, const std::string& child);
/// Diagonal covariance, the same for each axis.
geometry_msgs::PoseWithCovariance withCovariance(const Eigen::Isometry3d& T,
                                                 double position_sigma_m,
                                                 double rotation_sigma_rad);
nav_msgs::Path toRos(const Trajectory& trajectory, const std::string& frame_id);
/// kInvalidInput for a pose that is not rigid or stamps that do not increase.
Result<Trajectory> fromRos(const nav_msgs::Path& message);

/// float32 fields x y z, and where present normal_x normal_y normal_z, rgb (8-bit channels packed
/// in a float, as rviz wants), sigma (m). Absent attributes have no field.
sensor_msgs::PointCloud2 toRos(const PointCloud& cloud, const std_msgs::Header& header);
/// The same, organised: width x height, is_dense false.
sensor_msgs::PointCloud2 toRos(const OrganizedCloud& cloud, const std::string& frame_id,
                               int threads = 1);
/// Needs x y z as float32 little endian; takes the attributes above when there. Unknown fields are
/// ignored.
Result<PointCloud> pointsFromRos(const sensor_msgs::PointCloud2& message);
/// As pointsFromRos; width, height and stamp are kept.
Result<OrganizedCloud> fromRos(const sensor_msgs::PointCloud2& message);

/// f, T (baseline, m), bounds and, as stereo_msgs asks for Z = f T / d, the disparity corrected for
/// the offset between the principal points. Unknown pixels hold min_disparity - 1, which
/// stereo_view and stereo_image_proc take as invalid.
stereo_msgs::DisparityImage toRos(const DisparityImage& disparity,
                                  const StereoCalibration& calibration,
                                  const std::string& frame_id);

/// TRIANGLE_LIST in metres with the vertices' colours (grey when the mesh has none).
visualization_msgs::Marker toRos(const Mesh& mesh, const std_msgs::Header& header,
                                 const std::string& name_space, int id);

}  // namespace scanner::bridge
