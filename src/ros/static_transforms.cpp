#include "scanner/ros/static_transforms.h"

#include <deque>

namespace scanner::bridge {

std::string frameName(const std::string& name) {
  const std::size_t first = name.find_first_not_of('/');
  return first == std::string::npos ? std::string() : name.substr(first);
}

void StaticTransforms::add(const std::string& parent, const std::string& child,
                           const Eigen::Isometry3d& T_parent_child) {
  added_.push_back({frameName(parent), frameName(child), T_parent_child});
  edges_[frameName(parent)][frameName(child)] = T_parent_child;
  edges_[frameName(child)][frameName(parent)] = T_parent_child.inverse();
}

bool StaticTransforms::knows(const std::string& frame) const {
  return edges_.count(frameName(frame)) > 0;
}

Result<Eigen::Isometry3d> StaticTransforms::lookup(const std::string& from,
                                                   const std::string& to) const {
  const std::string start = frameName(from);
  const std::string goal = frameName(to);
  std::map<std::string, Eigen::Isometry3d> reached;
  reached.emplace(start, Eigen::Isometry3d::Identity());
  std::deque<std::string> open = {start};
  while (!open.empty()) {
    const std::string frame = open.front();
    open.pop_front();
    const Eigen::Isometry3d T_start_frame = reached.at(frame);
    if (frame == goal) return T_start_frame;
    const auto edges = edges_.find(frame);
    if (edges == edges_.end()) continue;
    for (const auto& [next, T_frame_next] : edges->second) {
      if (!reached.emplace(next, T_start_frame * T_frame_next).second) continue;
      open.push_back(next);
    }
  }
  return Status(StatusCode::kNotEnoughData,
                "no static transform between '" + start + "' and '" + goal + "'");
}

}  // namespace scanner::bridge
