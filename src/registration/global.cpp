#include "scanner/registration/global.h"

#include <algorithm>
#include <cmath>

#include "scanner/core/parallel.h"
#include "scanner/registration/icp.h"

namespace scanner::registration {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr std::size_t kProbes = 200;

std::size_t at(int view) { return static_cast<std::size_t>(view); }

// Sphere about the samples, to skip pairs that are nowhere near each other.
struct Sphere {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 0.0;
};

Sphere boundingSphere(const PointCloud& cloud, const Eigen::Isometry3d& T_map_cloud) {
  Sphere sphere;
  if (cloud.empty()) return sphere;
  for (const Eigen::Vector3f& p : cloud.points) sphere.centre += p.cast<double>();
  sphere.centre /= static_cast<double>(cloud.size());
  for (const Eigen::Vector3f& p : cloud.points) {
    sphere.radius = std::max(sphere.radius, (p.cast<double>() - sphere.centre).norm());
  }
  sphere.centre = T_map_cloud * sphere.centre;
  return sphere;
}

// ICP of one end of a loop against the other and its neighbours.
IcpResult verifyLoop(const std::vector<GlobalView>& views,
                     const std::vector<Eigen::Isometry3d>& poses, const std::vector<int>& active,
                     const OverlapPair& pair, const RegistrationOptions& options, int threads) {
  IcpOptions icp_options = options.icp;
  icp_options.metric = Metric::kPointToPlane;
  icp_options.stop = StopRule::kAtConvergence;
  icp_options.kernel = RobustKernel::kHuber;
  icp_options.max_iterations = std::max(30, options.icp.max_iterations);
  icp_options.converged_translation_m = std::max(1e-5, options.icp.converged_translation_m);
  icp_options.min_overlap = std::max(options.icp.min_overlap, options.global.loop_min_overlap);
  icp_options.max_rotation_deg = options.global.loop_drift_deg;
  icp_options.max_translation_m = options.global.loop_drift_m;
  icp_options.distance_start_m = std::max(1e-6, options.global.loop_drift_m);
  icp_options.distance_floor_m = 0.0;

  Reference reference;
  const Eigen::Isometry3d T_from_map = poses[at(pair.from)].inverse();
  const auto self = std::find(active.begin(), active.end(), pair.from);
  const auto add = [&](int v) {
    reference.push_back({views[at(v)].reference, T_from_map * poses[at(v)], v});
  };
  if (self != active.begin()) add(*(self - 1));
  if (self + 1 != active.end()) add(*(self + 1));
  add(pair.from);
  Moving moving;
  moving.samples = *views[at(pair.to)].moving;
  const Eigen::Isometry3d T_start = T_from_map * poses[at(pair.to)];
  return icp(reference, moving, T_start, T_start, Variant::kFull, icp_options,
             options.correspondence, threads);
}

}  // namespace

double predictOverlap(const IndexedCloud& reference, const PointCloud& moving,
                      const Eigen::Isometry3d& T_ref_mov, double distance_m,
                      const CorrespondenceOptions& options) {
  if (moving.empty()) return 0.0;
  const bool plain = options.compatibility == Compatibility::kPlainAngle;
  const double angle = options.compatible_angle_deg * kPi / 180.0;
  const auto min_cos = static_cast<float>(std::cos(plain ? angle : 0.5 * angle));
  const Eigen::Isometry3f T = T_ref_mov.cast<float>();
  const std::size_t step = std::max<std::size_t>(1, moving.size() / kProbes);
  std::size_t probes = 0;
  std::size_t hits = 0;
  for (std::size_t i = 0; i < moving.size(); i += step, ++probes) {
    const auto match =
        reference.nearestCompatible(T * moving.points[i], T.linear() * moving.normals[i], min_cos,
                                    !plain, static_cast<float>(distance_m * distance_m));
    hits += match.found ? 1 : 0;
  }
  return static_cast<double>(hits) / static_cast<double>(probes);
}

std::vector<OverlapPair> overlappingPairs(const std::vector<GlobalView>& views,
                                          const std::vector<Eigen::Isometry3d>& poses,
                                          const std::vector<int>& active, double distance_m,
                                          double min_overlap, int min_separation,
                                          const CorrespondenceOptions& options, int threads) {
  std::vector<Sphere> spheres(views.size());
  for (int v : active) spheres[at(v)] = boundingSphere(*views[at(v)].moving, poses[at(v)]);
  std::vector<OverlapPair> pairs;
  for (std::size_t a = 0; a < active.size(); ++a) {
    for (std::size_t b = a + 1; b < active.size(); ++b) {
      const int from = std::min(active[a], active[b]);
      const int to = std::max(active[a], active[b]);
      if (to - from < min_separation) continue;
      const double gap = (spheres[at(from)].centre - spheres[at(to)].centre).norm();
      if (gap > spheres[at(from)].radius + spheres[at(to)].radius + distance_m) continue;
      pairs.push_back({from, to, 0.0});
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const OverlapPair& a, const OverlapPair& b) {
    return a.from != b.from ? a.from < b.from : a.to < b.to;
  });
  parallelFor(pairs.size(), 4, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const GlobalView& from = views[at(pairs[k].from)];
      const GlobalView& to = views[at(pairs[k].to)];
      const Eigen::Isometry3d T_from_to =
          poses[at(pairs[k].from)].inverse() * poses[at(pairs[k].to)];
      const double forward =
          predictOverlap(*from.reference, *to.moving, T_from_to, distance_m, options);
      if (forward < min_overlap) continue;
      const double backward =
          predictOverlap(*to.reference, *from.moving, T_from_to.inverse(), distance_m, options);
      pairs[k].overlap = std::min(forward, backward);
    }
  });
  pairs.erase(std::remove_if(pairs.begin(), pairs.end(),
                             [&](const OverlapPair& p) {
                               return p.overlap <= 0.0 || p.overlap < min_overlap;
                             }),
              pairs.end());
  return pairs;
}

std::vector<OverlapPair> limitPairs(const std::vector<OverlapPair>& pairs, int per_view) {
  std::vector<std::size_t> order(pairs.size());
  int views = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    order[i] = i;
    views = std::max(views, pairs[i].to + 1);
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return pairs[a].overlap > pairs[b].overlap;
  });
  std::vector<int> used(at(views), 0);
  std::vector<bool> kept(pairs.size(), false);
  for (std::size_t i : order) {
    int& from = used[at(pairs[i].from)];
    int& to = used[at(pairs[i].to)];
    // A pair stays while one of its views still lacks partners, so that nobody is left alone.
    if (from >= per_view && to >= per_view) continue;
    kept[i] = true;
    ++from;
    ++to;
  }
  std::vector<OverlapPair> result;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (kept[i]) result.push_back(pairs[i]);
  }
  return result;
}

std::vector<PoseGraphEdge> findLoops(const std::vector<GlobalView>& views,
                                     const std::vector<Eigen::Isometry3d>& poses,
                                     const std::vector<int>& active, int separation,
                                     const RegistrationOptions& options, int threads,
                                     LoopOutcome& outcome) {
  const GlobalOptions& g = options.global;
  const auto candidates =
      limitPairs(overlappingPairs(views, poses, active, std::max(1e-6, g.loop_drift_m),
                                  g.loop_min_overlap, separation, options.correspondence, threads),
                 g.loops_per_view);
  outcome.candidates = candidates.size();
  std::vector<PoseGraphEdge> edges;
  for (const OverlapPair& pair : candidates) {
    const IcpResult result = verifyLoop(views, poses, active, pair, options, threads);
    if (!result.accepted) continue;
    edges.push_back({pair.from, pair.to, result.T_ref_mov, result.information, true});
  }
  outcome.verified = edges.size();
  return edges;
}

void summarizeLoops(const std::vector<PoseGraphEdge>& edges, std::size_t first_loop,
                    const std::vector<std::size_t>& dropped,
                    const std::vector<Eigen::Isometry3d>& poses, LoopOutcome& outcome) {
  for (std::size_t k = first_loop; k < edges.size(); ++k) {
    if (std::find(dropped.begin(), dropped.end(), k) != dropped.end()) continue;
    ++outcome.accepted;
    const PoseGraphEdge& e = edges[k];
    if (outcome.closed && e.to - e.from <= outcome.to - outcome.from) continue;
    outcome.closed = true;
    outcome.from = e.from;
    outcome.to = e.to;
    const Twist error = edgeError(e, poses[at(e.from)], poses[at(e.to)]);
    outcome.residual_m = error.head<3>().norm();
    outcome.residual_deg = error.tail<3>().norm() * 180.0 / kPi;
  }
}

}  // namespace scanner::registration
