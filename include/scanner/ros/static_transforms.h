#pragma once

#include <Eigen/Geometry>
#include <map>
#include <string>
#include <vector>

#include "scanner/core/status.h"

namespace scanner::bridge {

/// Frame name without tf's leading slash.
std::string frameName(const std::string& name);

/// Tree of constant transforms, as gathered from /tf_static. Not thread-safe.
class StaticTransforms {
 public:
  /// T_parent_child. A later transform of the same pair replaces the earlier one.
  void add(const std::string& parent, const std::string& child,
           const Eigen::Isometry3d& T_parent_child);
  /// T_from_to through any chain. kNotEnoughData naming both frames when they are not connected.
  Result<Eigen::Isometry3d> lookup(const std::string& from, const std::string& to) const;
  bool knows(const std::string& frame) const;
  bool empty() const { return edges_.empty(); }

  struct Edge {
    std::string parent, child;
    Eigen::Isometry3d T_parent_child;
  };
  /// What was added, in order.
  const std::vector<Edge>& added() const { return added_; }

 private:
  /// edges_[a][b] = T_a_b, both directions.
  std::map<std::string, std::map<std::string, Eigen::Isometry3d>> edges_;
  std::vector<Edge> added_;
};

}  // namespace scanner::bridge
