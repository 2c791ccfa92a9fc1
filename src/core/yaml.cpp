#include <yaml-cpp/yaml.h>

#include <nlohmann/json.hpp>

#include "scanner/core/options.h"

namespace scanner {
namespace {

ParameterTree scalarToTree(const YAML::Node& node) {
  const std::string& text = node.Scalar();
  if (node.Tag() == "!") return text;  // quoted: a text, whatever it looks like
  std::int64_t whole = 0;
  double number = 0.0;
  bool flag = false;
  if (YAML::convert<std::int64_t>::decode(node, whole)) return whole;
  if (YAML::convert<double>::decode(node, number)) return number;
  if (YAML::convert<bool>::decode(node, flag)) return flag;
  return text;
}

ParameterTree toTree(const YAML::Node& node) {
  if (node.IsScalar()) return scalarToTree(node);
  if (node.IsSequence()) {
    ParameterTree list = ParameterTree::array();
    for (const YAML::Node& item : node) list.push_back(toTree(item));
    return list;
  }
  if (node.IsMap()) {
    ParameterTree map = ParameterTree::object();
    for (const auto& item : node) {
      const auto key = item.first.as<std::string>();
      if (map.contains(key)) throw ConfigurationError("key '" + key + "' stands twice");
      map[key] = toTree(item.second);
    }
    return map;
  }
  return nullptr;
}

void emit(YAML::Emitter& out, const ParameterTree& tree) {
  if (tree.is_object()) {
    out << YAML::BeginMap;
    for (const auto& item : tree.items()) {
      out << YAML::Key << item.key() << YAML::Value;
      emit(out, item.value());
    }
    out << YAML::EndMap;
  } else if (tree.is_array()) {
    out << YAML::Flow << YAML::BeginSeq;
    for (const ParameterTree& item : tree) emit(out, item);
    out << YAML::EndSeq;
  } else if (tree.is_string()) {
    out << tree.get<std::string>();
  } else {
    out << tree.dump();
  }
}

}  // namespace

ParameterTree readYaml(const std::string& path) {
  try {
    const YAML::Node node = YAML::LoadFile(path);
    return toTree(node);
  } catch (const YAML::BadFile&) {
    throw ConfigurationError("cannot read " + path);
  } catch (const YAML::Exception& error) {
    throw ConfigurationError(path + ": line " + std::to_string(error.mark.line + 1) + ": " +
                             error.msg);
  } catch (const ConfigurationError& error) {
    throw ConfigurationError(path + ": " + error.what());
  }
}

std::string toYaml(const ParameterTree& tree) {
  YAML::Emitter out;
  emit(out, tree);
  return std::string(out.c_str()) + "\n";
}

}  // namespace scanner
