#include "scanner/ros/inertial_odometry_node.h"

#include "nodes/node_main.h"

int main(int argc, char** argv) {
  return scanner::nodes::run<scanner::bridge::InertialOdometryNode>(argc, argv,
                                                                    "inertial_odometry_node");
}
