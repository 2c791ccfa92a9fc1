#include "scanner/ros/parameters.h"

#include <nlohmann/json.hpp>

namespace scanner::bridge {
namespace {

/// Set or read by image_transport, diagnostic_updater and nodelet in a node's private namespace.
constexpr const char* kForeign[] = {"diagnostic_period", "diagnostic_updater_fqn",
                                    "image_transport"};

ParameterTree valueAt(const ros::NodeHandle& nh, const std::string& key) {
  XmlRpc::XmlRpcValue value;
  if (!nh.getParam(key, value)) return ParameterTree::object();
  return toTree(value);
}

}  // namespace

ParameterTree toTree(XmlRpc::XmlRpcValue value) {
  using Value = XmlRpc::XmlRpcValue;
  switch (value.getType()) {
    case Value::TypeInvalid:
      return nullptr;
    case Value::TypeBoolean:
      return static_cast<bool>(value);
    case Value::TypeInt:
      return static_cast<int>(value);
    case Value::TypeDouble:
      return static_cast<double>(value);
    case Value::TypeString:
      return static_cast<std::string>(value);
    case Value::TypeArray: {
      ParameterTree array = ParameterTree::array();
      for (int i = 0; i < value.size(); ++i) array.push_back(toTree(value[i]));
      return array;
    }
    case Value::TypeStruct: {
      ParameterTree object = ParameterTree::object();
      for (auto& [key, member] : value) object[key] = toTree(member);
      return object;
    }
    default:
      throw ConfigurationError("a parameter is a date or binary, which no option is");
  }
}

ParameterTree parameterBlock(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                             const std::string& name) {
  ParameterTree block = valueAt(nh, "scanner/" + name);
  const ParameterTree own = valueAt(private_nh, name);
  if (own.is_object() && block.is_object()) {
    block.merge_patch(own);
    return block;
  }
  return own.is_object() ? block : own;  // whichever is no block: loadOptions names it
}

ParameterTree privateParameters(const ros::NodeHandle& private_nh,
                                const std::vector<std::string>& blocks) {
  ParameterTree tree = valueAt(private_nh, private_nh.getNamespace());
  if (!tree.is_object()) return tree;
  for (const std::string& block : blocks) tree.erase(block);
  for (const char* name : kForeign) tree.erase(name);
  return tree;
}

void loadBlock(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
               const std::string& name, DescribeCall call, void* options) {
  loadOptions(parameterBlock(nh, private_nh, name), name, call, options);
}

void loadPrivate(const ros::NodeHandle& private_nh, const std::vector<std::string>& blocks,
                 DescribeCall call, void* options) {
  loadOptions(privateParameters(private_nh, blocks), private_nh.getNamespace(), call, options);
}

}  // namespace scanner::bridge
