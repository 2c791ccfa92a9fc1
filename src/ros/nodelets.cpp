// Every node as a nodelet, for one manager without copies between them. All callbacks of a node
// come from the manager's single-threaded queue; long services have their own thread
// (service_thread.h).
#include <nodelet/nodelet.h>
#include <pluginlib/class_list_macros.hpp>

#include "scanner/core/status.h"
#include "scanner/ros/bumblebee_node.h"
#include "scanner/ros/inertial_odometry_node.h"
#include "scanner/ros/mesh_node.h"
#include "scanner/ros/mti_node.h"
#include "scanner/ros/registration_node.h"
#include "scanner/ros/stereo_node.h"
#include "scanner/ros/viewfinder_node.h"

namespace scanner::bridge {

template <typename Node>
class NodeletOf : public nodelet::Nodelet {
 private:
  void onInit() override {
    try {
      node_ = std::make_unique<Node>(getNodeHandle(), getPrivateNodeHandle());
    } catch (const std::exception& e) {
      NODELET_FATAL("%s", e.what());
      throw;  // the manager refuses the nodelet, the loader exits with an error
    }
  }

  std::unique_ptr<Node> node_;
};

using BumblebeeNodelet = NodeletOf<BumblebeeNode>;
using MtiNodelet = NodeletOf<MtiNode>;
using StereoNodelet = NodeletOf<StereoNode>;
using InertialOdometryNodelet = NodeletOf<InertialOdometryNode>;
using RegistrationNodelet = NodeletOf<RegistrationNode>;
using MeshNodelet = NodeletOf<MeshNode>;
using ViewfinderNodelet = NodeletOf<ViewfinderNode>;

}  // namespace scanner::bridge

PLUGINLIB_EXPORT_CLASS(scanner::bridge::BumblebeeNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(scanner::bridge::MtiNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(scanner::bridge::StereoNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(scanner::bridge::InertialOdometryNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(scanner::bridge::RegistrationNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(scanner::bridge::MeshNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(scanner::bridge::ViewfinderNodelet, nodelet::Nodelet)
