#include "scanner/ros/package_files.h"

#include <ros/package.h>

#include <cstdlib>
#include <filesystem>
#include <vector>

#include "scanner/core/status.h"

namespace scanner::bridge {

std::string configPath(const std::string& name) {
  namespace fs = std::filesystem;
  if (fs::is_regular_file(name)) return name;
  std::vector<std::string> roots;
  // Without a sourced workspace rospack would complain; a program started by its path then finds
  // its own sources.
  if (std::getenv("ROS_PACKAGE_PATH") != nullptr) {
    const std::string package = ::ros::package::getPath("scanner");
    if (!package.empty()) roots.push_back(package);
  }
  roots.emplace_back(SCANNER_SOURCE_DIR);
  std::string tried = name;
  for (const std::string& root : roots) {
    const fs::path candidate = fs::path(root) / "config" / (name + ".yaml");
    if (fs::is_regular_file(candidate)) return candidate.string();
    tried += ", " + candidate.string();
  }
  throw ConfigurationError("no configuration '" + name + "' (tried " + tried + ")");
}

}  // namespace scanner::bridge
