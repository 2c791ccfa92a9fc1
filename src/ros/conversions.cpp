#include "scanner/ros/conversions.h"

#include <sensor_msgs/distortion_models.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>

namespace scanner::bridge {
namespace {

constexpr double kUnitTolerance = 0.01;

struct Encoding {
  const char* name;
  PixelFormat format;
  int channels;
};

constexpr std::array<Encoding, 6> kEncodings = {{{"mono8", PixelFormat::kMono8, 1},
                                                 {"bgr8", PixelFormat::kBgr8, 3},
                                                 {"bayer_rggb8", PixelFormat::kBayerRggb8, 1},
                                                 {"bayer_bggr8", PixelFormat::kBayerBggr8, 1},
                                                 {"bayer_gbrg8", PixelFormat::kBayerGbrg8, 1},
                                                 {"bayer_grbg8", PixelFormat::kBayerGrbg8, 1}}};

const Encoding* findEncoding(const std::string& name) {
  for (const Encoding& e : kEncodings) {
    if (name == e.name) return &e;
  }
  return nullptr;
}

Status invalid(std::string message) {
  return Status(StatusCode::kInvalidInput, std::move(message));
}

Result<Eigen::Quaterniond> unitQuaternion(double x, double y, double z, double w,
                                          const char* what) {
  const Eigen::Quaterniond q(w, x, y, z);
  const double norm = q.norm();
  if (!std::isfinite(norm) || std::abs(norm - 1.0) > kUnitTolerance) {
    return invalid(std::string(what) + ": the quaternion is not of unit length (norm " +
                   std::to_string(norm) + ")");
  }
  return q.normalized();
}

Result<Eigen::Isometry3d> rigid(const Eigen::Vector3d& t, double x, double y, double z, double w,
                                const char* what) {
  if (!t.allFinite()) return invalid(std::string(what) + ": the position is not finite");
  Result<Eigen::Quaterniond> q = unitQuaternion(x, y, z, w, what);
  if (!q) return q.status();
  return makePose(t, *q);
}

}  // namespace

Time fromRos(const ros::Time& time) {
  return fromNanoseconds(static_cast<std::int64_t>(time.sec) * 1000000000LL + time.nsec);
}

Result<ros::Time> toRos(Time time) {
  const std::int64_t ns = toNanoseconds(time);
  constexpr std::int64_t kLimit = 0x100000000LL * 1000000000LL;
  if (ns < 0 || ns >= kLimit) {
    return Status(StatusCode::kOutOfRange,
                  "time " + std::to_string(ns) + " ns is outside of what ROS can hold");
  }
  return ros::Time(static_cast<std::uint32_t>(ns / 1000000000LL),
                   static_cast<std::uint32_t>(ns % 1000000000LL));
}

ros::Time rosTime(Time time) { return toRos(time).value(); }

std_msgs::Header makeHeader(Time stamp, const std::string& frame_id) {
  std_msgs::Header header;
  header.stamp = rosTime(stamp);
  header.frame_id = frame_id;
  return header;
}

Result<Image> fromRos(const sensor_msgs::Image& message) {
  const bool rgb = message.encoding == "rgb8";
  const Encoding* encoding = findEncoding(rgb ? "bgr8" : message.encoding);
  if (!encoding) {
    return Status(StatusCode::kUnsupported, "image encoding '" + message.encoding +
                                                "' is not handled (mono8, bgr8, rgb8 and "
                                                "bayer_*8 are)");
  }
  const auto channels = static_cast<std::size_t>(encoding->channels);
  if (message.width == 0 || message.height == 0 || message.width > 65535 ||
      message.height > 65535) {
    return invalid("image of " + std::to_string(message.width) + "x" +
                   std::to_string(message.height) + " pixels");
  }
  const std::size_t row = message.width * channels;
  const std::size_t step = message.step;
  if (step < row || message.data.size() < step * (message.height - 1) + row) {
    return invalid("image of " + std::to_string(message.width) + "x" +
                   std::to_string(message.height) + " " + message.encoding + " holds only " +
                   std::to_string(message.data.size()) + " bytes (step " + std::to_string(step) +
                   ")");
  }
  Image image;
  image.format = encoding->format;
  image.data.create(static_cast<int>(message.height), static_cast<int>(message.width),
                    channels == 3 ? CV_8UC3 : CV_8UC1);
  for (std::uint32_t y = 0; y < message.height; ++y) {
    std::memcpy(image.data.ptr(static_cast<int>(y)), message.data.data() + y * step, row);
  }
  if (rgb) cv::cvtColor(image.data, image.data, cv::COLOR_RGB2BGR);
  return image;
}

sensor_msgs::Image toRos(const Image& image, const std_msgs::Header& header) {
  sensor_msgs::Image message;
  message.header = header;
  for (const Encoding& e : kEncodings) {
    if (e.format == image.format) message.encoding = e.name;
  }
  message.width = static_cast<std::uint32_t>(image.data.cols);
  message.height = static_cast<std::uint32_t>(image.data.rows);
  message.step = static_cast<std::uint32_t>(image.data.cols) *
                 static_cast<std::uint32_t>(image.data.elemSize());
  message.data.resize(static_cast<std::size_t>(message.step) * message.height);
  for (int y = 0; y < image.data.rows; ++y) {
    std::memcpy(message.data.data() + static_cast<std::size_t>(y) * message.step, image.data.ptr(y),
                message.step);
  }
  return message;
}

Result<CameraModel> fromRos(const sensor_msgs::CameraInfo& message) {
  if (message.width == 0 || message.height == 0) {
    return invalid("camera_info: width x height is " + std::to_string(message.width) + "x" +
                   std::to_string(message.height));
  }
  if (message.K[0] == 0.0) return invalid("camera_info: K[0] is 0, the camera is not calibrated");
  if (message.binning_x > 1 || message.binning_y > 1) {
    return Status(StatusCode::kUnsupported,
                  "camera_info: binning " + std::to_string(message.binning_x) + "x" +
                      std::to_string(message.binning_y) + " is not handled");
  }
  const auto& roi = message.roi;
  const bool whole = roi.x_offset == 0 && roi.y_offset == 0 &&
                     (roi.width == 0 || roi.width == message.width) &&
                     (roi.height == 0 || roi.height == message.height);
  if (!whole) {
    return Status(StatusCode::kUnsupported, "camera_info: a region of interest is not handled");
  }
  CameraModel camera;
  camera.width = static_cast<int>(message.width);
  camera.height = static_cast<int>(message.height);
  if (!message.distortion_model.empty()) camera.distortion_model = message.distortion_model;
  camera.D = message.D;
  using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  using RowMajor34 = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;
  camera.K = Eigen::Map<const RowMajor3>(message.K.data());
  camera.R = Eigen::Map<const RowMajor3>(message.R.data());
  camera.P = Eigen::Map<const RowMajor34>(message.P.data());
  return camera;
}

sensor_msgs::CameraInfo toRos(const CameraModel& camera, const std_msgs::Header& header) {
  sensor_msgs::CameraInfo message;
  message.header = header;
  message.width = static_cast<std::uint32_t>(camera.width);
  message.height = static_cast<std::uint32_t>(camera.height);
  message.distortion_model = camera.distortion_model;
  message.D = camera.D;
  using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  using RowMajor34 = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;
  Eigen::Map<RowMajor3>(message.K.data()) = camera.K;
  Eigen::Map<RowMajor3>(message.R.data()) = camera.R;
  Eigen::Map<RowMajor34>(message.P.data()) = camera.P;
  return message;
}

Result<ImuSample> fromRos(const sensor_msgs::Imu& message) {
  if (message.angular_velocity_covariance[0] < 0.0 ||
      message.linear_acceleration_covariance[0] < 0.0) {
    return invalid("imu: the covariance says that rates or accelerations are absent");
  }
  ImuSample sample;
  sample.stamp = fromRos(message.header.stamp);
  const auto& w = message.angular_velocity;
  const auto& a = message.linear_acceleration;
  sample.angular_velocity = {w.x, w.y, w.z};
  sample.linear_acceleration = {a.x, a.y, a.z};
  if (!sample.angular_velocity.allFinite()) return invalid("imu: angular_velocity is not finite");
  if (!sample.linear_acceleration.allFinite()) {
    return invalid("imu: linear_acceleration is not finite");
  }
  const auto& q = message.orientation;
  const bool zero = q.x == 0.0 && q.y == 0.0 && q.z == 0.0 && q.w == 0.0;
  if (message.orientation_covariance[0] >= 0.0 && !zero) {
    Result<Eigen::Quaterniond> orientation = unitQuaternion(q.x, q.y, q.z, q.w, "imu orientation");
    if (!orientation) return orientation.status();
    sample.orientation = *orientation;
  }
  return sample;
}

sensor_msgs::Imu toRos(const ImuSample& sample, const std::string& frame_id) {
  sensor_msgs::Imu message;
  message.header = makeHeader(sample.stamp, frame_id);
  message.angular_velocity.x = sample.angular_velocity.x();
  message.angular_velocity.y = sample.angular_velocity.y();
  message.angular_velocity.z = sample.angular_velocity.z();
  message.linear_acceleration.x = sample.linear_acceleration.x();
  message.linear_acceleration.y = sample.linear_acceleration.y();
  message.linear_acceleration.z = sample.linear_acceleration.z();
  const Eigen::Quaterniond q = sample.orientation.value_or(Eigen::Quaterniond::Identity());
  message.orientation.x = q.x();
  message.orientation.y = q.y();
  message.orientation.z = q.z();
  message.orientation.w = q.w();
  if (!sample.orientation) message.orientation_covariance[0] = -1.0;
  return message;
}

ImuSample turned(const ImuSample& sample, const Eigen::Quaterniond& q_base_imu) {
  ImuSample out = sample;
  out.angular_velocity = q_base_imu * sample.angular_velocity;
  out.linear_acceleration = q_base_imu * sample.linear_acceleration;
  if (sample.orientation) out.orientation = *sample.orientation * q_base_imu.conjugate();
  return out;
}

Result<Eigen::Isometry3d> fromRos(const geometry_msgs::Pose& message) {
  const auto& p = message.position;
  const auto& q = message.orientation;
  return rigid({p.x, p.y, p.z}, q.x, q.y, q.z, q.w, "pose");
}

Result<Eigen::Isometry3d> fromRos(const geometry_msgs::Transform& message) {
  const auto& t = message.translation;
  const auto& q = message.rotation;
  return rigid({t.x, t.y, t.z}, q.x, q.y, q.z, q.w, "transform");
}

geometry_msgs::Pose toRos(const Eigen::Isometry3d& T) {
  geometry_msgs::Pose message;
  const Eigen::Quaterniond q(T.linear());
  message.position.x = T.translation().x();
  message.position.y = T.translation().y();
  message.position.z = T.translation().z();
  message.orientation.x = q.x();
  message.orientation.y = q.y();
  message.orientation.z = q.z();
  message.orientation.w = q.w();
  return message;
}

geometry_msgs::TransformStamped toRos(const Eigen::Isometry3d& T_parent_child, Time stamp,
                                      const std::string& parent, const std::string& child) {
  geometry_msgs::TransformStamped message;
  message.header = makeHeader(stamp, parent);
  message.child_frame_id = child;
  const geometry_msgs::Pose pose = toRos(T_parent_child);
  message.transform.translation.x = pose.position.x;
  message.transform.translation.y = pose.position.y;
  message.transform.translation.z = pose.position.z;
  message.transform.rotation = pose.orientation;
  return message;
}

geometry_msgs::PoseWithCovariance withCovariance(const Eigen::Isometry3d& T,
                                                 double position_sigma_m,
                                                 double rotation_sigma_rad) {
  geometry_msgs::PoseWithCovariance message;
  message.pose = toRos(T);
  for (std::size_t i = 0; i < 6; ++i) {
    const double sigma = i < 3 ? position_sigma_m : rotation_sigma_rad;
    message.covariance[i * 7] = sigma * sigma;
  }
  return message;
}

nav_msgs::Path toRos(const Trajectory& trajectory, const std::string& frame_id) {
  nav_msgs::Path message;
  message.header.frame_id = frame_id;
  if (!trajectory.empty()) message.header.stamp = rosTime(trajectory.back().stamp);
  message.poses.reserve(trajectory.size());
  for (const StampedPose& pose : trajectory) {
    geometry_msgs::PoseStamped stamped;
    stamped.header = makeHeader(pose.stamp, frame_id);
    stamped.pose = toRos(pose.T_map_base);
    message.poses.push_back(stamped);
  }
  return message;
}

Result<Trajectory> fromRos(const nav_msgs::Path& message) {
  Trajectory trajectory;
  trajectory.reserve(message.poses.size());
  for (const geometry_msgs::PoseStamped& stamped : message.poses) {
    Result<Eigen::Isometry3d> T = fromRos(stamped.pose);
    if (!T) return T.status();
    const Time stamp = fromRos(stamped.header.stamp);
    if (!trajectory.empty() && stamp <= trajectory.back().stamp) {
      return invalid("path: stamps do not increase at pose " + std::to_string(trajectory.size()));
    }
    trajectory.push_back({stamp, *T});
  }
  return trajectory;
}

stereo_msgs::DisparityImage toRos(const DisparityImage& disparity,
                                  const StereoCalibration& calibration,
                                  const std::string& frame_id) {
  stereo_msgs::DisparityImage message;
  message.header = makeHeader(disparity.stamp, frame_id);
  const double offset = calibration.disparityOffset();
  message.f = static_cast<float>(calibration.focalLength());
  message.T = static_cast<float>(calibration.baseline());
  message.min_disparity = static_cast<float>(disparity.min_disparity_px - offset);
  message.max_disparity = static_cast<float>(disparity.max_disparity_px - offset);
  message.delta_d = 1.0F / 16.0F;
  const int rows = disparity.disparity_px.rows;
  const int cols = disparity.disparity_px.cols;
  // Pixels left of the largest disparity have no partner in the right image.
  const int border = std::clamp(static_cast<int>(std::ceil(disparity.max_disparity_px)), 0, cols);
  message.valid_window.x_offset = static_cast<std::uint32_t>(border);
  message.valid_window.width = static_cast<std::uint32_t>(cols - border);
  message.valid_window.height = static_cast<std::uint32_t>(rows);
  sensor_msgs::Image& image = message.image;
  image.header = message.header;
  image.encoding = sensor_msgs::image_encodings::TYPE_32FC1;
  image.width = static_cast<std::uint32_t>(cols);
  image.height = static_cast<std::uint32_t>(rows);
  image.step = image.width * static_cast<std::uint32_t>(sizeof(float));
  image.data.resize(static_cast<std::size_t>(image.step) * image.height);
  const float unknown = message.min_disparity - 1.0F;
  const auto shift = static_cast<float>(offset);
  for (int y = 0; y < rows; ++y) {
    const float* in = disparity.disparity_px.ptr<float>(y);
    std::uint8_t* out = image.data.data() + static_cast<std::size_t>(y) * image.step;
    for (int x = 0; x < cols; ++x) {
      const float value = std::isfinite(in[x]) ? in[x] - shift : unknown;
      std::memcpy(out + static_cast<std::size_t>(x) * sizeof(float), &value, sizeof(float));
    }
  }
  return message;
}

visualization_msgs::Marker toRos(const Mesh& mesh, const std_msgs::Header& header,
                                 const std::string& name_space, int id) {
  visualization_msgs::Marker marker;
  marker.header = header;
  marker.ns = name_space;
  marker.id = id;
  marker.type = visualization_msgs::Marker::TRIANGLE_LIST;
  marker.action = visualization_msgs::Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.scale.x = marker.scale.y = marker.scale.z = 1.0;
  marker.color.r = marker.color.g = marker.color.b = 0.7F;
  marker.color.a = 1.0F;
  marker.points.reserve(mesh.faces.size() * 3);
  const bool colored = mesh.vertices.hasColors();
  if (colored) marker.colors.reserve(mesh.faces.size() * 3);
  for (const auto& face : mesh.faces) {
    for (const std::uint32_t v : face) {
      const Eigen::Vector3f& p = mesh.vertices.points[v];
      geometry_msgs::Point point;
      point.x = static_cast<double>(p.x());
      point.y = static_cast<double>(p.y());
      point.z = static_cast<double>(p.z());
      marker.points.push_back(point);
      if (!colored) continue;
      const Rgb8& c = mesh.vertices.colors[v];
      std_msgs::ColorRGBA color;
      color.r = static_cast<float>(c.r) / 255.0F;
      color.g = static_cast<float>(c.g) / 255.0F;
      color.b = static_cast<float>(c.b) / 255.0F;
      color.a = 1.0F;
      marker.colors.push_back(color);
    }
  }
  return marker;
}

}  // namespace scanner::bridge
