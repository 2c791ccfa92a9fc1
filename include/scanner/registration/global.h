#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <vector>

#include "scanner/registration/indexed_cloud.h"
#include "scanner/registration/options.h"
#include "scanner/registration/pose_graph.h"

/// Third stage: what is left between views and groups after the chain (thesis 4.6, done there by
/// hand in other programs). Overlap is predicted from poses, loop edges are found and verified by
/// ICP, a pose graph spreads the error, and all views are refined together.
namespace scanner::registration {

/// A view as the global stage sees it.
struct GlobalView {
  std::shared_ptr<const IndexedCloud> reference;  ///< dense samples, matched against
  std::shared_ptr<const PointCloud> moving;       ///< sparse samples, same frame
};

/// Share of (at most 200) samples of `moving` that have a compatible sample of `reference` within
/// `distance_m` when placed by T_ref_mov. 0..1.
double predictOverlap(const IndexedCloud& reference, const PointCloud& moving,
                      const Eigen::Isometry3d& T_ref_mov, double distance_m,
                      const CorrespondenceOptions& options);

struct OverlapPair {
  int from = 0;
  int to = 0;
  double overlap = 0.0;  ///< smaller of the two directions
};

/// Pairs (from < to) of the views listed in `active`, with to - from >= min_separation, that
/// overlap by at least `min_overlap` at the poses given; ordered by (from, to).
std::vector<OverlapPair> overlappingPairs(const std::vector<GlobalView>& views,
                                          const std::vector<Eigen::Isometry3d>& poses,
                                          const std::vector<int>& active, double distance_m,
                                          double min_overlap, int min_separation,
                                          const CorrespondenceOptions& options, int threads);

/// Keeps at most `per_view` pairs per view, the best overlapping first; order as given.
std::vector<OverlapPair> limitPairs(const std::vector<OverlapPair>& pairs, int per_view);

struct LoopOutcome {
  bool closed = false;
  std::size_t candidates = 0;
  std::size_t verified = 0;  ///< by ICP
  std::size_t accepted = 0;  ///< of these, consistent with the graph
  int from = -1;             ///< ends of the longest accepted loop
  int to = -1;
  double residual_m =
      0.0;  ///< disagreement of chain and loop edge before optimisation, longest loop
  double residual_deg = 0.0;
};

/// Loop edges between views at least `separation` apart, each verified by ICP of one end against
/// the other end and its two neighbours in `active`. Counts candidates and verified ones.
std::vector<PoseGraphEdge> findLoops(const std::vector<GlobalView>& views,
                                     const std::vector<Eigen::Isometry3d>& poses,
                                     const std::vector<int>& active, int separation,
                                     const RegistrationOptions& options, int threads,
                                     LoopOutcome& outcome);

/// Fills in what the graph made of the loop edges: edges[first_loop..] are loops, `dropped` those
/// that contradicted the rest, `poses` those before optimisation.
void summarizeLoops(const std::vector<PoseGraphEdge>& edges, std::size_t first_loop,
                    const std::vector<std::size_t>& dropped,
                    const std::vector<Eigen::Isometry3d>& poses, LoopOutcome& outcome);

struct RefinementOutcome {
  int rounds = 0;
  std::size_t pairs = 0;
  double initial_rms_m = 0.0;  ///< point to plane, robustly weighted
  double final_rms_m = 0.0;
  double last_update_m = 0.0;  ///< largest move of a view in the last round
};

/// Multi-view ICP: point to plane between all overlapping pairs of `active` views at once, partners
/// found anew in every round, solved by Gauss-Newton with a sparse Cholesky factorisation;
/// active.front() stays. Tangent: left-multiplied motion [translation; rotation] about each view's
/// centre in the map. Result independent of `threads`. kNotEnoughData without overlapping pairs.
Result<RefinementOutcome> refineJointly(const std::vector<GlobalView>& views,
                                        const std::vector<int>& active,
                                        const RegistrationOptions& options, int threads,
                                        std::vector<Eigen::Isometry3d>& poses);

}  // namespace scanner::registration
