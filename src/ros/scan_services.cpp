#include "ros/scan_services.h"

#include <ros/init.h>
#include <ros/master.h>
#include <ros/service.h>
#include <ros/this_node.h>
#include <std_srvs/Trigger.h>

#include <vector>

#include "scanner/Save.h"

namespace scanner::bridge {
namespace {

const ros::WallDuration kPoll(0.1);

std::vector<std::string> services(const ScanEnd& end) {
  std::vector<std::string> names = {"registration_node/finish"};
  if (end.mesh) names.emplace_back("mesh_node/build");
  if (end.out.empty()) return names;
  names.emplace_back("registration_node/save");
  if (end.mesh) names.emplace_back("mesh_node/save");
  return names;
}

/// The first thing that is not there yet, or "".
std::string missing(const ros::NodeHandle& nh, const Topics& topics, const ScanEnd& end) {
  const Subscribers subscribed = subscribers();
  for (const std::string& topic :
       {topics.left_image, topics.right_image, topics.left_info, topics.right_info, topics.imu,
        nh.resolveName("stereo/points"), nh.resolveName("odometry")}) {
    if (subscribed.count(topic) == 0) return "nobody subscribes to " + topic;
  }
  for (const std::string& service : services(end)) {
    if (!ros::service::exists(nh.resolveName(service), false)) return "no service " + service;
  }
  return "";
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

Status waitForNodes(const ros::NodeHandle& nh, const Topics& topics, const ScanEnd& end,
                    double patience_s) {
  const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(patience_s);
  std::string what = missing(nh, topics, end);
  while (!what.empty() && ros::ok() && ros::WallTime::now() < deadline) {
    kPoll.sleep();
    what = missing(nh, topics, end);
  }
  if (what.empty()) return Status::ok();
  return Status(StatusCode::kNotEnoughData, "the nodes did not come up: " + what);
}

Result<std::string> finishScan(const ros::NodeHandle& nh, const ScanEnd& end) {
  std::string lines;
  for (const std::string& name : services(end)) {
    std_srvs::Trigger trigger;
    scanner::Save save;
    save.request.folder = end.out;
    const bool saves = name.find("/save") != std::string::npos;
    const Status status = saves ? call(nh, name, save, lines) : call(nh, name, trigger, lines);
    if (!status) return status;
  }
  return lines;
}

}  // namespace scanner::bridge
