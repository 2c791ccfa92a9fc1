#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "scanner/core/status.h"
#include "scanner/registration/options.h"
#include "scanner/registration/trials.h"

/// Similarity groups (thesis 4.6, eq. 4.11, figs. 4.8 and 4.9).
namespace scanner::registration {

/// Which views belong to which group, decided as the views arrive.
///
/// n is the number of consecutive views, from the first on, whose orientation is within the cutoff
/// of the first view's; at least 2, at most max_members. Group g starts at view s = g * stride and
/// holds s .. s+n-1 without those outside the cutoff of view s, but always s+1, so that it has two
/// members. The last view starts no group, as it would be alone in it.
class GroupPlanner {
 public:
  explicit GroupPlanner(const GroupOptions& options);
  /// Adds the orientation R_world_base of the next view; returns the groups it belongs to, oldest
  /// first, not counting the group that it may start itself.
  std::vector<int> add(const Eigen::Quaterniond& orientation);
  /// n, or 0 as long as it is not known yet.
  int groupSize() const { return group_size_; }
  /// Whether the view starts a group (once a later one arrives).
  bool startsGroup(int view) const;
  int groupStartedBy(int view) const;
  /// Whether no view after `view` can belong to group g.
  bool isComplete(int group, int view) const;

 private:
  GroupOptions options_;
  std::vector<Eigen::Quaterniond> orientations_;
  int group_size_ = 0;
};

struct GroupMember {
  int view = -1;  ///< position in Registrar::views()
  bool registered = false;
  Eigen::Isometry3d T_group_view = Eigen::Isometry3d::Identity();
  TrialOutcome outcome;  ///< of eq. 4.12; step 0 for the group's first view
};

/// How a group was placed relative to the ones before it.
enum class GroupPlacement { kOpen, kFirst, kRegistered, kSharedViews, kFailed };

struct Group {
  int id = 0;
  int first_view = -1;
  std::vector<GroupMember> members;  ///< in order; the first is the group's frame
  bool closed = false;               ///< no further member can join
  GroupPlacement placement = GroupPlacement::kOpen;
  int reference_group = -1;  ///< group it was registered against (eq. 4.14)
  Eigen::Isometry3d T_reference_group = Eigen::Isometry3d::Identity();  ///< this group to that one
  Eigen::Isometry3d T_map_group = Eigen::Isometry3d::Identity();        ///< chain of the above
  TrialOutcome outcome;  ///< of eq. 4.14; step 0 when none was run

  std::size_t registeredMembers() const;
  const GroupMember* find(int view) const;  ///< registered member, or null
};

}  // namespace scanner::registration
