#include "scanner/ros/replay.h"

#include <vector>

#include "ros/bag_player.h"
#include "ros/scan_services.h"
#include "ros/static_broadcast.h"
#include "scanner/ros/bag_reader.h"
#include "scanner/ros/conversions.h"
#include "scanner/ros/static_transforms.h"

namespace scanner::bridge {
namespace {

const ros::WallDuration kConnectPatience(30.0);

/// Latched by a broadcaster, unlike what a player sends, so that nobody comes too late.
std::vector<geometry_msgs::TransformStamped> messagesOf(const StaticTransforms& transforms) {
  std::vector<geometry_msgs::TransformStamped> messages;
  for (const StaticTransforms::Edge& edge : transforms.added()) {
    messages.push_back(toRos(edge.T_parent_child, Time(), edge.parent, edge.child));
  }
  return messages;
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
  const ScanEnd end{options.mesh, options.out};
  const std::shared_ptr<StaticBroadcast> static_tf = StaticBroadcast::shared();
  {
    Result<BagReader> bag = BagReader::open(options.bag, topics);
    if (!bag) return bag.status();
    if (Status status = bag->checkScannable(); !status) return status;
    if (options.transforms) static_tf->send(messagesOf(bag->transforms()));
  }
  if (Status status = waitForNodes(nh, topics, end, options.startup_s); !status) return status;
  BagPlayer player(nh, options.bag,
                   {topics.left_image, topics.right_image, topics.left_info, topics.right_info,
                    topics.imu, topics.ground_truth});
  if (Status status = player.waitForSubscribers(subscribers(), kConnectPatience); !status) {
    return status;
  }
  if (Status status = player.play(options.rate); !status) return status;
  return finishScan(nh, end);
}

}  // namespace scanner::bridge
