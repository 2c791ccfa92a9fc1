#include <Eigen/Eigenvalues>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "scanner/core/parallel.h"
#include "scanner/registration/global.h"
#include "scanner/registration/icp.h"
#include "scanner/registration/sampling.h"

namespace scanner::registration {
namespace {

constexpr double kDamping = 1e-4;    // relative, Levenberg-Marquardt
constexpr double kSettled_m = 2e-6;  // far below what any sensor here resolves

std::size_t at(int view) { return static_cast<std::size_t>(view); }

// Blocks of the normal equations of one directed pair, robustly weighted.
struct PairSystem {
  Matrix6 H_ii = Matrix6::Zero();
  Matrix6 H_ij = Matrix6::Zero();
  Matrix6 H_jj = Matrix6::Zero();
  Twist g_i = Twist::Zero();
  Twist g_j = Twist::Zero();
  double weight = 0.0;
  double squares = 0.0;
};

struct DirectedPair {
  int moving = 0;
  int reference = 0;
};

double huberWidth(const std::vector<double>& residuals) {
  std::vector<double> sizes;
  sizes.reserve(residuals.size());
  for (double r : residuals) sizes.push_back(std::abs(r));
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return 2.0 * std::max(1.4826 * *middle, 1e-9);
}

class Refinement {
 public:
  Refinement(const std::vector<GlobalView>& views, const std::vector<int>& active,
             const RegistrationOptions& options, int threads, std::vector<Eigen::Isometry3d>& poses)
      : views_(views), active_(active), options_(options), threads_(threads), poses_(poses) {
    double spacing = 0.0;
    for (int v : active) spacing += views[at(v)].reference->spacing();
    spacing_ = spacing / static_cast<double>(std::max<std::size_t>(1, active.size()));
    const double asked = options.global.refinement_distance_m;
    start_distance_ = asked > 0.0 ? asked : 4.0 * spacing_;
    thinSamples();
  }

  Result<RefinementOutcome> run() {
    RefinementOutcome outcome;
    const auto pairs = limitPairs(overlappingPairs(views_, poses_, active_, start_distance_,
                                                   options_.global.refinement_min_overlap, 1,
                                                   options_.correspondence, threads_),
                                  options_.global.refinement_pairs);
    if (pairs.empty()) return Status(StatusCode::kNotEnoughData, "no two views overlap");
    for (const OverlapPair& p : pairs) {
      directed_.push_back({p.from, p.to});
      directed_.push_back({p.to, p.from});
    }
    outcome.pairs = pairs.size();
    for (int round = 0; round < options_.global.refinement_rounds; ++round) {
      const double distance =
          std::max(2.0 * spacing_, start_distance_ * std::pow(0.8, static_cast<double>(round)));
      const std::vector<PairSystem> systems = linearize(distance);
      const double rms = weightedRms(systems);
      if (round == 0) outcome.initial_rms_m = rms;
      outcome.final_rms_m = rms;
      const Result<double> moved = step(systems);
      if (!moved) return moved.status();
      ++outcome.rounds;
      outcome.last_update_m = *moved;
      if (*moved < kSettled_m && distance <= 2.0 * spacing_) break;
    }
    return outcome;
  }

 private:
  void thinSamples() {
    samples_.resize(views_.size());
    centres_.resize(views_.size(), Eigen::Vector3d::Zero());
    radius_.resize(views_.size(), 1.0);
    slot_.assign(views_.size(), -1);
    int slot = 0;
    for (int v : active_) {
      const PointCloud& all = *views_[at(v)].moving;
      const auto wanted = static_cast<std::size_t>(options_.global.refinement_samples);
      samples_[at(v)].samples = subset(all, sampleUniform(all.size(), wanted, 0));
      const PointCloud& s = samples_[at(v)].samples;
      for (const Eigen::Vector3f& p : s.points) centres_[at(v)] += p.cast<double>();
      centres_[at(v)] /= static_cast<double>(std::max<std::size_t>(1, s.size()));
      double squares = 0.0;
      for (const Eigen::Vector3f& p : s.points) {
        squares += (p.cast<double>() - centres_[at(v)]).squaredNorm();
      }
      radius_[at(v)] = std::sqrt(
          std::max(1e-12, squares / static_cast<double>(std::max<std::size_t>(1, s.size()))));
      if (v != active_.front()) slot_[at(v)] = slot++;
    }
    unknowns_ = 6 * slot;
  }

  std::vector<PairSystem> linearize(double distance) const {
    std::vector<PairSystem> systems(directed_.size());
    parallelFor(directed_.size(), 1, threads_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) systems[k] = linearizePair(directed_[k], distance);
    });
    return systems;
  }

  // Unknowns of view v: [translation; rotation * radius] about its centre, in the map.
  PairSystem linearizePair(const DirectedPair& pair, double distance) const {
    const Eigen::Isometry3d& T_i = poses_[at(pair.moving)];
    const Eigen::Isometry3d& T_j = poses_[at(pair.reference)];
    const Reference reference = {
        {views_[at(pair.reference)].reference, Eigen::Isometry3d::Identity(), pair.reference}};
    const Moving& moving = samples_[at(pair.moving)];
    const auto found = findCorrespondences(reference, moving, T_j.inverse() * T_i,
                                           options_.correspondence, distance, 1);
    PairSystem system;
    if (found.size() < 6) return system;
    std::vector<double> residuals(found.size());
    std::vector<Eigen::Vector3d> placed(found.size());
    std::vector<Eigen::Vector3d> normals(found.size());
    for (std::size_t k = 0; k < found.size(); ++k) {
      placed[k] = T_i * moving.samples.points[found[k].moving].cast<double>();
      normals[k] = T_j.linear() * found[k].normal;
      residuals[k] = normals[k].dot(placed[k] - T_j * found[k].reference);
    }
    const double width = huberWidth(residuals);
    const Eigen::Vector3d c_i = T_i * centres_[at(pair.moving)];
    const Eigen::Vector3d c_j = T_j * centres_[at(pair.reference)];
    for (std::size_t k = 0; k < found.size(); ++k) {
      const double size = std::abs(residuals[k]);
      const double w = size <= width ? 1.0 : width / size;
      Twist J_i;
      Twist J_j;
      J_i << normals[k], (placed[k] - c_i).cross(normals[k]) / radius_[at(pair.moving)];
      J_j << -normals[k], -(placed[k] - c_j).cross(normals[k]) / radius_[at(pair.reference)];
      system.H_ii += w * J_i * J_i.transpose();
      system.H_ij += w * J_i * J_j.transpose();
      system.H_jj += w * J_j * J_j.transpose();
      system.g_i += w * residuals[k] * J_i;
      system.g_j += w * residuals[k] * J_j;
      system.weight += w;
      system.squares += w * residuals[k] * residuals[k];
    }
    return system;
  }

  static double weightedRms(const std::vector<PairSystem>& systems) {
    double weight = 0.0;
    double squares = 0.0;
    for (const PairSystem& s : systems) {
      weight += s.weight;
      squares += s.squares;
    }
    return weight > 0.0 ? std::sqrt(squares / weight) : 0.0;
  }

  // Solves for all views but the first and moves them; returns the largest move.
  Result<double> step(const std::vector<PairSystem>& systems) {
    if (unknowns_ == 0) return 0.0;
    std::vector<Matrix6> diagonal(views_.size(), Matrix6::Zero());
    std::vector<double> weight(views_.size(), 0.0);
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(unknowns_);
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t k = 0; k < systems.size(); ++k) {
      const int i = slot_[at(directed_[k].moving)];
      const int j = slot_[at(directed_[k].reference)];
      diagonal[at(directed_[k].moving)] += systems[k].H_ii;
      diagonal[at(directed_[k].reference)] += systems[k].H_jj;
      weight[at(directed_[k].moving)] += systems[k].weight;
      weight[at(directed_[k].reference)] += systems[k].weight;
      if (i >= 0) gradient.segment<6>(Eigen::Index{6} * i) += systems[k].g_i;
      if (j >= 0) gradient.segment<6>(Eigen::Index{6} * j) += systems[k].g_j;
      if (i < 0 || j < 0) continue;
      append(entries, i, j, systems[k].H_ij);
      append(entries, j, i, systems[k].H_ij.transpose());
    }
    for (int v : active_) {
      const int s = slot_[at(v)];
      if (s >= 0) append(entries, s, s, stiffened(diagonal[at(v)], weight[at(v)]));
    }
    Eigen::SparseMatrix<double> H(unknowns_, unknowns_);
    H.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(H);
    if (solver.info() != Eigen::Success) {
      return Status(StatusCode::kNoConvergence, "the joint refinement could not be solved");
    }
    const Eigen::VectorXd x = -solver.solve(gradient);
    if (!x.allFinite()) {
      return Status(StatusCode::kNoConvergence, "the joint refinement diverged");
    }
    return apply(x);
  }

  // Diagonal block with damping; directions that nothing constrains (a plane among planes) are held
  // where they are, as in solvePointToPlane.
  Matrix6 stiffened(const Matrix6& block, double weight) const {
    if (!(weight > 0.0)) return Matrix6::Identity();
    const Eigen::SelfAdjointEigenSolver<Matrix6> solver(block / weight);
    Matrix6 held = block;
    for (int k = 0; k < 6; ++k) {
      if (solver.eigenvalues()(k) >= options_.icp.degenerate_below) continue;
      const Twist v = solver.eigenvectors().col(k);
      held += weight * v * v.transpose();
    }
    held.diagonal() += kDamping * block.diagonal() + Twist::Constant(1e-9 * weight);
    return held;
  }

  static void append(std::vector<Eigen::Triplet<double>>& entries, int row, int column,
                     const Matrix6& block) {
    for (int r = 0; r < 6; ++r) {
      for (int c = 0; c < 6; ++c) entries.emplace_back(6 * row + r, 6 * column + c, block(r, c));
    }
  }

  double apply(const Eigen::VectorXd& x) {
    double largest = 0.0;
    for (int v : active_) {
      if (slot_[at(v)] < 0) continue;
      const Twist move = x.segment<6>(Eigen::Index{6} * slot_[at(v)]);
      const Eigen::Vector3d centre = poses_[at(v)] * centres_[at(v)];
      const Eigen::Quaterniond R = expSo3(Eigen::Vector3d(move.tail<3>() / radius_[at(v)]));
      const Eigen::Isometry3d motion =
          makePose(centre - R * centre + Eigen::Vector3d(move.head<3>()), R);
      const Eigen::Isometry3d moved = motion * poses_[at(v)];
      poses_[at(v)] =
          makePose(moved.translation(), Eigen::Quaterniond(moved.linear()).normalized());
      largest = std::max(largest, move.norm());
    }
    return largest;
  }

  const std::vector<GlobalView>& views_;
  const std::vector<int>& active_;
  const RegistrationOptions& options_;
  const int threads_;
  std::vector<Eigen::Isometry3d>& poses_;
  double spacing_ = 0.0;
  double start_distance_ = 0.0;
  std::vector<Moving> samples_;
  std::vector<Eigen::Vector3d> centres_;
  std::vector<double> radius_;
  std::vector<int> slot_;  ///< place among the unknowns, -1 for the fixed view and inactive ones
  int unknowns_ = 0;
  std::vector<DirectedPair> directed_;
};

}  // namespace

Result<RefinementOutcome> refineJointly(const std::vector<GlobalView>& views,
                                        const std::vector<int>& active,
                                        const RegistrationOptions& options, int threads,
                                        std::vector<Eigen::Isometry3d>& poses) {
  if (active.size() < 2) return Status(StatusCode::kNotEnoughData, "fewer than two views");
  std::vector<Eigen::Isometry3d> refined = poses;
  const auto outcome = Refinement(views, active, options, threads, refined).run();
  if (outcome) poses = std::move(refined);
  return outcome;
}

}  // namespace scanner::registration
