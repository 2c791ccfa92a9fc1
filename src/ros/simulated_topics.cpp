#include <geometry_msgs/PoseStamped.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Imu.h>

#include <thread>

#include "ros/recording_writer.h"
#include "ros/simulated_rig.h"
#include "scanner/ros/conversions.h"

namespace scanner::bridge {

using simulation::FrameStore;
using simulation::MtiSample;
using simulation::Simulation;

TruthPublisher::TruthPublisher(const ros::NodeHandle& nh, const Simulation& simulation)
    : simulation_(simulation), static_tf_(StaticBroadcast::shared()) {
  const Topics topics;
  publisher_ = ros::NodeHandle(nh).advertise<geometry_msgs::PoseStamped>(topics.ground_truth, 1000);
  const simulation::SimulatedRig& rig = simulation.rig();
  static_tf_->send({toRos(rig.T_base_camera, Time(), topics.base_frame, topics.camera_frame),
                    toRos(rig.T_left_right, Time(), topics.camera_frame, kRightCameraFrame)});
}

void TruthPublisher::publish(double time_s, Time stamp) {
  geometry_msgs::PoseStamped message;
  message.header = makeHeader(stamp, "map");
  message.pose = toRos(simulation_.motion().at(time_s).T_map_base);
  publisher_.publish(message);
}

void Pacer::begin(Duration delay) {
  start_ = std::chrono::steady_clock::now() + delay;
  start_stamp_ = fromRos(ros::Time::now()) + delay;
}

double Pacer::now() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

bool Pacer::waitUntil(double time_s) {
  std::unique_lock<std::mutex> lock(mutex_);
  return !stopped_.wait_until(lock, start_ + fromSeconds(time_s), [this] { return stop_; });
}

void Pacer::stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  stopped_.notify_all();
}

namespace {

/// Between the middle of the exposure and the arrival of the picture: half the exposure, read-out
/// and transfer at the camera's 15 pictures a second.
constexpr double kReadoutS = 1.0 / 15.0;
/// The MTi's computing and the 115200 baud line (docs/conventions.md).
constexpr double kSampleLatencyS = 0.0088;
constexpr Duration kLead = fromSeconds(0.5);

class SimulatedTopics : public SimulatedRig {
 public:
  SimulatedTopics(ros::NodeHandle nh, const Simulation& simulation, FrameStore& frames)
      : simulation_(simulation), frames_(frames), truth_(nh, simulation) {
    constexpr int kQueue = 1000;
    left_ = nh.advertise<sensor_msgs::Image>(topics_.left_image, kQueue);
    right_ = nh.advertise<sensor_msgs::Image>(topics_.right_image, kQueue);
    left_info_ = nh.advertise<sensor_msgs::CameraInfo>(topics_.left_info, kQueue);
    right_info_ = nh.advertise<sensor_msgs::CameraInfo>(topics_.right_info, kQueue);
    imu_ = nh.advertise<sensor_msgs::Imu>(topics_.imu, kQueue);
  }

  void run() override {
    pacer_.begin(kLead);
    // The two sensors do not wait for each other.
    std::thread camera([this] { showFrames(); });
    sendSamples();
    camera.join();
  }
  void stop() override { pacer_.stop(); }
  SimulatedRigStatistics statistics() const override {
    return {frames_.rendered(), shown_.load(), missed_.load()};
  }

 private:
  void sendSamples();
  void showFrames();
  void publish(const StereoFrame& frame);

  const Simulation& simulation_;
  FrameStore& frames_;
  Topics topics_;
  TruthPublisher truth_;
  ros::Publisher left_, right_, left_info_, right_info_, imu_;
  Pacer pacer_;
  std::atomic<int> shown_{0}, missed_{0};
};

void SimulatedTopics::sendSamples() {
  for (const MtiSample& sample : simulation_.samples()) {
    if (!pacer_.waitUntil(sample.time_s + kSampleLatencyS)) return;
    ImuSample stamped = sample.imu;
    stamped.stamp = pacer_.stampAt(sample.time_s);
    imu_.publish(toRos(stamped, topics_.base_frame));
    truth_.publish(sample.time_s, stamped.stamp);
  }
}

void SimulatedTopics::showFrames() {
  for (int view = 0; view < simulation_.views(); ++view) {
    const double taken = simulation_.viewTime(view);
    if (!pacer_.waitUntil(taken + kReadoutS)) return;
    std::optional<StereoFrame> frame = frames_.frame(view, simulation_.exposure());
    if (!frame) {
      ++missed_;
      frames_.skipBefore(view + 2);  // the next one would come too late as well
      continue;
    }
    frame->stamp = pacer_.stampAt(taken);
    publish(*frame);
    ++shown_;
  }
}

void SimulatedTopics::publish(const StereoFrame& frame) {
  const StereoCalibration& cameras = simulation_.rig().calibration;
  const std_msgs::Header left = makeHeader(frame.stamp, topics_.camera_frame);
  const std_msgs::Header right = makeHeader(frame.stamp, kRightCameraFrame);
  left_info_.publish(toRos(cameras.left, left));
  right_info_.publish(toRos(cameras.right, right));
  left_.publish(toRos(frame.left, left));
  right_.publish(toRos(frame.right, right));
}

}  // namespace

std::unique_ptr<SimulatedRig> makeSimulatedTopics(const ros::NodeHandle& nh,
                                                  const Simulation& simulation,
                                                  FrameStore& frames) {
  return std::make_unique<SimulatedTopics>(nh, simulation, frames);
}

}  // namespace scanner::bridge
