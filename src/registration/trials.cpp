#include "scanner/registration/trials.h"

#include <cmath>

#include "scanner/registration/sampling.h"

namespace scanner::registration {
namespace {

constexpr double kPi = 3.14159265358979323846;

// The start that puts the median of the moving samples, turned by the prior, on `target`.
Eigen::Isometry3d medianStart(const PointCloud& samples, const Eigen::Isometry3d& T_prior,
                              const Eigen::Vector3d& target) {
  Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
  turn.linear() = T_prior.linear();
  PointCloud turned;
  turned.points = transformed(samples, turn).points;
  turn.translation() = target - medianPoint(turned);
  return turn;
}

bool betterFailure(const IcpResult& a, const IcpResult& b) {
  if (a.inliers == 0 || b.inliers == 0) return a.inliers > b.inliers;
  return a.mean_distance_m < b.mean_distance_m;
}

class Trials {
 public:
  Trials(const TrialInput& input, const RegistrationOptions& options, int threads)
      : input_(input), options_(options), threads_(threads) {}

  TrialOutcome run() {
    if (steps(input_.moving)) return outcome_;
    if (options_.trials.resample) {
      const double bucket_rad = options_.sampling.bucket_deg * kPi / 180.0;
      const PointCloud& samples = input_.moving.samples;
      const auto kept = dropCrowdedBuckets(samples.normals, bucket_rad);
      // Nothing dropped would only repeat the failure.
      if (kept.size() < samples.size() && kept.size() >= 6) {
        Moving thinned;
        thinned.samples = subset(samples, kept);
        for (std::size_t i : kept) {
          if (!input_.moving.owners.empty()) thinned.owners.push_back(input_.moving.owners[i]);
        }
        outcome_.resampled = steps(thinned);
      }
    }
    return outcome_;
  }

 private:
  // Steps 1 to 6; true at the first success.
  bool steps(const Moving& moving) {
    if (pair(moving, input_.T_prior, 1)) return true;
    if (!options_.trials.median_starts || moving.samples.empty()) return false;
    const Eigen::Vector3d& last = input_.last_view_median;
    if (pair(moving, medianStart(moving.samples, input_.T_prior, last), 3)) return true;
    const Eigen::Vector3d all = medianOf(input_.reference);
    return pair(moving, medianStart(moving.samples, input_.T_prior, all), 5);
  }

  // Step `first` (translational) and the next (full) from one start.
  bool pair(const Moving& moving, Eigen::Isometry3d T_start, int first) {
    if (options_.trials.translational) {
      IcpResult result = once(moving, T_start, Variant::kTranslational);
      if (result.accepted) {
        if (options_.trials.refine_translational) {
          const IcpResult full = once(moving, result.T_ref_mov, Variant::kFull);
          if (full.accepted) result = full;
        }
        return succeed(result, first);
      }
      remember(result);
      if (options_.trials.carry_over && result.inliers > 0) T_start = result.T_ref_mov;
    }
    const IcpResult result = once(moving, T_start, Variant::kFull);
    if (result.accepted) return succeed(result, first + 1);
    remember(result);
    return false;
  }

  IcpResult once(const Moving& moving, const Eigen::Isometry3d& T_start, Variant variant) {
    ++outcome_.icp_runs;
    return icp(input_.reference, moving, T_start, input_.T_prior, variant, options_.icp,
               options_.correspondence, threads_);
  }

  bool succeed(const IcpResult& result, int step) {
    outcome_.success = true;
    outcome_.step = step;
    outcome_.icp = result;
    return true;
  }

  void remember(const IcpResult& failure) {
    if (!any_failure_ || betterFailure(failure, outcome_.icp)) outcome_.icp = failure;
    any_failure_ = true;
  }

  const TrialInput& input_;
  const RegistrationOptions& options_;
  const int threads_;
  TrialOutcome outcome_;
  bool any_failure_ = false;
};

}  // namespace

TrialOutcome runTrials(const TrialInput& input, const RegistrationOptions& options, int threads) {
  return Trials(input, options, threads).run();
}

std::array<std::size_t, 9> TrialStatistics::total() const {
  std::array<std::size_t, 9> sum{};
  for (std::size_t i = 0; i < sum.size(); ++i) {
    sum[i] = intra_group[i] + inter_group[i] + recovery[i];
  }
  return sum;
}

}  // namespace scanner::registration
