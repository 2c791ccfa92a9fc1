#pragma once

#include <string>

namespace scanner::bridge {

/// Path of a configuration: `name` is a file, or the name of one that ships in config/ (field,
/// thesis, room). Throws ConfigurationError naming the places that were tried.
std::string configPath(const std::string& name);

}  // namespace scanner::bridge
