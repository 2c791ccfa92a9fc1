#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>

#include "scanner/registration/icp.h"
#include "scanner/registration/options.h"

/// The eight steps that try one pair of clouds (thesis 4.6, fig. 4.12; method.md section 8).
namespace scanner::registration {

struct TrialInput {
  Reference reference;                                        ///< P_r
  Moving moving;                                              ///< P_c
  Eigen::Isometry3d T_prior = Eigen::Isometry3d::Identity();  ///< T_ref_mov
  /// Per-axis median of the "last view" in the reference frame: the predecessor inside a group, the
  /// previous group between groups.
  Eigen::Vector3d last_view_median = Eigen::Vector3d::Zero();
};

struct TrialOutcome {
  bool success = false;
  int step = 8;            ///< 1..6: the one that succeeded; 8: none did
  bool resampled = false;  ///< it succeeded in step 7's repetition
  IcpResult icp;           ///< of the success; of the best failure otherwise (lowest mean distance)
  int icp_runs = 0;
  int reportedStep() const { return success && resampled ? 7 : step; }
};

/// Runs steps 1 to 8, first success wins.
TrialOutcome runTrials(const TrialInput& input, const RegistrationOptions& options, int threads);

/// Number of pairs that each step settled, as in table 5.1. Index 1..8; 0 is unused.
struct TrialStatistics {
  std::array<std::size_t, 9> intra_group{};
  std::array<std::size_t, 9> inter_group{};
  std::array<std::size_t, 9>
      recovery{};  ///< views that no group could place, against the last good
  std::array<std::size_t, 9> total() const;
};

}  // namespace scanner::registration
