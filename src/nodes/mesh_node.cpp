#include "scanner/ros/mesh_node.h"

#include "nodes/node_main.h"

int main(int argc, char** argv) {
  return scanner::nodes::run<scanner::bridge::MeshNode>(argc, argv, "mesh_node");
}
