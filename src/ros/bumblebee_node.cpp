#include "scanner/ros/bumblebee_node.h"

#include <dynamic_reconfigure/server.h>
#include <image_transport/image_transport.h>
#include <ros/callback_queue.h>
#include <ros/console.h>
#include <ros/spinner.h>

#include <mutex>
#include <nlohmann/json.hpp>

#include "ros/bumblebee_node_calibration.h"
#include "ros/bumblebee_node_diagnostics.h"
#include "ros/recording_writer.h"
#include "scanner/BumblebeeConfig.h"
#include "scanner/GetRegister.h"
#include "scanner/SetRegister.h"
#include "scanner/bumblebee/driver.h"
#include "scanner/ros/conversions.h"
#include "scanner/ros/parameters.h"

namespace scanner::bridge {
namespace {

using bumblebee::CapturedPair;
using bumblebee::DriverOptions;
using bumblebee::DriverState;
using bumblebee::DriverStatistics;
using Config = scanner::BumblebeeConfig;

constexpr const char* kBlock = "bumblebee";
constexpr int kTopicQueue = 30;

/// Between the options of the driver and the message of dynamic_reconfigure, either way.
template <typename From, typename To>
void copyControls(const From& from, To& to) {
  to.auto_exposure = from.auto_exposure;
  to.exposure_s = from.exposure_s;
  to.gain_db = from.gain_db;
  to.auto_exposure_max_s = from.auto_exposure_max_s;
  to.auto_target = from.auto_target;
  to.white_balance_blue = from.white_balance_blue;
  to.white_balance_red = from.white_balance_red;
  to.rate_hz = from.rate_hz;
}

BumblebeeNodeOptions loadNodeOptions(const ros::NodeHandle& private_nh) {
  BumblebeeNodeOptions options;
  loadPrivate(private_nh, {kBlock}, options);
  return options;
}

DriverOptions loadDriverOptions(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh) {
  ParameterTree block = parameterBlock(nh, private_nh, kBlock);
  // A serial number is digits, which launch files and command lines make a number.
  const auto address = block.is_object() ? block.find("address") : block.end();
  if (address != block.end() && address->is_number_integer()) *address = address->dump();
  DriverOptions options;
  loadOptions(block, kBlock, options);
  return options;
}

/// What the driver says about the camera, in the log, when it changes.
class StateLog {
 public:
  void tell(const DriverStatistics& now) {
    const bool streaming = now.state == DriverState::kStreaming;
    const bool again = now.connections != connections_;
    if (streaming && (again || !streaming_)) {
      if (streaming_) ROS_WARN("the camera was away for a moment");
      ROS_INFO("streaming from %s %s (%s), %dx%d", now.camera.model.c_str(),
               now.camera.serial.c_str(), bumblebee::toString(now.camera.transport),
               now.format.width_px, now.format.height_px);
      problem_.clear();
    }
    if (!now.problem.empty() && now.problem != problem_) {
      ROS_WARN("%s%s", streaming ? "" : "no images: ", now.problem.c_str());
      problem_ = now.problem;
    }
    // Without a problem the search goes on as before.
    if (streaming || !now.problem.empty()) streaming_ = streaming;
    connections_ = now.connections;
  }

 private:
  bool streaming_ = false;
  std::uint64_t connections_ = 0;
  std::string problem_;
};

}  // namespace

void describe(OptionVisitor& v, BumblebeeNodeOptions& o) {
  v.option("left_camera_info_url", o.left_camera_info_url,
           "where camera_info_manager keeps the calibration of the left eye; empty: "
           "file://${ROS_HOME}/camera_info/${NAME}.yaml");
  v.option("right_camera_info_url", o.right_camera_info_url, "the same, of the right eye");
  v.option("rig", o.rig, "rig file; where it carries the cameras, they are the calibration");
}

class BumblebeeNode::Impl {
 public:
  Impl(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~Impl();

 private:
  struct Eye {
    std::string frame_id;
    image_transport::Publisher image;
    ros::Publisher info;
  };

  Eye advertise(const std::string& name, const std::string& frame_id);
  void offerControls(ros::NodeHandle private_nh);
  void onPair(const CapturedPair& pair);
  static void publish(const Eye& eye, const Image& image, sensor_msgs::CameraInfo* info,
                      Time stamp);
  void reconfigure(Config& config);
  DriverOptions options() const;
  void report(DiagnosticStatus& status);

  ros::NodeHandle nh_;
  image_transport::ImageTransport transport_;
  BumblebeeCalibration calibration_;
  Eye left_, right_;

  mutable std::mutex options_mutex_;
  DriverOptions options_;

  // Held by the driver's thread while it publishes: driver_ is set, and lives.
  std::mutex driver_mutex_;
  bool stopping_ = false;
  std::unique_ptr<bumblebee::Driver> driver_;

  ros::CallbackQueue control_queue_;  // a camera's answer takes a while
  ros::ServiceServer get_register_, set_register_;
  std::unique_ptr<dynamic_reconfigure::Server<Config>> server_;
  std::unique_ptr<ros::AsyncSpinner> control_spinner_;

  StateLog log_;
  BumblebeeReport report_;
  std::unique_ptr<Diagnostics> diagnostics_;
};

BumblebeeNode::Impl::Impl(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : nh_(nh),
      transport_(nh),
      calibration_(nh, loadNodeOptions(private_nh)),
      left_(advertise("left", Topics().camera_frame)),
      right_(advertise("right", kRightCameraFrame)),
      options_(loadDriverOptions(nh, private_nh)) {
  {
    const std::lock_guard<std::mutex> lock(driver_mutex_);
    driver_ = std::make_unique<bumblebee::Driver>(
        options_, [this](const CapturedPair& pair) { onPair(pair); });
  }
  offerControls(private_nh);
  diagnostics_ = std::make_unique<Diagnostics>(
      nh_, private_nh, kBlock, [this](DiagnosticStatus& status) { report(status); });
}

BumblebeeNode::Impl::~Impl() {
  diagnostics_.reset();
  control_spinner_.reset();
  server_.reset();
  {
    const std::lock_guard<std::mutex> lock(driver_mutex_);
    stopping_ = true;
  }
  driver_.reset();
}

BumblebeeNode::Impl::Eye BumblebeeNode::Impl::advertise(const std::string& name,
                                                        const std::string& frame_id) {
  const std::string place = "bumblebee/" + name;
  return {frame_id, transport_.advertise(place + "/image_raw", kTopicQueue),
          nh_.advertise<sensor_msgs::CameraInfo>(place + "/camera_info", kTopicQueue)};
}

void BumblebeeNode::Impl::offerControls(ros::NodeHandle private_nh) {
  private_nh.setCallbackQueue(&control_queue_);
  get_register_ = private_nh.advertiseService<GetRegister::Request, GetRegister::Response>(
      "get_register", [this](GetRegister::Request& request, GetRegister::Response& response) {
        const Result<std::uint32_t> value = driver_->readRegister(request.offset);
        response.success = value.isOk();
        response.message = value.status().message();
        if (value) response.value = *value;
        return true;
      });
  set_register_ = private_nh.advertiseService<SetRegister::Request, SetRegister::Response>(
      "set_register", [this](SetRegister::Request& request, SetRegister::Response& response) {
        const Status written = driver_->writeRegister(request.offset, request.value);
        response.success = written.isOk();
        response.message = written.message();
        if (!written) return true;
        const Result<std::uint32_t> value = driver_->readRegister(request.offset);
        response.message = value.status().message();
        if (value) response.value = *value;
        return true;
      });
  // The server reads and writes the very parameters that the block was loaded from.
  const ros::NodeHandle block(private_nh, kBlock);
  Config config = Config::__getDefault__();
  copyControls(options_, config);
  config.__toServer__(block);
  server_ = std::make_unique<dynamic_reconfigure::Server<Config>>(block);
  server_->setCallback([this](Config& wanted, std::uint32_t) { reconfigure(wanted); });
  control_spinner_ = std::make_unique<ros::AsyncSpinner>(1, &control_queue_);
  control_spinner_->start();
}

void BumblebeeNode::Impl::onPair(const CapturedPair& pair) {
  const std::lock_guard<std::mutex> lock(driver_mutex_);
  const Time stamp = pair.frame.stamp;
  if (stopping_ || !toRos(stamp)) return;
  calibration_.useCamera(driver_->statistics().camera.serial);
  std::optional<BumblebeeCalibration::Infos> infos =
      calibration_.infos(pair.frame.left.data.cols, pair.frame.left.data.rows, stamp);
  publish(left_, pair.frame.left, infos ? &infos->first : nullptr, stamp);
  publish(right_, pair.frame.right, infos ? &infos->second : nullptr, stamp);
}

void BumblebeeNode::Impl::publish(const Eye& eye, const Image& image, sensor_msgs::CameraInfo* info,
                                  Time stamp) {
  const std_msgs::Header header = makeHeader(stamp, eye.frame_id);
  if (info != nullptr) {
    info->header = header;
    eye.info.publish(*info);
  }
  if (eye.image.getNumSubscribers() == 0) return;
  eye.image.publish(boost::make_shared<sensor_msgs::Image>(toRos(image, header)));
}

/// In the thread of the controls only.
void BumblebeeNode::Impl::reconfigure(Config& config) {
  DriverOptions wanted = options();
  copyControls(config, wanted);
  try {
    const Status status = driver_->reconfigure(wanted);
    // Kept all the same: the next camera may take it.
    if (!status) ROS_WARN("not as asked: %s", status.message().c_str());
    const std::lock_guard<std::mutex> lock(options_mutex_);
    options_ = wanted;
  } catch (const ConfigurationError& error) {  // dynamic_reconfigure lets NaN through
    ROS_WARN("not reconfigured: %s", error.what());
    copyControls(options(), config);
  }
}

DriverOptions BumblebeeNode::Impl::options() const {
  const std::lock_guard<std::mutex> lock(options_mutex_);
  return options_;
}

void BumblebeeNode::Impl::report(DiagnosticStatus& status) {
  const DriverStatistics now = driver_->statistics();
  log_.tell(now);
  const DriverOptions wanted = options();
  const bool file = now.camera.transport == bumblebee::Transport::kFile;
  const double wanted_rate_hz = file ? wanted.bus.file_rate_hz : wanted.rate_hz;
  report_.fill(now, wanted_rate_hz, calibration_.verdict(), BumblebeeReport::Clock::now(), status);
}

BumblebeeNode::BumblebeeNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : impl_(std::make_unique<Impl>(nh, private_nh)) {}
BumblebeeNode::~BumblebeeNode() = default;

}  // namespace scanner::bridge
