// Similarity groups inside the Registrar: eqs. 4.12 to 4.14.
#include "registration/registrar_impl.h"
#include "scanner/registration/sampling.h"

namespace scanner::registration {
namespace {

bool isPlaced(const Group& group) {
  return group.placement == GroupPlacement::kFirst ||
         group.placement == GroupPlacement::kRegistered ||
         group.placement == GroupPlacement::kSharedViews;
}

}  // namespace

void Registrar::Impl::openGroup(int view) {
  if (!planner_.startsGroup(view)) return;
  Group group;
  group.id = planner_.groupStartedBy(view);
  group.first_view = view;
  if (data_[at(view)].usable) {
    GroupMember first;
    first.view = view;
    first.registered = true;
    first.outcome.step = 0;
    group.members.push_back(first);
  }
  groups_.push_back(group);
}

void Registrar::Impl::closeGroups(int last_view) {
  for (Group& group : groups_) {
    if (group.closed) continue;
    // What finish() worked out for a group that was still open is worked out anew.
    group.placement = GroupPlacement::kOpen;
    group.outcome = TrialOutcome();
    group.outcome.step = 0;
    if (planner_.isComplete(group.id, last_view)) {
      placeGroup(group);
      group.closed = true;
    }
  }
}

// Eq. 4.12: against the union of the members so far, in the frame of the last of them.
const TrialOutcome& Registrar::Impl::registerInGroup(
    Group& group, int view, const std::optional<Eigen::Isometry3d>& T_pred_start) {
  // The first member of a group is always registered.
  const GroupMember* predecessor = &group.members.front();
  for (const GroupMember& m : group.members) {
    if (m.registered) predecessor = &m;
  }
  const Eigen::Isometry3d T_group_pred = predecessor->T_group_view;
  TrialInput input;
  input.reference = referenceOf(group, T_group_pred.inverse());
  input.moving.samples = *data_[at(view)].moving;
  input.T_prior = T_pred_start ? *T_pred_start : priorBetween(predecessor->view, view);
  input.last_view_median = data_[at(predecessor->view)].reference->median();
  GroupMember member;
  member.view = view;
  member.outcome = runTrials(input, options_, threads_);
  member.registered = member.outcome.success;
  member.T_group_view = T_group_pred * member.outcome.icp.T_ref_mov;
  group.members.push_back(member);
  return group.members.back().outcome;
}

Reference Registrar::Impl::referenceOf(const Group& group,
                                       const Eigen::Isometry3d& T_ref_group) const {
  Reference reference;
  for (const GroupMember& m : group.members) {
    if (!m.registered) continue;
    reference.push_back({data_[at(m.view)].reference, T_ref_group * m.T_group_view, m.view});
  }
  return reference;
}

// Eq. 4.13: all members in the frame of the first, as one cloud.
Moving Registrar::Impl::movingOf(const Group& group) const {
  Moving moving;
  for (const GroupMember& m : group.members) {
    if (!m.registered) continue;
    moving.samples.append(transformed(*data_[at(m.view)].moving, m.T_group_view));
    moving.owners.resize(moving.samples.size(), m.view);
  }
  const auto limit = static_cast<std::size_t>(options_.groups.inter_samples);
  if (limit > 0 && moving.samples.size() > limit) {
    const auto chosen = sampleUniform(moving.samples.size(), limit, seed_);
    moving.samples = subset(moving.samples, chosen);
    std::vector<int> owners;
    owners.reserve(chosen.size());
    for (std::size_t i : chosen) owners.push_back(moving.owners[i]);
    moving.owners = std::move(owners);
  }
  if (options_.groups.match_shared_views) moving.owners.clear();
  return moving;
}

const Group* Registrar::Impl::lastPlacedGroup() const {
  for (auto group = groups_.rbegin(); group != groups_.rend(); ++group) {
    if (isPlaced(*group)) return &*group;
  }
  return nullptr;
}

// Eq. 4.14, against the last group that has a place.
void Registrar::Impl::placeGroup(Group& group) {
  group.outcome.step = 0;
  group.reference_group = -1;
  if (group.registeredMembers() < 2) {
    group.placement = GroupPlacement::kFailed;
    return;
  }
  const Group* reference = lastPlacedGroup();
  if (reference == nullptr) {
    const RegisteredView& first = views_[at(group.first_view)];
    group.placement = GroupPlacement::kFirst;
    group.T_map_group =
        first.registered ? first.T_map_base : T_map_first_ * priorBetween(0, group.first_view);
    return;
  }
  placeByRegistration(group, *reference);
}

void Registrar::Impl::placeByRegistration(Group& group, const Group& reference) {
  TrialInput input;
  input.reference = referenceOf(reference, Eigen::Isometry3d::Identity());
  input.moving = movingOf(group);
  input.last_view_median = medianOf(input.reference);
  bool shared = false;
  for (const GroupMember& m : group.members) {
    const GroupMember* same = m.registered ? reference.find(m.view) : nullptr;
    if (same == nullptr) continue;
    input.T_prior = same->T_group_view * m.T_group_view.inverse();
    shared = true;
    break;
  }
  if (!shared) {
    const RegisteredView& a = views_[at(reference.first_view)];
    const RegisteredView& b = views_[at(group.first_view)];
    input.T_prior = a.registered && b.registered
                        ? Eigen::Isometry3d(a.T_map_base.inverse() * b.T_map_base)
                        : priorBetween(reference.first_view, group.first_view);
  }
  group.reference_group = reference.id;
  group.outcome = runTrials(input, options_, threads_);
  if (group.outcome.success) {
    group.placement = GroupPlacement::kRegistered;
    group.T_reference_group = group.outcome.icp.T_ref_mov;
  } else if (shared) {
    // A view that both groups hold was registered in both: that relation stands.
    group.placement = GroupPlacement::kSharedViews;
    group.T_reference_group = input.T_prior;
  } else {
    group.placement = GroupPlacement::kFailed;
    return;
  }
  group.T_map_group = reference.T_map_group * group.T_reference_group;
}

// Poses of the first two stages: from the first placed group that holds the view.
void Registrar::Impl::placeByChain() {
  for (std::size_t v = 0; v < views_.size(); ++v) {
    if (data_[v].usable && static_cast<int>(v) != root_) views_[v].registered = false;
  }
  for (const Group& group : groups_) {
    if (!isPlaced(group)) continue;
    for (const GroupMember& m : group.members) {
      if (!m.registered || views_[at(m.view)].registered) continue;
      setPlaced(m.view, group.id, m.outcome, group.T_map_group * m.T_group_view);
    }
  }
  for (const Recovery& r : recoveries_) {
    if (!r.outcome.success || views_[at(r.to)].registered || !views_[at(r.from)].registered) {
      continue;
    }
    setPlaced(r.to, -1, r.outcome, views_[at(r.from)].T_map_base * r.outcome.icp.T_ref_mov);
  }
  for (std::size_t v = 0; v < views_.size(); ++v) {
    if (data_[v].usable && !views_[v].registered) {
      setDiscarded(static_cast<int>(v), failureOf(static_cast<int>(v)));
    }
  }
}

void Registrar::Impl::recount() {
  statistics_ = TrialStatistics();
  const auto count = [](std::array<std::size_t, 9>& steps, const TrialOutcome& outcome) {
    const int step = outcome.reportedStep();
    if (step >= 1 && step <= 8) ++steps[static_cast<std::size_t>(step)];
  };
  for (const Group& group : groups_) {
    for (const GroupMember& member : group.members) count(statistics_.intra_group, member.outcome);
    if (group.reference_group >= 0) count(statistics_.inter_group, group.outcome);
  }
  for (const Recovery& recovery : recoveries_) count(statistics_.recovery, recovery.outcome);
}

}  // namespace scanner::registration
