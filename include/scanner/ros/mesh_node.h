#pragma once

#include <ros/node_handle.h>

#include <memory>

namespace scanner::bridge {

/// Registered views to a mesh.
///
/// Subscribes (relative to the node's namespace)
///   registration/views   every view with its cloud
///   registration/path    which of them are registered, and where (by stamp)
/// Publishes, in map
///   mesh/preview         visualization_msgs/Marker TRIANGLE_LIST with colours (latched), coarsened
///   to
///                        at most ~preview_faces triangles
///   mesh/status          MeshStatus (latched)
///   /diagnostics
/// Services
///   ~build               std_srvs/Trigger: makes the mesh from all registered views
///   ~save                scanner/Save: model.ply and cloud.ply (builds first when there is no
///                        mesh); a report that is there gets the model's figures and pictures
/// Parameters
///   scanner/{surface,scan}, or ~...: options (docs/configuration.md)
///   ~threads (0: all processors), ~preview_faces, ~wait_s (for views that are still on the way)
class MeshNode {
 public:
  /// Throws ConfigurationError for bad parameters.
  MeshNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~MeshNode();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::bridge
