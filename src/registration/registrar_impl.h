#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "scanner/registration/registrar.h"

namespace scanner::registration {

/// State of a Registrar. Views are addressed by their position in views_.
class Registrar::Impl {
 public:
  Impl(const RegistrationOptions& options, int threads, std::uint64_t seed);

  void setFirstPose(const Eigen::Isometry3d& T_map_base);
  ViewOutcome add(std::shared_ptr<const View> view, const Eigen::Isometry3d& T_prev_prior);
  GlobalOutcome finish();
  bool discardLast();
  const std::vector<RegisteredView>& views() const { return views_; }
  const std::vector<Group>& groups() const { return groups_; }
  const TrialStatistics& trials() const { return statistics_; }

 private:
  /// What is kept per view besides its public record.
  struct ViewData {
    bool usable = false;
    std::shared_ptr<const IndexedCloud> reference;
    std::shared_ptr<const PointCloud> moving;
    /// Pose by priors alone; only relative poses are taken from it.
    Eigen::Isometry3d T_prior = Eigen::Isometry3d::Identity();
  };
  /// A view that was matched to the last good views outside of any group.
  struct Recovery {
    int from = -1;
    int to = -1;
    TrialOutcome outcome;
  };

  std::size_t at(int view) const { return static_cast<std::size_t>(view); }
  Eigen::Isometry3d priorBetween(int from, int to) const {
    return data_[at(from)].T_prior.inverse() * data_[at(to)].T_prior;
  }
  Status prepare(int view, const Eigen::Isometry3d& T_prev_prior);

  // registrar_groups.cpp
  void openGroup(int view);
  void closeGroups(int last_view);
  const TrialOutcome& registerInGroup(Group& group, int view,
                                      const std::optional<Eigen::Isometry3d>& T_pred_start);
  void placeGroup(Group& group);
  void placeByRegistration(Group& group, const Group& reference);
  Moving movingOf(const Group& group) const;
  Reference referenceOf(const Group& group, const Eigen::Isometry3d& T_ref_group) const;
  const Group* lastPlacedGroup() const;
  void placeByChain();
  void recount();

  // registrar.cpp
  bool placeLive(int view, ViewOutcome& outcome);
  bool reroot(int view);
  bool recover(int view, ViewOutcome& outcome);
  void setPlaced(int view, int group, const TrialOutcome& trial,
                 const Eigen::Isometry3d& T_map_base);
  void setDiscarded(int view, const std::string& reason);
  std::string failureOf(int view) const;
  void linkToPrevious();
  std::vector<PoseGraphEdge> chainEdges() const;
  void runGlobal(GlobalOutcome& outcome);

  RegistrationOptions options_;
  int threads_;
  std::uint64_t seed_;
  GroupPlanner planner_;
  Eigen::Isometry3d T_map_first_ = Eigen::Isometry3d::Identity();
  int root_ = -1;  ///< view whose pose is given, -1 before the first usable one
  std::vector<RegisteredView> views_;
  std::vector<ViewData> data_;
  std::vector<Group> groups_;  ///< by id
  std::vector<Recovery> recoveries_;
  TrialStatistics statistics_;
};

}  // namespace scanner::registration
