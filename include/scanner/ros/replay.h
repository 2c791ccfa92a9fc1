#pragma once

#include <ros/node_handle.h>

#include <string>

#include "scanner/core/options.h"
#include "scanner/core/status.h"

namespace scanner::bridge {

/// What replay_node is told to do (parameters of the same names in `~`).
struct ReplayOptions {
  std::string bag;
  double rate = 1.0;        ///< of real time
  bool transforms = true;   ///< publish the recording's /tf_static
  bool mesh = true;         ///< build the mesh at the end
  std::string out;          ///< scan folder to fill at the end; empty: none
  double startup_s = 60.0;  ///< how long the nodes may take to come up
};
void describe(OptionVisitor& v, ReplayOptions& o);

/// Plays a recording with /clock to nodes that are up, without losing a message, then calls
/// registration_node/finish, mesh_node/build and, with a folder, both ~save services. Returns the
/// lines that the services answered with.
///
/// kInvalidInput and friends before anything is played when the recording cannot be scanned,
/// kNotEnoughData when the nodes do not come up, kIoError when the player or a service fails.
Result<std::string> replay(const ros::NodeHandle& nh, const ReplayOptions& options);

}  // namespace scanner::bridge
