#include "scanner/ros/replay.h"

#include <ros/init.h>
#include <ros/master.h>
#include <ros/service.h>
#include <ros/this_node.h>
#include <rosgraph_msgs/Clock.h>
#include <spawn.h>
#include <std_srvs/Trigger.h>
#include <sys/wait.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <csignal>
#include <set>
#include <vector>

#include "scanner/Save.h"
#include "scanner/ros/bag_reader.h"
#include "scanner/ros/conversions.h"
#include "scanner/ros/static_transforms.h"

extern char** environ;

namespace scanner::bridge {
namespace {

const ros::WallDuration kPoll(0.1);
/// Seconds between the player's advertising and its first message: all subscribers are connected then.
constexpr const char* kAdvertiseDelay = "--delay=2";

/// Topics that somebody other than this node subscribes to.
std::set<std::string> subscribedTopics() {
  std::set<std::string> topics;
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = ros::this_node::getName();
  if (!ros::master::execute("getSystemState", request, response, payload, false)) return topics;
  XmlRpc::XmlRpcValue& subscribers = payload[1];
  for (int i = 0; i < subscribers.size(); ++i) topics.insert(subscribers[i][0]);
  return topics;
}

std::vector<std::string> services(const ReplayOptions& options) {
  std::vector<std::string> names = {"registration_node/finish"};
  if (options.mesh) names.emplace_back("mesh_node/build");
  if (options.out.empty()) return names;
  names.emplace_back("registration_node/save");
  if (options.mesh) names.emplace_back("mesh_node/save");
  return names;
}

/// The first thing that is not there yet, or "".
std::string missing(const ros::NodeHandle& nh, const Topics& topics,
                    const ReplayOptions& options) {
  const std::set<std::string> subscribed = subscribedTopics();
  for (const std::string& topic :
       {topics.left_image, topics.right_image, topics.left_info, topics.right_info, topics.imu,
        nh.resolveName("stereo/points"), nh.resolveName("odometry")}) {
    if (subscribed.count(topic) == 0) return "nobody subscribes to " + topic;
  }
  for (const std::string& service : services(options)) {
    if (!ros::service::exists(nh.resolveName(service), false)) return "no service " + service;
  }
  return "";
}

Status waitForNodes(const ros::NodeHandle& nh, const Topics& topics,
                    const ReplayOptions& options) {
  const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(options.startup_s);
  std::string what = missing(nh, topics, options);
  while (!what.empty() && ros::ok() && ros::WallTime::now() < deadline) {
    kPoll.sleep();
    what = missing(nh, topics, options);
  }
  if (what.empty()) return Status::ok();
  return Status(StatusCode::kNotEnoughData, "the nodes did not come up: " + what);
}

/// The player would send /tf_static once, right at its start, when some subscribers may not be
/// connected yet; a broadcaster of our own is latched.
std::vector<geometry_msgs::TransformStamped> messagesOf(const StaticTransforms& transforms) {
  std::vector<geometry_msgs::TransformStamped> messages;
  for (const StaticTransforms::Edge& edge : transforms.added()) {
    messages.push_back(toRos(edge.T_parent_child, Time(), edge.parent, edge.child));
  }
  return messages;
}

/// Runs the player to its end; Ctrl-C ends it.
Status play(const Topics& topics, const ReplayOptions& options) {
  std::vector<std::string> words = {"rosbag", "play", "--clock", "--quiet",
                                    "--wait-for-subscribers", kAdvertiseDelay,
                                    "--rate=" + std::to_string(options.rate),
                                    options.bag, "--topics"};
  words.insert(words.end(), {topics.left_image, topics.right_image, topics.left_info,
                             topics.right_info, topics.imu});
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_t child = 0;
  if (posix_spawnp(&child, "rosbag", nullptr, nullptr, argv.data(), environ) != 0) {
    return Status(StatusCode::kIoError, "cannot start `rosbag play`");
  }
  int result = 0;
  bool told = false;
  while (waitpid(child, &result, WNOHANG) == 0) {
    if (!ros::ok() && !told) {
      kill(child, SIGINT);
      told = true;
    }
    kPoll.sleep();
  }
  if (told) return Status(StatusCode::kIoError, "interrupted");
  if (WIFEXITED(result) && WEXITSTATUS(result) == 0) return Status::ok();
  return Status(StatusCode::kIoError, "`rosbag play` failed on " + options.bag);
}

template <typename Service>
Status call(const ros::NodeHandle& nh, const std::string& name, Service& service,
            std::string& lines) {
  if (!ros::service::call(nh.resolveName(name), service)) {
    return Status(StatusCode::kIoError, name + " gave no answer");
  }
  lines += name + ": " + service.response.message + "\n";
  if (service.response.success) return Status::ok();
  return Status(StatusCode::kIoError, name + ": " + service.response.message);
}

}  // namespace

void describe(OptionVisitor& v, ReplayOptions& o) {
  v.option("bag", o.bag, "recording to play");
  v.option("rate", o.rate, {0.01, 100.0}, "", "of real time");
  v.option("transforms", o.transforms, "publish the recording's /tf_static");
  v.option("mesh", o.mesh, "build the mesh at the end");
  v.option("out", o.out, "scan folder to fill at the end; empty: none");
  v.option("startup_s", o.startup_s, {0.0, 3600.0}, "s", "how long the nodes may take to come up");
}

Result<std::string> replay(ros::NodeHandle nh, const ReplayOptions& options) {
  const Topics topics;
  tf2_ros::StaticTransformBroadcaster static_tf;
  Time recorded_until;
  {
    Result<BagReader> bag = BagReader::open(options.bag, topics);
    if (!bag) return bag.status();
    if (Status status = bag->checkScannable(); !status) return status;
    recorded_until = bag->recordedUntil();
    if (options.transforms) static_tf.sendTransform(messagesOf(bag->transforms()));
  }
  if (Status status = waitForNodes(nh, topics, options); !status) return status;
  if (Status status = play(topics, options); !status) return status;
  // A player that could not keep up with its own clock leaves it behind; the nodes' clock ends where
  // the recording ends.
  const ros::Publisher clock = nh.advertise<rosgraph_msgs::Clock>("/clock", 1, true);
  rosgraph_msgs::Clock end;
  end.clock = rosTime(recorded_until);
  clock.publish(end);
  std::string lines;
  for (const std::string& name : services(options)) {
    std_srvs::Trigger trigger;
    scanner::Save save;
    save.request.folder = options.out;
    const bool saves = name.find("/save") != std::string::npos;
    const Status status = saves ? call(nh, name, save, lines) : call(nh, name, trigger, lines);
    if (!status) return status;
  }
  return lines;
}

}  // namespace scanner::bridge
