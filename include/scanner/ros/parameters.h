#pragma once

#include <ros/node_handle.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <string>
#include <vector>

#include "scanner/core/options.h"

/// Options of nodes from the parameter server, through the same descriptions as a YAML file.
namespace scanner::bridge {

/// Parameter server value as a tree. Throws ConfigurationError for dates and binary values.
ParameterTree toTree(XmlRpc::XmlRpcValue value);

/// The block `name` of a configuration: `scanner/<name>` in the node's namespace (where a launch
/// file loads config/*.yaml), with `~<name>` on top. Empty object when neither is set.
ParameterTree parameterBlock(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                             const std::string& name);

/// The node's own parameters: all of `~` but the blocks in `blocks` and what ROS libraries put
/// there.
ParameterTree privateParameters(const ros::NodeHandle& private_nh,
                                const std::vector<std::string>& blocks);

void loadBlock(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
               const std::string& name, DescribeCall call, void* options);
void loadPrivate(const ros::NodeHandle& private_nh, const std::vector<std::string>& blocks,
                 DescribeCall call, void* options);

/// Loads block `name`; throws ConfigurationError with key, value and bound.
template <typename Options>
void loadBlock(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
               const std::string& name, Options& options) {
  loadBlock(
      nh, private_nh, name,
      [](OptionVisitor& v, void* o) { describe(v, *static_cast<Options*>(o)); }, &options);
}

/// Loads the node's own parameters; throws ConfigurationError with key, value and bound.
template <typename Options>
void loadPrivate(const ros::NodeHandle& private_nh, const std::vector<std::string>& blocks,
                 Options& options) {
  loadPrivate(
      private_nh, blocks, [](OptionVisitor& v, void* o) { describe(v, *static_cast<Options*>(o)); },
      &options);
}

}  // namespace scanner::bridge
