#include "scanner/registration/pose_graph.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <ceres/product_manifold.h>
#include <ceres/solver.h>

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <string>

namespace scanner::registration {
namespace {

// Error of pose_graph.h, whitened. A pose is [tx ty tz qx qy qz qw] (Eigen's order).
class EdgeCost {
 public:
  EdgeCost(const PoseGraphEdge& edge, const Matrix6& sqrt_information)
      : t_(edge.T_from_to.translation()),
        q_(Eigen::Quaterniond(edge.T_from_to.linear()).normalized()),
        sqrt_information_(sqrt_information) {}

  template <typename T>
  bool operator()(const T* const from, const T* const to, T* residual) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Vector> t_i(from);
    const Eigen::Map<const Vector> t_j(to);
    const Eigen::Map<const Eigen::Quaternion<T>> q_i(from + 3);
    const Eigen::Map<const Eigen::Quaternion<T>> q_j(to + 3);
    Eigen::Quaternion<T> dq = q_.template cast<T>().conjugate() * (q_i.conjugate() * q_j);
    if (dq.w() < T(0.0)) dq.coeffs() = -dq.coeffs();  // q and -q are one rotation
    Eigen::Map<Eigen::Matrix<T, 6, 1>> e(residual);
    e.template head<3>() = q_i.conjugate() * Vector(t_j - t_i) - t_.template cast<T>();
    e.template tail<3>() = T(2.0) * dq.vec();
    e = (sqrt_information_.template cast<T>() * e).eval();
    return true;
  }

 private:
  Eigen::Vector3d t_;
  Eigen::Quaterniond q_;
  Matrix6 sqrt_information_;
};

using PoseBlock = std::array<double, 7>;

PoseBlock toBlock(const Eigen::Isometry3d& T) {
  PoseBlock block{};
  Eigen::Map<Eigen::Vector3d>(block.data()) = T.translation();
  Eigen::Map<Eigen::Quaterniond> q(block.data() + 3);
  q = Eigen::Quaterniond(T.linear()).normalized();
  return block;
}

Eigen::Isometry3d fromBlock(const PoseBlock& block) {
  return makePose(Eigen::Map<const Eigen::Vector3d>(block.data()),
                  Eigen::Map<const Eigen::Quaterniond>(block.data() + 3).normalized());
}

Status checkEdges(const std::vector<PoseGraphEdge>& edges,
                  const std::vector<Eigen::Isometry3d>& poses) {
  const int n = static_cast<int>(poses.size());
  for (const PoseGraphEdge& e : edges) {
    if (e.from < 0 || e.to < 0 || e.from >= n || e.to >= n || e.from == e.to) {
      return {StatusCode::kInvalidInput, "edge " + std::to_string(e.from) + " - " +
                                             std::to_string(e.to) + " has no such poses"};
    }
    const bool definite =
        e.information.allFinite() && Eigen::LLT<Matrix6>(e.information).info() == Eigen::Success;
    const auto from = static_cast<std::size_t>(e.from);
    const auto to = static_cast<std::size_t>(e.to);
    if (!isFinite(e.T_from_to) || !definite || !isFinite(poses[from]) || !isFinite(poses[to])) {
      return {StatusCode::kInvalidInput, "edge " + std::to_string(e.from) + " - " +
                                             std::to_string(e.to) +
                                             " is not finite or its information not definite"};
    }
  }
  return Status::ok();
}

// One solve over the edges that are not dropped. False when Ceres gives up.
bool solveOnce(const std::vector<PoseGraphEdge>& edges, const std::vector<bool>& dropped,
               std::size_t fixed, double loop_sigmas, std::vector<PoseBlock>& blocks,
               PoseGraphSummary& summary) {
  ceres::Problem problem;
  std::vector<bool> used(blocks.size(), false);
  for (std::size_t k = 0; k < edges.size(); ++k) {
    if (dropped[k]) continue;
    const PoseGraphEdge& e = edges[k];
    const Matrix6 root = Eigen::LLT<Matrix6>(e.information).matrixU();
    PoseBlock& from = blocks[static_cast<std::size_t>(e.from)];
    PoseBlock& to = blocks[static_cast<std::size_t>(e.to)];
    ceres::LossFunction* loss = e.loop ? new ceres::CauchyLoss(loop_sigmas) : nullptr;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<EdgeCost, 6, 7, 7>(new EdgeCost(e, root)), loss,
        from.data(), to.data());
    used[static_cast<std::size_t>(e.from)] = used[static_cast<std::size_t>(e.to)] = true;
  }
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (!used[i]) continue;
    problem.SetManifold(
        blocks[i].data(),
        new ceres::ProductManifold<ceres::EuclideanManifold<3>, ceres::EigenQuaternionManifold>());
    if (i == fixed) problem.SetParameterBlockConstant(blocks[i].data());
  }
  if (problem.NumResidualBlocks() == 0) return true;
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.num_threads = 1;  // one order of summation: the same bytes every time
  options.max_num_iterations = 100;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.gradient_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary report;
  ceres::Solve(options, &problem, &report);
  if (!report.IsSolutionUsable()) return false;
  summary.iterations += static_cast<int>(report.iterations.size());
  summary.final_cost = report.final_cost;
  return true;
}

double costAt(const std::vector<PoseGraphEdge>& edges,
              const std::vector<Eigen::Isometry3d>& poses) {
  double cost = 0.0;
  for (const PoseGraphEdge& e : edges) {
    const Twist error = edgeError(e, poses[static_cast<std::size_t>(e.from)],
                                  poses[static_cast<std::size_t>(e.to)]);
    cost += 0.5 * error.dot(e.information * error);
  }
  return cost;
}

}  // namespace

Twist edgeError(const PoseGraphEdge& edge, const Eigen::Isometry3d& T_map_from,
                const Eigen::Isometry3d& T_map_to) {
  const PoseBlock from = toBlock(T_map_from);
  const PoseBlock to = toBlock(T_map_to);
  Twist error;
  EdgeCost(edge, Matrix6::Identity())(from.data(), to.data(), error.data());
  return error;
}

Result<PoseGraphSummary> optimizePoseGraph(const std::vector<PoseGraphEdge>& edges,
                                           std::size_t fixed, double loop_sigmas,
                                           std::vector<Eigen::Isometry3d>& poses) {
  const Status checked = checkEdges(edges, poses);
  if (!checked) return checked;
  PoseGraphSummary summary;
  summary.initial_cost = costAt(edges, poses);
  std::vector<PoseBlock> blocks;
  blocks.reserve(poses.size());
  for (const Eigen::Isometry3d& pose : poses) blocks.push_back(toBlock(pose));
  std::vector<bool> dropped(edges.size(), false);
  if (!solveOnce(edges, dropped, fixed, loop_sigmas, blocks, summary)) {
    return Status(StatusCode::kNoConvergence, "the pose graph could not be solved");
  }
  for (std::size_t k = 0; k < edges.size(); ++k) {
    const PoseGraphEdge& e = edges[k];
    if (!e.loop) continue;
    const Twist error = edgeError(e, fromBlock(blocks[static_cast<std::size_t>(e.from)]),
                                  fromBlock(blocks[static_cast<std::size_t>(e.to)]));
    if (std::sqrt(error.dot(e.information * error)) > 3.0 * loop_sigmas) {
      dropped[k] = true;
      summary.dropped.push_back(k);
    }
  }
  if (!summary.dropped.empty() && !solveOnce(edges, dropped, fixed, loop_sigmas, blocks, summary)) {
    return Status(StatusCode::kNoConvergence, "the pose graph could not be solved");
  }
  std::vector<Eigen::Isometry3d> solved;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    solved.push_back(i == fixed ? poses[i] : fromBlock(blocks[i]));
    if (!isFinite(solved.back())) {
      return Status(StatusCode::kNoConvergence, "the pose graph gave a pose that is not finite");
    }
  }
  poses = std::move(solved);
  return summary;
}

}  // namespace scanner::registration
