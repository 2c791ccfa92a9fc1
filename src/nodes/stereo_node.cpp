#include "scanner/ros/stereo_node.h"

#include "nodes/node_main.h"

int main(int argc, char** argv) {
  return scanner::nodes::run<scanner::bridge::StereoNode>(argc, argv, "stereo_node");
}
