#include "scanner/ros/stereo_node.h"

#include <image_transport/image_transport.h>
#include <image_transport/subscriber_filter.h>
#include <message_filters/subscriber.h>
#include <message_filters/sync_policies/exact_time.h>
#include <message_filters/synchronizer.h>
#include <ros/console.h>
#include <sensor_msgs/CompressedImage.h>

#include <atomic>
#include <boost/bind/bind.hpp>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <thread>

#include "ros/diagnostics.h"
#include "ros/static_broadcast.h"
#include "scanner/ros/conversions.h"
#include "scanner/ros/parameters.h"
#include "scanner/ros/work_queue.h"
#include "scanner/stereo/stereo_processor.h"

namespace scanner::bridge {
namespace {

constexpr int kTopicQueue = 200;
constexpr double kLogPeriod_s = 5.0;

struct StereoNodeOptions {
  int threads = 0;
  int viewfinder_width_px = 320;
  int viewfinder_quality = 60;
  double viewfinder_rate_hz = 5.0;
};

void describe(OptionVisitor& v, StereoNodeOptions& o) {
  v.option("threads", o.threads, {0, 256}, "", "threads to use; 0: all processors");
  v.option("viewfinder_width_px", o.viewfinder_width_px, {16, 4096}, "px",
           "width of the viewfinder picture");
  v.option("viewfinder_quality", o.viewfinder_quality, {1, 100}, "", "JPEG quality of the same");
  v.option("viewfinder_rate_hz", o.viewfinder_rate_hz, {0.1, 100.0}, "Hz",
           "at most so many viewfinder pictures per second");
}

struct Pair {
  sensor_msgs::ImageConstPtr left, right;
  sensor_msgs::CameraInfoConstPtr left_info, right_info;
};

bool sameCalibration(const sensor_msgs::CameraInfo& a, const sensor_msgs::CameraInfo& b) {
  return a.width == b.width && a.height == b.height && a.D == b.D && a.K == b.K && a.R == b.R &&
         a.P == b.P && a.distortion_model == b.distortion_model && a.binning_x == b.binning_x;
}

Result<StereoCalibration> toCalibration(const Pair& pair) {
  Result<CameraModel> left = fromRos(*pair.left_info);
  if (!left) return Status(left.status().code(), "left " + left.status().message());
  Result<CameraModel> right = fromRos(*pair.right_info);
  if (!right) return Status(right.status().code(), "right " + right.status().message());
  StereoCalibration calibration{*left, *right};
  if (Status status = validate(calibration); !status) {
    return Status(status.code(), "camera_info: " + status.message());
  }
  return calibration;
}

}  // namespace

class StereoNode::Impl {
 public:
  Impl(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~Impl();

 private:
  using Policy =
      message_filters::sync_policies::ExactTime<sensor_msgs::Image, sensor_msgs::Image,
                                                sensor_msgs::CameraInfo, sensor_msgs::CameraInfo>;

  void subscribe();
  void onPair(const sensor_msgs::ImageConstPtr& left, const sensor_msgs::ImageConstPtr& right,
              const sensor_msgs::CameraInfoConstPtr& left_info,
              const sensor_msgs::CameraInfoConstPtr& right_info);
  void work(const Pair& pair);
  Status prepare(const Pair& pair);
  Result<stereo::StereoProcessor::Output> process(const Pair& pair);
  void publish(const stereo::StereoProcessor::Output& output);
  void publishViewfinder(const stereo::StereoProcessor::Output& output);
  void fail(const Pair& pair, const Status& status);
  void report(DiagnosticStatus& status);

  ros::NodeHandle nh_;
  image_transport::ImageTransport transport_;
  StereoNodeOptions options_;
  stereo::StereoOptions stereo_options_;
  int threads_ = 1;

  image_transport::SubscriberFilter left_, right_;
  message_filters::Subscriber<sensor_msgs::CameraInfo> left_info_, right_info_;
  std::unique_ptr<message_filters::Synchronizer<Policy>> synchronizer_;
  std::atomic<std::size_t> received_[4] = {};

  ros::Publisher points_, disparity_, viewfinder_;
  image_transport::Publisher rectified_;
  std::shared_ptr<StaticBroadcast> static_tf_ = StaticBroadcast::shared();

  // Of the worker only.
  std::optional<stereo::StereoProcessor> processor_;
  std::optional<stereo::RangeTracker> range_;
  sensor_msgs::CameraInfoConstPtr known_left_, known_right_;
  std::string frame_;
  ros::WallTime viewfinder_at_;

  std::mutex report_mutex_;
  std::size_t paired_ = 0, processed_ = 0, failed_ = 0;
  std::string trouble_, warning_;
  stereo::StereoStatistics newest_;

  std::unique_ptr<WorkQueue<Pair>> queue_;
  std::unique_ptr<Diagnostics> diagnostics_;
};

StereoNode::Impl::Impl(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : nh_(nh), transport_(nh) {
  loadPrivate(private_nh, {"stereo"}, options_);
  loadBlock(nh, private_nh, "stereo", stereo_options_);
  stereo::validate(stereo_options_);
  threads_ = options_.threads > 0
                 ? options_.threads
                 : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  points_ = nh_.advertise<sensor_msgs::PointCloud2>("stereo/points", 0);
  disparity_ = nh_.advertise<stereo_msgs::DisparityImage>("stereo/disparity", 2);
  viewfinder_ = nh_.advertise<sensor_msgs::CompressedImage>("stereo/left/viewfinder/compressed", 1);
  rectified_ = transport_.advertise("stereo/left/image_rect_color", 2);
  queue_ = std::make_unique<WorkQueue<Pair>>([this](Pair& pair) { work(pair); });
  diagnostics_ = std::make_unique<Diagnostics>(
      nh_, private_nh, "stereo", [this](DiagnosticStatus& status) { report(status); });
  subscribe();
}

StereoNode::Impl::~Impl() {
  left_.unsubscribe();
  right_.unsubscribe();
  left_info_.unsubscribe();
  right_info_.unsubscribe();
  diagnostics_.reset();
  queue_->stop();
}

void StereoNode::Impl::subscribe() {
  const image_transport::TransportHints hints("raw", ros::TransportHints().tcpNoDelay());
  left_.subscribe(transport_, "bumblebee/left/image_raw", kTopicQueue, hints);
  right_.subscribe(transport_, "bumblebee/right/image_raw", kTopicQueue, hints);
  left_info_.subscribe(nh_, "bumblebee/left/camera_info", kTopicQueue);
  right_info_.subscribe(nh_, "bumblebee/right/camera_info", kTopicQueue);
  left_.registerCallback([this](const sensor_msgs::ImageConstPtr&) { ++received_[0]; });
  right_.registerCallback([this](const sensor_msgs::ImageConstPtr&) { ++received_[1]; });
  left_info_.registerCallback([this](const sensor_msgs::CameraInfoConstPtr&) { ++received_[2]; });
  right_info_.registerCallback([this](const sensor_msgs::CameraInfoConstPtr&) { ++received_[3]; });
  synchronizer_ = std::make_unique<message_filters::Synchronizer<Policy>>(
      Policy(kTopicQueue), left_, right_, left_info_, right_info_);
  namespace bind = boost::placeholders;
  synchronizer_->registerCallback(
      boost::bind(&Impl::onPair, this, bind::_1, bind::_2, bind::_3, bind::_4));
}

void StereoNode::Impl::onPair(const sensor_msgs::ImageConstPtr& left,
                              const sensor_msgs::ImageConstPtr& right,
                              const sensor_msgs::CameraInfoConstPtr& left_info,
                              const sensor_msgs::CameraInfoConstPtr& right_info) {
  {
    const std::lock_guard<std::mutex> lock(report_mutex_);
    ++paired_;
  }
  queue_->push({left, right, left_info, right_info});
}

Status StereoNode::Impl::prepare(const Pair& pair) {
  const bool known = processor_ && sameCalibration(*pair.left_info, *known_left_) &&
                     sameCalibration(*pair.right_info, *known_right_);
  if (known) return Status::ok();
  processor_.reset();
  Result<StereoCalibration> calibration = toCalibration(pair);
  if (!calibration) return calibration.status();
  try {
    processor_.emplace(*calibration, stereo_options_, threads_);
    range_.emplace(processor_->makeRangeTracker());
  } catch (const ConfigurationError& e) {
    return Status(StatusCode::kInvalidInput, e.what());
  }
  known_left_ = pair.left_info;
  known_right_ = pair.right_info;
  frame_ = pair.left->header.frame_id + "_rectified";
  // camera_info's R turns raw to rectified coordinates: R_rectified_raw.
  Eigen::Isometry3d T_raw_rectified = Eigen::Isometry3d::Identity();
  T_raw_rectified.linear() = calibration->left.R.transpose();
  static_tf_->send({toRos(T_raw_rectified, fromRos(pair.left->header.stamp),
                          pair.left->header.frame_id, frame_)});
  return Status::ok();
}

Result<stereo::StereoProcessor::Output> StereoNode::Impl::process(const Pair& pair) {
  if (Status status = prepare(pair); !status) return status;
  Result<Image> left = fromRos(*pair.left);
  if (!left) return left.status();
  Result<Image> right = fromRos(*pair.right);
  if (!right) return right.status();
  return processor_->process({fromRos(pair.left->header.stamp), *left, *right}, &*range_);
}

void StereoNode::Impl::work(const Pair& pair) {
  try {
    const Result<stereo::StereoProcessor::Output> output = process(pair);
    if (!output) return fail(pair, output.status());
    publish(*output);
    const std::lock_guard<std::mutex> lock(report_mutex_);
    ++processed_;
    newest_ = output->statistics;
    const stereo::Trouble& trouble = output->trouble;
    trouble_ = trouble.hopeless ? trouble.line : "";
    warning_ = trouble.hopeless ? "" : trouble.line;
  } catch (const std::exception& e) {
    fail(pair, Status(StatusCode::kInvalidInput, e.what()));
  }
}

void StereoNode::Impl::fail(const Pair& pair, const Status& status) {
  ROS_WARN_STREAM_THROTTLE(kLogPeriod_s, "stereo: pair skipped: " << status.message());
  {
    const std::lock_guard<std::mutex> lock(report_mutex_);
    ++failed_;
    trouble_ = status.message();
  }
  std_msgs::Header header = pair.left->header;
  header.frame_id += "_rectified";
  points_.publish(toRos(PointCloud(), header));
}

void StereoNode::Impl::publish(const stereo::StereoProcessor::Output& output) {
  if (rectified_.getNumSubscribers() > 0) {
    rectified_.publish(toRos(Image{output.rectified.left_color, PixelFormat::kBgr8},
                             makeHeader(output.rectified.stamp, frame_)));
  }
  if (disparity_.getNumSubscribers() > 0) {
    disparity_.publish(toRos(output.disparity, processor_->calibration(), frame_));
  }
  publishViewfinder(output);
  points_.publish(
      boost::make_shared<const sensor_msgs::PointCloud2>(toRos(output.cloud, frame_, threads_)));
}

void StereoNode::Impl::publishViewfinder(const stereo::StereoProcessor::Output& output) {
  if (viewfinder_.getNumSubscribers() == 0) return;
  const ros::WallTime now = ros::WallTime::now();
  if ((now - viewfinder_at_).toSec() < 1.0 / options_.viewfinder_rate_hz) return;
  viewfinder_at_ = now;
  const cv::Mat& picture = output.rectified.left_color;
  const int width = std::min(options_.viewfinder_width_px, picture.cols);
  const int height = std::max(1, picture.rows * width / picture.cols);
  cv::Mat small;
  cv::resize(picture, small, cv::Size(width, height), 0.0, 0.0, cv::INTER_AREA);
  sensor_msgs::CompressedImage message;
  message.header = makeHeader(output.rectified.stamp, frame_);
  message.format = "bgr8; jpeg compressed bgr8";
  cv::imencode(".jpg", small, message.data,
               {cv::IMWRITE_JPEG_QUALITY, options_.viewfinder_quality});
  viewfinder_.publish(message);
}

void StereoNode::Impl::report(DiagnosticStatus& status) {
  const std::lock_guard<std::mutex> lock(report_mutex_);
  status.summary(kDiagnosticOk, "working");
  const std::string topics[] = {left_.getTopic(), right_.getTopic(), left_info_.getTopic(),
                                right_info_.getTopic()};
  if (failed_ > 0) status.mergeSummary(kDiagnosticWarn, "pairs were skipped");
  if (!warning_.empty()) status.mergeSummary(kDiagnosticWarn, warning_);
  if (!trouble_.empty()) status.summary(kDiagnosticError, trouble_);
  if (paired_ == 0 && received_[0] > 0 && received_[1] > 0 && received_[2] > 0) {
    status.summary(kDiagnosticError, "stamps of images and camera_infos are never equal");
  }
  for (int i = 3; i >= 0; --i) {
    if (received_[i] > 0) continue;
    status.summary(kDiagnosticError,
                   std::string(i < 2 ? "no images on " : "no camera_info on ") + topics[i]);
  }
  const std::size_t most = std::max(received_[0].load(), received_[1].load());
  status.add("pairs received", paired_);
  status.add("images without partner", most - std::min(most, paired_));
  status.add("pairs processed", processed_);
  status.add("pairs skipped", failed_);
  status.add("queue length", queue_->size());
  status.add("density", newest_.density);
  status.add("matcher's memory, MB",
             static_cast<double>(newest_.match.working_memory_bytes) * 1e-6);
  status.add("seconds per pair",
             newest_.rectify_s + newest_.match_s + newest_.triangulate_s + newest_.normals_s);
}

StereoNode::StereoNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : impl_(std::make_unique<Impl>(nh, private_nh)) {}
StereoNode::~StereoNode() = default;

}  // namespace scanner::bridge
