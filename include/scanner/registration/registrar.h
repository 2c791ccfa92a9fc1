#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "scanner/core/cloud.h"
#include "scanner/core/status.h"
#include "scanner/registration/global.h"
#include "scanner/registration/groups.h"
#include "scanner/registration/options.h"

namespace scanner::registration {

/// What add() can say at once.
struct ViewOutcome {
  bool registered = false;
  Eigen::Isometry3d T_map_base = Eigen::Isometry3d::Identity();  ///< valid when registered
  int trial = 0;                 ///< 1..6: step that succeeded (0: the first view; 8: none)
  bool resampled = false;        ///< in step 7's repetition
  double mean_distance_m = 0.0;  ///< of the kept pairs
  double overlap = 0.0;
  int groups = 0;                             ///< groups in which the view was registered
  Matrix6 information = Matrix6::Identity();  ///< of the relative pose; tangent of pose_graph.h
  /// Ok, or why the view is not registered. kInvalidInput and kNotEnoughData for unusable views.
  Status status;
};

struct RegisteredView {
  std::shared_ptr<const View> view;
  bool registered = false;
  std::string discard_reason;                                      ///< empty when registered
  Eigen::Isometry3d T_map_base = Eigen::Isometry3d::Identity();    ///< valid when registered
  Eigen::Isometry3d T_prev_prior = Eigen::Isometry3d::Identity();  ///< given to add()
  /// Motion since the previous registered view as registration sees it, and as the composed priors
  /// saw it: their difference is what ICP had to correct (tables 5.3 to 5.6). Identity for the
  /// first.
  Eigen::Isometry3d T_prev_registered = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_prev_registered_prior = Eigen::Isometry3d::Identity();
  int previous_registered = -1;  ///< position in views(), -1 for the first
  int group = -1;                ///< group that placed it
  int trial = 0;
  bool resampled = false;
  double mean_distance_m = 0.0;
};

struct GlobalOutcome {
  Status status;  ///< ok, or which part of the global stage could not be done, and why
  std::size_t registered = 0;
  std::size_t discarded = 0;
  std::size_t groups = 0;
  std::size_t edges = 0;
  LoopOutcome loop;
  PoseGraphSummary graph;
  RefinementOutcome refinement;
  double seconds = 0.0;
};

/// Registers the views of a recording one by one (thesis 4.5, 4.6; method.md sections 6 to 8).
///
/// As a view arrives it is registered in every open similarity group that it belongs to, against
/// the union of the members before it (eq. 4.12), so that its pose is known at once. A group that
/// can get no more members is registered against the last placed one (eq. 4.14) when the next view
/// arrives. finish() completes this and runs the global stage. A view that no group can place is
/// tried once more against the last good views with the priors composed since, then discarded with
/// a reason; if a later group connects it after all, finish() places it.
///
/// Views are in base_link; poses are T_map_base. Not thread-safe. The result does not depend on
/// `threads`.
class Registrar {
 public:
  /// Throws ConfigurationError for options out of bounds or threads < 1.
  Registrar(const RegistrationOptions& options, int threads, std::uint64_t seed);
  ~Registrar();
  Registrar(Registrar&&) noexcept;
  Registrar& operator=(Registrar&&) noexcept;

  /// Pose of the first added view. Throws ConfigurationError after the first add, or when not
  /// finite.
  void setFirstPose(const Eigen::Isometry3d& T_map_base);

  /// `T_previous_view_prior` = T_prev_cur: motion since the previously *added* view, registered or
  /// not; ignored for the first view. A null view throws.
  ViewOutcome add(std::shared_ptr<const View> view, const Eigen::Isometry3d& T_previous_view_prior);

  /// Completes groups and runs the global stage; poses of views() change. More views may be added
  /// afterwards, and finish() called again.
  GlobalOutcome finish();

  /// Takes the last added view out again (kept in views(), with the reason). False when there is
  /// none that counts. The motion to the view after it is still counted from it.
  bool discardLast();

  const std::vector<RegisteredView>& views() const;  ///< every added view, in order
  const std::vector<Group>& groups() const;
  const TrialStatistics& trials() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::registration
