#include "scanner/ros/viewfinder_node.h"

#include "nodes/node_main.h"

int main(int argc, char** argv) {
  return scanner::nodes::run<scanner::bridge::ViewfinderNode>(argc, argv, "viewfinder_node");
}
