#include "scanner/ros/registration_node.h"

#include "nodes/node_main.h"

int main(int argc, char** argv) {
  return scanner::nodes::run<scanner::bridge::RegistrationNode>(argc, argv, "registration_node");
}
