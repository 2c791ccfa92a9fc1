#include "scanner/ros/replay.h"

#include <ros/init.h>
#include <ros/master.h>
#include <ros/service.h>
#include <ros/this_node.h>
#include <std_srvs/Trigger.h>

#include <map>
#include <set>
#include <vector>

#include "ros/bag_player.h"
#include "ros/static_broadcast.h"
#include "scanner/Save.h"
#include "scanner/ros/bag_reader.h"
#include "scanner/ros/conversions.h"
#include "scanner/ros/static_transforms.h"

namespace scanner::bridge {
namespace {

const ros::WallDuration kPoll(0.1);
const ros::WallDuration kConnectPatience(30.0);

/// Topics with the nodes that subscribe to them, this one left out.
using Subscribers = std::map<std::string, std::set<std::string>>;

Subscribers subscribers() {
  Subscribers found;
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = ros::this_node::getName();
  if (!ros::master::execute("getSystemState", request, response, payload, false)) return found;
  XmlRpc::XmlRpcValue& topics = payload[1];
  for (int i = 0; i < topics.size(); ++i) {
    for (int k = 0; k < topics[i][1].size(); ++k) {
      const std::string node = topics[i][1][k];
      if (node != ros::this_node::getName()) found[topics[i][0]].insert(node);
    }
  }
  return found;
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
std::string missing(const ros::NodeHandle& nh, const Topics& topics, const ReplayOptions& options) {
  const Subscribers subscribed = subscribers();
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

Status waitForNodes(const ros::NodeHandle& nh, const Topics& topics, const ReplayOptions& options) {
  const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(options.startup_s);
  std::string what = missing(nh, topics, options);
  while (!what.empty() && ros::ok() && ros::WallTime::now() < deadline) {
    kPoll.sleep();
    what = missing(nh, topics, options);
  }
  if (what.empty()) return Status::ok();
  return Status(StatusCode::kNotEnoughData, "the nodes did not come up: " + what);
}

/// Latched by a broadcaster, unlike what a player sends, so that nobody comes too late.
std::vector<geometry_msgs::TransformStamped> messagesOf(const StaticTransforms& transforms) {
  std::vector<geometry_msgs::TransformStamped> messages;
  for (const StaticTransforms::Edge& edge : transforms.added()) {
    messages.push_back(toRos(edge.T_parent_child, Time(), edge.parent, edge.child));
  }
  return messages;
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

Result<std::string> replay(const ros::NodeHandle& nh, const ReplayOptions& options) {
  const Topics topics;
  const std::shared_ptr<StaticBroadcast> static_tf = StaticBroadcast::shared();
  {
    Result<BagReader> bag = BagReader::open(options.bag, topics);
    if (!bag) return bag.status();
    if (Status status = bag->checkScannable(); !status) return status;
    if (options.transforms) static_tf->send(messagesOf(bag->transforms()));
  }
  if (Status status = waitForNodes(nh, topics, options); !status) return status;
  BagPlayer player(nh, options.bag,
                   {topics.left_image, topics.right_image, topics.left_info, topics.right_info,
                    topics.imu, topics.ground_truth});
  if (Status status = player.waitForSubscribers(subscribers(), kConnectPatience); !status) {
    return status;
  }
  if (Status status = player.play(options.rate); !status) return status;
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
