#include "scanner/ros/euroc_import.h"

#include <geometry_msgs/PoseStamped.h>
#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Imu.h>
#include <tf2_msgs/TFMessage.h>

#include <boost/make_shared.hpp>
#include <filesystem>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>

#include "ros/euroc_folder.h"
#include "scanner/ros/bag_reader.h"
#include "scanner/ros/conversions.h"

namespace scanner::bridge {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRightFrame = "bumblebee_right_optical";

struct Pair {
  Time stamp;
  std::string left, right;
};

std::vector<Pair> pairsOf(const EurocFolder& euroc, std::size_t* unpaired) {
  std::vector<Pair> pairs;
  auto right = euroc.right.images.begin();
  for (const auto& [stamp, path] : euroc.left.images) {
    while (right != euroc.right.images.end() && right->first < stamp) ++right;
    if (right == euroc.right.images.end() || right->first != stamp) continue;
    pairs.push_back({stamp, path, right->second});
  }
  *unpaired = euroc.left.images.size() + euroc.right.images.size() - 2 * pairs.size();
  return pairs;
}

cv::Mat toCv(const Eigen::MatrixXd& m) {
  cv::Mat out(static_cast<int>(m.rows()), static_cast<int>(m.cols()), CV_64F);
  for (int r = 0; r < out.rows; ++r) {
    for (int c = 0; c < out.cols; ++c) out.at<double>(r, c) = m(r, c);
  }
  return out;
}

Eigen::MatrixXd toEigen(const cv::Mat& m) {
  Eigen::MatrixXd out(m.rows, m.cols);
  for (int r = 0; r < m.rows; ++r) {
    for (int c = 0; c < m.cols; ++c) out(r, c) = m.at<double>(r, c);
  }
  return out;
}

/// Fills R and P of both cameras.
StereoCalibration rectified(const EurocFolder& euroc) {
  const Eigen::Isometry3d T_right_left =
      euroc.right.T_body_camera.inverse() * euroc.left.T_body_camera;
  StereoCalibration out{euroc.left.model, euroc.right.model};
  cv::Mat R1, R2, P1, P2, Q;
  cv::stereoRectify(toCv(out.left.K), out.left.D, toCv(out.right.K), out.right.D,
                    cv::Size(out.left.width, out.left.height), toCv(T_right_left.linear()),
                    toCv(T_right_left.translation()), R1, R2, P1, P2, Q, cv::CALIB_ZERO_DISPARITY,
                    0.0);
  out.left.R = toEigen(R1);
  out.right.R = toEigen(R2);
  out.left.P = toEigen(P1);
  out.right.P = toEigen(P2);
  return out;
}

/// Writes in the order of time; the streams are sorted already.
class EurocWriter {
 public:
  EurocWriter(const EurocFolder& euroc, const StereoCalibration& calibration,
              const std::string& path)
      : euroc_(euroc), calibration_(calibration) {
    bag_.open(path, rosbag::bagmode::Write);
  }

  void writeTransforms(Time stamp);
  void writeImuUpTo(Time stamp);
  void writeTruth(Time from, Time to);
  Status writePair(const Pair& pair);
  void close() { bag_.close(); }
  std::size_t samples() const { return next_sample_; }

 private:
  Status writeImage(const std::string& file, const CameraModel& camera, Time stamp,
                    const std::string& frame, const std::string& image_topic,
                    const std::string& info_topic);

  const EurocFolder& euroc_;
  const StereoCalibration& calibration_;
  Topics topics_;
  rosbag::Bag bag_;
  std::size_t next_sample_ = 0;
};

void EurocWriter::writeTransforms(Time stamp) {
  const Eigen::Isometry3d T_base_left = euroc_.T_body_imu.inverse() * euroc_.left.T_body_camera;
  const Eigen::Isometry3d T_left_right =
      euroc_.left.T_body_camera.inverse() * euroc_.right.T_body_camera;
  tf2_msgs::TFMessage message;
  message.transforms = {toRos(T_base_left, stamp, topics_.base_frame, topics_.camera_frame),
                        toRos(T_left_right, stamp, topics_.camera_frame, kRightFrame)};
  // Latched, so that a player offers it to nodes that come later.
  const auto connection = boost::make_shared<ros::M_string>();
  (*connection)["type"] = ros::message_traits::datatype(message);
  (*connection)["md5sum"] = ros::message_traits::md5sum(message);
  (*connection)["message_definition"] = ros::message_traits::definition(message);
  (*connection)["latching"] = "1";
  bag_.write(topics_.tf_static, rosTime(stamp), message, connection);
}

void EurocWriter::writeImuUpTo(Time stamp) {
  for (; next_sample_ < euroc_.samples.size() && euroc_.samples[next_sample_].stamp <= stamp;
       ++next_sample_) {
    const ImuSample& sample = euroc_.samples[next_sample_];
    bag_.write(topics_.imu, rosTime(sample.stamp), toRos(sample, topics_.base_frame));
  }
}

void EurocWriter::writeTruth(Time from, Time to) {
  for (const StampedPose& pose : euroc_.truth) {
    if (pose.stamp < from || pose.stamp > to) continue;
    geometry_msgs::PoseStamped message;
    message.header = makeHeader(pose.stamp, "map");
    message.pose = toRos(pose.T_map_base);
    bag_.write(topics_.ground_truth, rosTime(pose.stamp), message);
  }
}

Status EurocWriter::writeImage(const std::string& file, const CameraModel& camera, Time stamp,
                               const std::string& frame, const std::string& image_topic,
                               const std::string& info_topic) {
  Image image;
  image.data = cv::imread(file, cv::IMREAD_GRAYSCALE);
  if (image.data.empty()) return Status(StatusCode::kIoError, file + ": no readable picture");
  if (image.data.cols != camera.width || image.data.rows != camera.height) {
    return Status(StatusCode::kInvalidInput, file + ": the size differs from sensor.yaml's");
  }
  const std_msgs::Header header = makeHeader(stamp, frame);
  bag_.write(image_topic, header.stamp, toRos(image, header));
  bag_.write(info_topic, header.stamp, toRos(camera, header));
  return Status::ok();
}

Status EurocWriter::writePair(const Pair& pair) {
  if (Status status = writeImage(pair.left, calibration_.left, pair.stamp, topics_.camera_frame,
                                 topics_.left_image, topics_.left_info);
      !status) {
    return status;
  }
  return writeImage(pair.right, calibration_.right, pair.stamp, kRightFrame, topics_.right_image,
                    topics_.right_info);
}

}  // namespace

Result<EurocSummary> importEuroc(const std::string& directory, const std::string& bag_path,
                                 const EurocOptions& options,
                                 const std::function<bool(std::size_t, std::size_t)>& progress) {
  Result<EurocFolder> folder = readEuroc(directory);
  if (!folder) return folder.status();
  EurocFolder& euroc = *folder;
  EurocSummary summary;
  const std::vector<Pair> pairs = pairsOf(euroc, &summary.unpaired);
  if (pairs.empty()) {
    return Status(StatusCode::kNotEnoughData,
                  directory + ": no images with equal stamps in cam0 and cam1");
  }
  if (euroc.samples.empty()) {
    return Status(StatusCode::kNotEnoughData, directory + "/imu0/data.csv: no samples");
  }
  const StereoCalibration calibration = rectified(euroc);
  if (Status status = validate(calibration); !status) {
    return Status(status.code(), directory + ": " + status.message());
  }
  const Duration margin = fromSeconds(options.margin_s);
  const Time last = options.limit_to_images ? pairs.back().stamp + margin : Time::max();
  const Time first = options.limit_to_images ? pairs.front().stamp - margin : Time();
  const std::string temporary = bag_path + ".active";
  Status status;
  try {
    EurocWriter writer(euroc, calibration, temporary);
    writer.writeTransforms(std::min(pairs.front().stamp, euroc.samples.front().stamp));
    writer.writeTruth(first, last);
    for (std::size_t i = 0; status && i < pairs.size(); ++i) {
      writer.writeImuUpTo(pairs[i].stamp);
      status = writer.writePair(pairs[i]);
      if (progress && !progress(i + 1, pairs.size())) {
        status = Status(StatusCode::kIoError, bag_path + ": interrupted, nothing was written");
      }
    }
    if (status) writer.writeImuUpTo(last);
    writer.close();
    if (status) fs::rename(temporary, bag_path);
    summary.imu_samples = writer.samples();
  } catch (const std::exception& e) {
    status = Status(StatusCode::kIoError, bag_path + ": cannot be written (" + e.what() + ")");
  }
  if (!status) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    return status;
  }
  for (const StampedPose& pose : euroc.truth) {
    summary.truth_poses += pose.stamp >= first && pose.stamp <= last;
  }
  summary.pairs = pairs.size();
  summary.focal_length_px = calibration.focalLength();
  summary.baseline_m = calibration.baseline();
  return summary;
}

}  // namespace scanner::bridge
