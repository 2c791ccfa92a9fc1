#include "scanner/registration/registrar.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "registration/registrar_impl.h"
#include "scanner/registration/sampling.h"

namespace scanner::registration {
namespace {

constexpr std::size_t kMinPoints = 50;

// Distinct streams per view and side from one seed (splitmix64's finaliser).
std::uint64_t mixSeed(std::uint64_t seed, std::uint64_t stream) {
  std::uint64_t z = seed + 0x9e3779b97f4a7c15ULL * (stream + 1);
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31U);
}

// Information of a measurement made in the frame of a group's later member, for the group's first:
// the translation error turns with the frame.
Matrix6 turned(const Matrix6& information, const Eigen::Matrix3d& R) {
  Matrix6 turn = Matrix6::Identity();
  turn.topLeftCorner<3, 3>() = R;
  return turn * information * turn.transpose();
}

bool isPlaced(const Group& group) {
  return group.placement == GroupPlacement::kFirst ||
         group.placement == GroupPlacement::kRegistered ||
         group.placement == GroupPlacement::kSharedViews;
}

}  // namespace

Registrar::Impl::Impl(const RegistrationOptions& options, int threads, std::uint64_t seed)
    : options_(options), threads_(threads), seed_(seed), planner_(options.groups) {
  validate(options);
  if (threads < 1) {
    throw ConfigurationError("registration: threads = " + std::to_string(threads) + " is below 1");
  }
}

void Registrar::Impl::setFirstPose(const Eigen::Isometry3d& T_map_base) {
  if (!views_.empty()) {
    throw ConfigurationError("registration: the first pose was set after the first view");
  }
  if (!isFinite(T_map_base)) throw ConfigurationError("registration: the first pose is not finite");
  T_map_first_ = T_map_base;
}

// Checks the view and its prior and makes the samples.
Status Registrar::Impl::prepare(int view, const Eigen::Isometry3d& T_prev_prior) {
  ViewData& data = data_[at(view)];
  const PointCloud& cloud = views_[at(view)].view->cloud;
  if (view > 0) {
    data.T_prior = data_[at(view - 1)].T_prior;
    if (!isFinite(T_prev_prior)) {
      return {StatusCode::kInvalidInput, "the prior of the view is not finite"};
    }
    data.T_prior = data.T_prior * T_prev_prior;
  }
  if (cloud.size() < kMinPoints) {
    return {StatusCode::kNotEnoughData, "the view has " + std::to_string(cloud.size()) +
                                            " points, fewer than " + std::to_string(kMinPoints)};
  }
  if (!cloud.hasNormals() || !allFinite(cloud)) {
    return {StatusCode::kInvalidInput, "the view has points or normals that are not finite"};
  }
  const SamplingOptions& s = options_.sampling;
  const auto stream = static_cast<std::uint64_t>(view) * 2;
  data.moving = std::make_shared<const PointCloud>(
      sampleCloud(cloud, s.moving_method, s.moving_factor, s, mixSeed(seed_, stream)));
  data.reference = std::make_shared<const IndexedCloud>(
      sampleCloud(cloud, s.reference_method, s.reference_factor, s, mixSeed(seed_, stream + 1)));
  data.usable = true;
  return Status::ok();
}

ViewOutcome Registrar::Impl::add(std::shared_ptr<const View> view,
                                 const Eigen::Isometry3d& T_prev_prior) {
  if (!view) throw ConfigurationError("registration: a null view was added");
  const int k = static_cast<int>(views_.size());
  closeGroups(k - 1);
  views_.emplace_back();
  data_.emplace_back();
  views_.back().view = std::move(view);
  if (k > 0 && isFinite(T_prev_prior)) views_.back().T_prev_prior = T_prev_prior;

  ViewOutcome outcome;
  outcome.status = prepare(k, T_prev_prior);
  const Eigen::Isometry3d T_map_prior = T_map_first_ * data_[at(k)].T_prior;
  const std::vector<int> joined = planner_.add(Eigen::Quaterniond(T_map_prior.linear()));
  if (!outcome.status) {
    setDiscarded(k, outcome.status.message());
  } else if (root_ < 0) {
    root_ = k;
    TrialOutcome none;
    none.step = 0;
    setPlaced(k, -1, none, T_map_prior);
    outcome.registered = true;
  } else {
    std::optional<Eigen::Isometry3d> T_pred_start;
    int start_view = -1;
    for (int id : joined) {
      Group& group = groups_[at(id)];
      if (group.members.empty() || group.closed) continue;
      int predecessor = -1;
      for (const GroupMember& m : group.members) predecessor = m.registered ? m.view : predecessor;
      if (start_view != predecessor) T_pred_start.reset();
      const TrialOutcome& trial = registerInGroup(group, k, T_pred_start);
      outcome.groups += trial.success ? 1 : 0;
      if (trial.success && options_.groups.warm_start && !T_pred_start) {
        T_pred_start = trial.icp.T_ref_mov;
        start_view = predecessor;
      }
    }
    outcome.registered =
        placeLive(k, outcome) || (reroot(k) && placeLive(k, outcome)) || recover(k, outcome);
    if (!outcome.registered) {
      outcome.trial = 8;
      setDiscarded(k, failureOf(k));
      outcome.status = Status(StatusCode::kNoConvergence, views_[at(k)].discard_reason);
    }
  }
  openGroup(k);
  outcome.T_map_base = views_[at(k)].T_map_base;
  linkToPrevious();
  recount();
  return outcome;
}

void Registrar::Impl::setPlaced(int view, int group, const TrialOutcome& trial,
                                const Eigen::Isometry3d& T_map_base) {
  RegisteredView& record = views_[at(view)];
  record.registered = true;
  record.discard_reason.clear();
  record.T_map_base = T_map_base;
  record.group = group;
  record.trial = trial.step;
  record.resampled = trial.resampled;
  record.mean_distance_m = trial.icp.mean_distance_m;
}

void Registrar::Impl::setDiscarded(int view, const std::string& reason) {
  RegisteredView& record = views_[at(view)];
  record.registered = false;
  record.discard_reason = reason;
  record.group = -1;
  record.trial = 8;
}

// Pose from the oldest group that holds the view and another view with a pose; the youngest such.
bool Registrar::Impl::placeLive(int view, ViewOutcome& outcome) {
  for (const Group& group : groups_) {
    const GroupMember* self = group.closed ? nullptr : group.find(view);
    if (self == nullptr) continue;
    for (auto m = group.members.rbegin(); m != group.members.rend(); ++m) {
      if (!m->registered || m->view == view || !views_[at(m->view)].registered) continue;
      const Eigen::Isometry3d T_other_view = m->T_group_view.inverse() * self->T_group_view;
      setPlaced(view, group.id, self->outcome, views_[at(m->view)].T_map_base * T_other_view);
      outcome.trial = self->outcome.step;
      outcome.resampled = self->outcome.resampled;
      outcome.mean_distance_m = self->outcome.icp.mean_distance_m;
      outcome.overlap = self->outcome.icp.overlap;
      outcome.information = self->outcome.icp.information;
      return true;
    }
  }
  return false;
}

// When nothing has ever matched the root, but later views match each other, the map starts with
// them.
bool Registrar::Impl::reroot(int view) {
  const auto placed = std::count_if(views_.begin(), views_.end(),
                                    [](const RegisteredView& v) { return v.registered; });
  if (placed > 1) return false;
  for (const Group& group : groups_) {
    if (group.find(view) == nullptr || group.first_view == view) continue;
    setDiscarded(root_, "no later view could be matched to it");
    root_ = group.first_view;
    TrialOutcome none;
    none.step = 0;
    setPlaced(root_, group.id, none, T_map_first_ * data_[at(root_)].T_prior);
    return true;
  }
  return false;
}

// Last resort for a view that no group could place: the last good views, priors composed since.
bool Registrar::Impl::recover(int view, ViewOutcome& outcome) {
  std::vector<int> good;
  const int wanted =
      std::max(2, planner_.groupSize() == 0 ? options_.groups.max_members : planner_.groupSize());
  for (int v = view - 1; v >= 0 && static_cast<int>(good.size()) < wanted; --v) {
    if (views_[at(v)].registered) good.push_back(v);
  }
  // Against the immediate predecessor alone, a group has just failed.
  if (good.empty()) return false;
  TrialInput input;
  const Eigen::Isometry3d T_last_map = views_[at(good.front())].T_map_base.inverse();
  for (auto v = good.rbegin(); v != good.rend(); ++v) {
    input.reference.push_back(
        {data_[at(*v)].reference, T_last_map * views_[at(*v)].T_map_base, *v});
  }
  input.moving.samples = *data_[at(view)].moving;
  input.T_prior = priorBetween(good.front(), view);
  input.last_view_median = data_[at(good.front())].reference->median();
  Recovery recovery{good.front(), view, runTrials(input, options_, threads_)};
  recoveries_.push_back(recovery);
  if (!recovery.outcome.success) return false;
  setPlaced(view, -1, recovery.outcome,
            views_[at(good.front())].T_map_base * recovery.outcome.icp.T_ref_mov);
  outcome.trial = recovery.outcome.step;
  outcome.resampled = recovery.outcome.resampled;
  outcome.mean_distance_m = recovery.outcome.icp.mean_distance_m;
  outcome.overlap = recovery.outcome.icp.overlap;
  outcome.information = recovery.outcome.icp.information;
  return true;
}

std::string Registrar::Impl::failureOf(int view) const {
  std::string why = "no registered view to match it to";
  if (!recoveries_.empty() && recoveries_.back().to == view) {
    why = recoveries_.back().outcome.icp.status.message();
  }
  for (const Group& group : groups_) {
    for (const GroupMember& m : group.members) {
      if (m.view == view && !m.registered) why = m.outcome.icp.status.message();
    }
  }
  return "all trials failed: " + why;
}

bool Registrar::Impl::discardLast() {
  if (views_.empty()) return false;
  const int last = static_cast<int>(views_.size()) - 1;
  if (!data_[at(last)].usable) return false;
  for (Group& group : groups_) {
    if (group.closed) continue;
    group.members.erase(std::remove_if(group.members.begin(), group.members.end(),
                                       [&](const GroupMember& m) { return m.view == last; }),
                        group.members.end());
  }
  recoveries_.erase(std::remove_if(recoveries_.begin(), recoveries_.end(),
                                   [&](const Recovery& r) { return r.to == last; }),
                    recoveries_.end());
  data_[at(last)].usable = false;
  setDiscarded(last, "taken back by the operator");
  if (root_ == last) root_ = -1;
  linkToPrevious();
  recount();
  return true;
}

void Registrar::Impl::linkToPrevious() {
  int previous = -1;
  for (std::size_t v = 0; v < views_.size(); ++v) {
    RegisteredView& record = views_[v];
    record.previous_registered = -1;
    record.T_prev_registered = record.T_prev_registered_prior = Eigen::Isometry3d::Identity();
    if (!record.registered) continue;
    if (previous >= 0) {
      record.previous_registered = previous;
      record.T_prev_registered = views_[at(previous)].T_map_base.inverse() * record.T_map_base;
      record.T_prev_registered_prior = priorBetween(previous, static_cast<int>(v));
    }
    previous = static_cast<int>(v);
  }
}

std::vector<PoseGraphEdge> Registrar::Impl::chainEdges() const {
  std::vector<PoseGraphEdge> edges;
  const auto both = [&](int a, int b) {
    return views_[at(a)].registered && views_[at(b)].registered;
  };
  for (const Group& group : groups_) {
    const GroupMember* predecessor = nullptr;
    for (const GroupMember& m : group.members) {
      if (!m.registered) continue;
      if (predecessor != nullptr && both(group.first_view, m.view)) {
        edges.push_back({group.first_view, m.view, m.T_group_view,
                         turned(m.outcome.icp.information, predecessor->T_group_view.linear()),
                         false});
      }
      predecessor = &m;
    }
    if (group.placement == GroupPlacement::kRegistered) {
      const int from = groups_[at(group.reference_group)].first_view;
      if (both(from, group.first_view)) {
        edges.push_back({from, group.first_view, group.T_reference_group,
                         group.outcome.icp.information, false});
      }
    }
  }
  for (const Recovery& r : recoveries_) {
    if (!r.outcome.success || !both(r.from, r.to)) continue;
    edges.push_back({r.from, r.to, r.outcome.icp.T_ref_mov, r.outcome.icp.information, false});
  }
  return edges;
}

void Registrar::Impl::runGlobal(GlobalOutcome& outcome) {
  std::vector<GlobalView> clouds;
  std::vector<Eigen::Isometry3d> poses;
  std::vector<int> active;
  for (std::size_t v = 0; v < views_.size(); ++v) {
    clouds.push_back({data_[v].reference, data_[v].moving});
    poses.push_back(views_[v].T_map_base);
    if (views_[v].registered) active.push_back(static_cast<int>(v));
  }
  std::vector<PoseGraphEdge> edges = chainEdges();
  const std::size_t chain_edges = edges.size();
  if (options_.global.loop_closure) {
    const int n = planner_.groupSize() == 0 ? options_.groups.max_members : planner_.groupSize();
    const int separation =
        options_.global.loop_separation > 0 ? options_.global.loop_separation : 2 * n;
    const auto loops =
        findLoops(clouds, poses, active, separation, options_, threads_, outcome.loop);
    edges.insert(edges.end(), loops.begin(), loops.end());
  }
  outcome.edges = edges.size();
  const std::vector<Eigen::Isometry3d> before = poses;
  const auto summary =
      optimizePoseGraph(edges, at(active.front()), options_.global.loop_residual_sigmas, poses);
  if (!summary) {
    outcome.status = summary.status();
    return;
  }
  outcome.graph = *summary;
  summarizeLoops(edges, chain_edges, summary->dropped, before, outcome.loop);
  if (options_.global.joint_refinement) {
    const auto refined = refineJointly(clouds, active, options_, threads_, poses);
    if (refined) outcome.refinement = *refined;
    if (!refined) outcome.status = refined.status();
  }
  for (int v : active) views_[at(v)].T_map_base = poses[at(v)];
}

GlobalOutcome Registrar::Impl::finish() {
  const auto begin = std::chrono::steady_clock::now();
  GlobalOutcome outcome;
  closeGroups(static_cast<int>(views_.size()) - 1);
  for (Group& group : groups_) {
    if (!group.closed) placeGroup(group);  // provisionally: more views may come
  }
  placeByChain();
  recount();
  for (const RegisteredView& v : views_) ++(v.registered ? outcome.registered : outcome.discarded);
  for (const Group& group : groups_) outcome.groups += isPlaced(group) ? 1 : 0;
  if (outcome.registered < 2) {
    outcome.status = Status(StatusCode::kNotEnoughData, "fewer than two registered views");
  } else if (options_.global.enabled) {
    runGlobal(outcome);
  }
  linkToPrevious();
  outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return outcome;
}

Registrar::Registrar(const RegistrationOptions& options, int threads, std::uint64_t seed)
    : impl_(std::make_unique<Impl>(options, threads, seed)) {}
Registrar::~Registrar() = default;
Registrar::Registrar(Registrar&&) noexcept = default;
Registrar& Registrar::operator=(Registrar&&) noexcept = default;
void Registrar::setFirstPose(const Eigen::Isometry3d& T) { impl_->setFirstPose(T); }
ViewOutcome Registrar::add(std::shared_ptr<const View> view, const Eigen::Isometry3d& T_prior) {
  return impl_->add(std::move(view), T_prior);
}
GlobalOutcome Registrar::finish() { return impl_->finish(); }
bool Registrar::discardLast() { return impl_->discardLast(); }
const std::vector<RegisteredView>& Registrar::views() const { return impl_->views(); }
const std::vector<Group>& Registrar::groups() const { return impl_->groups(); }
const TrialStatistics& Registrar::trials() const { return impl_->trials(); }

}  // namespace scanner::registration
