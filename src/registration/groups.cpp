#include "scanner/registration/groups.h"

#include <algorithm>

#include "scanner/core/se3.h"

namespace scanner::registration {
namespace {

constexpr double kPi = 3.14159265358979323846;

}  // namespace

GroupPlanner::GroupPlanner(const GroupOptions& options) : options_(options) {
  if (options.stride < 1 || options.max_members < 2) {
    throw ConfigurationError("registration.groups: stride must be >= 1 and max_members >= 2");
  }
}

bool GroupPlanner::startsGroup(int view) const { return view % options_.stride == 0; }

int GroupPlanner::groupStartedBy(int view) const { return view / options_.stride; }

bool GroupPlanner::isComplete(int group, int view) const {
  return group_size_ > 0 && view >= group * options_.stride + group_size_ - 1;
}

std::vector<int> GroupPlanner::add(const Eigen::Quaterniond& orientation) {
  const double cutoff = options_.cutoff_deg * kPi / 180.0;
  const int k = static_cast<int>(orientations_.size());
  orientations_.push_back(orientation);
  const auto within = [&](int first) {
    return angleBetween(orientations_[static_cast<std::size_t>(first)], orientation) <= cutoff;
  };
  if (group_size_ == 0 && k > 0) {
    if (!within(0)) {
      group_size_ = std::max(2, k);
    } else if (k + 1 >= options_.max_members) {
      group_size_ = options_.max_members;
    }
  }
  // As long as n is open, every group so far may still take this view: n is at least k then.
  const int oldest = group_size_ == 0 ? 0 : std::max(0, k - group_size_ + 1);
  std::vector<int> groups;
  for (int first = oldest; first < k; ++first) {
    if (startsGroup(first) && (first + 1 == k || within(first))) {
      groups.push_back(groupStartedBy(first));
    }
  }
  return groups;
}

std::size_t Group::registeredMembers() const {
  return static_cast<std::size_t>(std::count_if(members.begin(), members.end(),
                                                [](const GroupMember& m) { return m.registered; }));
}

const GroupMember* Group::find(int view) const {
  for (const GroupMember& m : members) {
    if (m.view == view && m.registered) return &m;
  }
  return nullptr;
}

}  // namespace scanner::registration
