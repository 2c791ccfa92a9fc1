#pragma once

#include <ros/node_handle.h>

#include <map>
#include <set>
#include <string>

#include "scanner/core/status.h"
#include "scanner/ros/bag_reader.h"

namespace scanner::bridge {

/// Topics with the nodes that subscribe to them, the calling one left out.
using Subscribers = std::map<std::string, std::set<std::string>>;
Subscribers subscribers();

/// How a scan is brought to its end by whoever feeds it.
struct ScanEnd {
  bool mesh = true;  ///< build the mesh
  std::string out;   ///< scan folder to fill; empty: none
};

/// Waits until every processing node has subscribed and offers its services. kNotEnoughData after
/// `patience_s`, naming what is missing.
Status waitForNodes(const ros::NodeHandle& nh, const Topics& topics, const ScanEnd& end,
                    double patience_s);

/// registration_node/finish, mesh_node/build and, with a folder, both ~save services. The lines
/// that the services answered with; kIoError when one fails.
Result<std::string> finishScan(const ros::NodeHandle& nh, const ScanEnd& end);

}  // namespace scanner::bridge
