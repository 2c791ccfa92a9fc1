// Plays a recording to the nodes, then finishes the scan. 0 ok, 1 bad recording or failed scan.
#include <ros/init.h>

#include <cstdio>

#include "scanner/ros/parameters.h"
#include "scanner/ros/replay.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "replay_node");
  try {
    const ros::NodeHandle nh;
    scanner::bridge::ReplayOptions options;
    scanner::bridge::loadPrivate(ros::NodeHandle("~"), {}, options);
    const scanner::Result<std::string> lines = scanner::bridge::replay(nh, options);
    if (!lines) throw scanner::ConfigurationError(lines.status().message());
    std::fputs(lines->c_str(), stdout);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "replay_node: %s\n", error.what());
    return 1;
  }
  return 0;
}
