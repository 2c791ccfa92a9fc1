#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace scanner::mti {

struct Port {
  /// The likelier, the smaller.
  enum class Kind { kXsens, kFtdi, kOtherUsb, kBuiltIn };
  std::string path;
  std::string description;
  Kind kind = Kind::kBuiltIn;
};

/// Serial ports by the kernel's own list, the likeliest first. `root`: "/" but in tests.
std::vector<Port> findPorts(const std::filesystem::path& root = "/");

}  // namespace scanner::mti
