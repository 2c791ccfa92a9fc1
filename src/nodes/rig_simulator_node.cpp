// The rig that needs no hardware. 0 when the motion (and the scan) ended well, 1 otherwise.
#include "scanner/ros/rig_simulator_node.h"

#include <ros/init.h>
#include <ros/spinner.h>

#include <cstdio>

#include "scanner/core/status.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "rig_simulator_node");
  try {
    ros::AsyncSpinner spinner(2);
    spinner.start();
    scanner::bridge::RigSimulatorNode node{ros::NodeHandle(), ros::NodeHandle("~")};
    const scanner::Result<std::string> lines = node.run();
    if (!lines) throw scanner::ConfigurationError(lines.status().message());
    std::fputs(lines->c_str(), stdout);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "rig_simulator_node: %s\n", error.what());
    return 1;
  }
  return 0;
}
