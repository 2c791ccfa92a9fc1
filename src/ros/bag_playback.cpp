#include "ros/bag_playback.h"

#include <geometry_msgs/PoseStamped.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Imu.h>

#include <iomanip>
#include <sstream>

#include "scanner/ros/conversions.h"

namespace scanner::bridge {
namespace {

/// How far the streams of one recording may lag behind each other in the file.
constexpr double kReorderWindow_s = 2.0;
/// Turns smaller than this between the inertial sensor's frame and base_link are none.
constexpr double kNoRotation_rad = 1e-9;

std::string seconds(Time time) {
  std::ostringstream out;
  const std::int64_t ns = toNanoseconds(time);
  out << ns / 1000000000LL << '.' << std::setw(9) << std::setfill('0') << ns % 1000000000LL;
  return out.str();
}

}  // namespace

Playback::Playback(const Topics& topics, const Result<StereoCalibration>& calibration,
                   const StaticTransforms& transforms, const BagHandlers& handlers)
    : topics_(topics),
      calibration_(calibration),
      transforms_(transforms),
      merger_(handlers, fromSeconds(kReorderWindow_s)) {}

void Playback::note(const std::string& kind, const std::string& line) {
  if (noted_.insert(kind).second) statistics_.notes.push_back(line);
}

template <typename Message>
boost::shared_ptr<Message> Playback::convert(const rosbag::MessageInstance& instance) {
  std::string error;
  boost::shared_ptr<Message> message = read<Message>(instance, &error);
  if (!message) {
    ++statistics_.unreadable;
    note("unreadable " + instance.getTopic(), instance.getTopic() + ": message recorded at " +
                                                  seconds(fromRos(instance.getTime())) + " " +
                                                  error);
  }
  return message;
}

bool Playback::acceptStamp(Stream& stream, Time stamp, const rosbag::MessageInstance& instance) {
  const std::optional<Time> newest = stream.tracker.newest();
  if (stream.tracker.accept(stamp, fromRos(instance.getTime()))) return true;
  note("backward " + instance.getTopic(), instance.getTopic() + ": stamp " + seconds(stamp) +
                                              " is not after " + seconds(*newest) + ", skipped");
  return false;
}

void Playback::reject(Stream& stream, const rosbag::MessageInstance& instance,
                      const std::string& why) {
  ++stream.unusable;
  note("unusable " + instance.getTopic(), instance.getTopic() + ": " + why + ", skipped");
}

bool Playback::takeImage(const rosbag::MessageInstance& instance, bool left) {
  const auto message = convert<sensor_msgs::Image>(instance);
  if (!message) return true;
  Stream& stream = left ? left_ : right_;
  Result<Image> image = fromRos(*message);
  if (!image) return reject(stream, instance, image.status().message()), true;
  if (calibration_) {
    const CameraModel& camera = left ? calibration_->left : calibration_->right;
    if (image->data.cols != camera.width || image->data.rows != camera.height) {
      reject(stream, instance, "image size differs from camera_info's");
      return true;
    }
  }
  const Time stamp = fromRos(message->header.stamp);
  if (!acceptStamp(stream, stamp, instance)) return true;
  if (left) left_images_.insert(stamp);
  return left ? merger_.addLeft(stamp, std::move(*image))
              : merger_.addRight(stamp, std::move(*image));
}

void Playback::turn(ImuSample& sample, const std::string& frame) {
  if (frame.empty() || frame == topics_.base_frame || !transforms_.knows(frame)) return;
  const Result<Eigen::Isometry3d> T_base_imu = transforms_.lookup(topics_.base_frame, frame);
  if (!T_base_imu || rotationAngle(*T_base_imu) < kNoRotation_rad) return;
  sample = turned(sample, Eigen::Quaterniond(T_base_imu->linear()));
  note("turned imu", topics_.imu + ": samples are turned from " + frame + " to " +
                         topics_.base_frame + "; the lever arm is ignored");
}

bool Playback::takeImu(const rosbag::MessageInstance& instance) {
  const auto message = convert<sensor_msgs::Imu>(instance);
  if (!message) return true;
  Result<ImuSample> sample = fromRos(*message);
  if (!sample) return reject(imu_, instance, sample.status().message()), true;
  if (!acceptStamp(imu_, sample->stamp, instance)) return true;
  turn(*sample, frameName(message->header.frame_id));
  if (sample->orientation) ++statistics_.imu_oriented;
  return merger_.addImu(*sample);
}

void Playback::takeInfo(const rosbag::MessageInstance& instance, bool left) {
  const auto message = convert<sensor_msgs::CameraInfo>(instance);
  if (!message) return;
  if (left) left_infos_.insert(fromRos(message->header.stamp));
  if (!calibration_) return;
  const CameraModel& known = left ? calibration_->left : calibration_->right;
  const Result<CameraModel> camera = fromRos(*message);
  const bool same = camera && camera->width == known.width && camera->height == known.height &&
                    camera->D == known.D && camera->K == known.K && camera->R == known.R &&
                    camera->P == known.P;
  if (same) return;
  ++statistics_.calibration_changes;
  note("changed " + instance.getTopic(),
       instance.getTopic() + ": the calibration changes during the recording (first at " +
           seconds(fromRos(message->header.stamp)) + "); the first one is used");
}

void Playback::takeTruth(const rosbag::MessageInstance& instance) {
  const auto message = convert<geometry_msgs::PoseStamped>(instance);
  if (!message) return;
  Result<Eigen::Isometry3d> pose = fromRos(message->pose);
  if (!pose) return reject(truth_, instance, pose.status().message());
  const Time stamp = fromRos(message->header.stamp);
  if (acceptStamp(truth_, stamp, instance)) ground_truth_.push_back({stamp, *pose});
}

bool Playback::take(const rosbag::MessageInstance& instance) {
  const std::string& topic = instance.getTopic();
  if (topic == topics_.left_image) return takeImage(instance, true);
  if (topic == topics_.right_image) return takeImage(instance, false);
  if (topic == topics_.imu) return takeImu(instance);
  if (topic == topics_.left_info) takeInfo(instance, true);
  if (topic == topics_.right_info) takeInfo(instance, false);
  if (topic == topics_.ground_truth) takeTruth(instance);
  return true;
}

void Playback::noteUnpaired(const std::vector<Time>& stamps, const std::string& topic) {
  if (stamps.empty()) return;
  note("unpaired " + topic, topic + ": " + std::to_string(stamps.size()) +
                                " images without a partner of the same stamp, the first at " +
                                seconds(stamps.front()));
}

BagStatistics Playback::statistics() {
  BagStatistics& s = statistics_;
  s.left = left_.tracker.statistics(topics_.left_image, left_.unusable);
  s.right = right_.tracker.statistics(topics_.right_image, right_.unusable);
  s.imu = imu_.tracker.statistics(topics_.imu, imu_.unusable);
  s.ground_truth = truth_.tracker.statistics(topics_.ground_truth, truth_.unusable);
  s.frames = merger_.frames();
  s.unpaired_left = merger_.unpairedLeft().size();
  s.unpaired_right = merger_.unpairedRight().size();
  noteUnpaired(merger_.unpairedLeft(), topics_.left_image);
  noteUnpaired(merger_.unpairedRight(), topics_.right_image);
  for (const Time stamp : left_images_) s.images_without_info += left_infos_.count(stamp) == 0;
  if (s.images_without_info > 0) {
    note("info", topics_.left_info + ": " + std::to_string(s.images_without_info) +
                     " images without a camera_info of the same stamp");
  }
  if (s.imu.gaps > 0) {
    note("gap", topics_.imu + ": " + std::to_string(s.imu.gaps) + " gaps, the longest " +
                    std::to_string(s.imu.longest_gap_s) + " s");
  }
  return s;
}

}  // namespace scanner::bridge
