#pragma once

#include <ros/init.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>

#include <cstdio>
#include <exception>

namespace scanner::nodes {

/// Runs one node class until Ctrl-C. What its constructor refuses is one line on stderr and exit 1.
template <typename Node>
int run(int argc, char** argv, const char* name) {
  ros::init(argc, argv, name);
  try {
    const Node node{ros::NodeHandle(), ros::NodeHandle("~")};
    ros::spin();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", name, error.what());
    return 1;
  }
  return 0;
}

}  // namespace scanner::nodes
