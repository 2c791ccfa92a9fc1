#include "scanner/ros/bag_reader.h"

#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <filesystem>

#include "ros/bag_playback.h"
#include "scanner/ros/conversions.h"
#include "scanner/ros/static_transforms.h"

namespace scanner::bridge {
namespace {

Status ioError(const std::string& path, const std::string& what) {
  return Status(StatusCode::kIoError, path + ": " + what);
}

/// Opens the file, with one clear line for what goes wrong.
Status openBag(rosbag::Bag& bag, const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return ioError(path, "no such file");
  if (!std::filesystem::is_regular_file(path, error)) return ioError(path, "not a file");
  if (std::filesystem::file_size(path, error) == 0) return ioError(path, "the file is empty");
  try {
    bag.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagUnindexedException&) {
    return ioError(path,
                   "the bag has no index (the recording was cut short); `rosbag reindex` "
                   "recovers what is in it");
  } catch (const std::exception& e) {
    return ioError(path, std::string("not a readable bag, truncated or corrupt (") + e.what() +
                             "); `rosbag reindex` may recover what is in it");
  }
  return Status::ok();
}

}  // namespace

struct BagReader::Contents {
  explicit Contents(Topics t) : topics(std::move(t)) {}

  template <typename Message>
  boost::shared_ptr<Message> first(const std::string& topic);
  Result<CameraModel> firstCamera(const std::string& topic);
  void readTransforms();
  void readRig();
  Result<StereoCalibration> readCalibration();
  Status missing(const std::string& topic, const char* what);
  Status checkImages();

  std::string path;
  Topics topics;
  rosbag::Bag bag;
  std::map<std::string, std::pair<std::string, std::size_t>> index;  ///< topic: type, messages
  StaticTransforms transforms;
  Result<StereoCalibration> calibration = Status(StatusCode::kNotEnoughData, "no calibration");
  Result<Rig> rig = Status(StatusCode::kNotEnoughData, "no /tf_static in the bag");
  Status scannable;
  std::string camera_frame;
  Trajectory ground_truth;
};

template <typename Message>
boost::shared_ptr<Message> BagReader::Contents::first(const std::string& topic) {
  rosbag::View view(bag, rosbag::TopicQuery(topic));
  std::string error;
  for (const rosbag::MessageInstance& instance : view) {
    if (auto message = read<Message>(instance, &error)) return message;
  }
  return nullptr;
}

Status BagReader::Contents::missing(const std::string& topic, const char* what) {
  const auto found = index.find(topic);
  if (found != index.end() && found->second.second > 0) return Status::ok();
  std::string alternatives;
  for (const auto& [name, entry] : index) {
    if (entry.first == what) alternatives += (alternatives.empty() ? "" : ", ") + name;
  }
  return Status(StatusCode::kNotEnoughData,
                path + ": no messages on " + topic + " (" + what + ")" +
                    (alternatives.empty() ? "" : "; the bag has " + alternatives));
}

Result<CameraModel> BagReader::Contents::firstCamera(const std::string& topic) {
  if (Status status = missing(topic, "sensor_msgs/CameraInfo"); !status) return status;
  const auto message = first<sensor_msgs::CameraInfo>(topic);
  if (!message) return ioError(path, "no readable message on " + topic);
  Result<CameraModel> camera = fromRos(*message);
  if (!camera) {
    return Status(camera.status().code(), path + ": " + topic + ": " + camera.status().message());
  }
  return camera;
}

Result<StereoCalibration> BagReader::Contents::readCalibration() {
  Result<CameraModel> left = firstCamera(topics.left_info);
  if (!left) return left.status();
  Result<CameraModel> right = firstCamera(topics.right_info);
  if (!right) return right.status();
  StereoCalibration pair{*left, *right};
  if (Status status = validate(pair); !status) {
    return Status(status.code(), path + ": camera_info: " + status.message());
  }
  return pair;
}

void BagReader::Contents::readTransforms() {
  rosbag::View view(bag, rosbag::TopicQuery(topics.tf_static));
  std::string error;
  for (const rosbag::MessageInstance& instance : view) {
    const auto message = read<tf2_msgs::TFMessage>(instance, &error);
    if (!message) continue;
    for (const geometry_msgs::TransformStamped& t : message->transforms) {
      Result<Eigen::Isometry3d> T = fromRos(t.transform);
      if (T) transforms.add(t.header.frame_id, t.child_frame_id, *T);
    }
  }
}

void BagReader::Contents::readRig() {
  if (transforms.empty()) {
    rig = Status(StatusCode::kNotEnoughData,
                 path + ": no transforms on " + topics.tf_static + ", so the rig is unknown");
    return;
  }
  Result<Eigen::Isometry3d> T = transforms.lookup(topics.base_frame, camera_frame);
  if (!T) {
    rig = Status(T.status().code(), path + ": " + topics.tf_static + ": " + T.status().message());
    return;
  }
  Rig found;
  found.T_base_camera = *T;
  rig = found;
}

Status BagReader::Contents::checkImages() {
  for (const std::string& topic : {topics.left_image, topics.right_image}) {
    if (Status status = missing(topic, "sensor_msgs/Image"); !status) return status;
    const auto message = first<sensor_msgs::Image>(topic);
    if (!message) return ioError(path, "no readable message on " + topic);
    if (topic == topics.left_image && !message->header.frame_id.empty()) {
      camera_frame = frameName(message->header.frame_id);
    }
    const Result<Image> image = fromRos(*message);
    if (!image) {
      return Status(image.status().code(), path + ": " + topic + ": " + image.status().message());
    }
    if (!calibration) continue;
    const CameraModel& camera = topic == topics.left_image ? calibration->left : calibration->right;
    if (image->data.cols != camera.width || image->data.rows != camera.height) {
      return Status(StatusCode::kInvalidInput,
                    path + ": " + topic + " is " + std::to_string(image->data.cols) + "x" +
                        std::to_string(image->data.rows) + ", its camera_info says " +
                        std::to_string(camera.width) + "x" + std::to_string(camera.height));
    }
  }
  return Status::ok();
}

Result<BagReader> BagReader::open(const std::string& path, const Topics& topics) {
  auto contents = std::make_unique<Contents>(topics);
  Contents& c = *contents;
  c.path = path;
  if (Status status = openBag(c.bag, path); !status) return status;
  try {
    rosbag::View all(c.bag);
    for (const rosbag::ConnectionInfo* connection : all.getConnections()) {
      c.index[connection->topic].first = connection->datatype;
    }
    for (auto& [topic, entry] : c.index) {
      entry.second = rosbag::View(c.bag, rosbag::TopicQuery(topic)).size();
    }
    c.camera_frame = topics.camera_frame;
    c.readTransforms();
    c.calibration = c.readCalibration();
    c.scannable = c.checkImages();
    c.readRig();
    if (c.scannable && !c.calibration) c.scannable = c.calibration.status();
    if (c.scannable) c.scannable = c.missing(topics.imu, "sensor_msgs/Imu");
  } catch (const std::exception& e) {
    return ioError(path, std::string("corrupt bag (") + e.what() +
                             "); `rosbag reindex` may recover what is in it");
  }
  return BagReader(std::move(contents));
}

BagReader::BagReader(std::unique_ptr<Contents> contents) : contents_(std::move(contents)) {}
BagReader::BagReader(BagReader&&) noexcept = default;
BagReader& BagReader::operator=(BagReader&&) noexcept = default;
BagReader::~BagReader() = default;

const std::string& BagReader::path() const { return contents_->path; }
const Topics& BagReader::topics() const { return contents_->topics; }
Status BagReader::checkScannable() const { return contents_->scannable; }
const Result<StereoCalibration>& BagReader::calibration() const { return contents_->calibration; }
const Result<Rig>& BagReader::rig() const { return contents_->rig; }
const StaticTransforms& BagReader::transforms() const { return contents_->transforms; }
const Trajectory& BagReader::groundTruth() const { return contents_->ground_truth; }

std::size_t BagReader::expectedFrames() const {
  const auto left = contents_->index.find(contents_->topics.left_image);
  const auto right = contents_->index.find(contents_->topics.right_image);
  if (left == contents_->index.end() || right == contents_->index.end()) return 0;
  return std::min(left->second.second, right->second.second);
}

std::vector<std::string> BagReader::contents() const {
  std::vector<std::string> lines;
  for (const auto& [topic, entry] : contents_->index) lines.push_back(topic + " " + entry.first);
  return lines;
}

BagStatistics BagReader::play(const BagHandlers& handlers) {
  Contents& c = *contents_;
  const Topics& t = c.topics;
  Playback playback(t, c.calibration, c.transforms, handlers);
  rosbag::View view(c.bag, rosbag::TopicQuery({t.left_image, t.right_image, t.left_info,
                                               t.right_info, t.imu, t.ground_truth}));
  bool going = true;
  for (auto it = view.begin(); going && it != view.end(); ++it) going = playback.take(*it);
  if (going) playback.finish();
  c.ground_truth = playback.takeGroundTruth();
  return playback.statistics();
}

}  // namespace scanner::bridge
