#include "scanner/registration/scan_set.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "scanner/registration/icp.h"
#include "scanner/registration/sampling.h"

namespace scanner::registration {
namespace {

std::size_t at(int view) { return static_cast<std::size_t>(view); }

// Root mean square distance of the points from their mean, metres.
double extent(const PointCloud& cloud) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& p : cloud.points) mean += p.cast<double>();
  mean /= static_cast<double>(std::max<std::size_t>(1, cloud.size()));
  double squares = 0.0;
  for (const Eigen::Vector3f& p : cloud.points) squares += (p.cast<double>() - mean).squaredNorm();
  return std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, cloud.size())));
}

class ScanSet {
 public:
  ScanSet(const std::vector<std::shared_ptr<const View>>& scans,
          const std::vector<Eigen::Isometry3d>& poses, const RegistrationOptions& options,
          int threads, std::uint64_t seed)
      : options_(options), threads_(threads), poses_(poses) {
    outcome_.scans.resize(scans.size());
    double extents = 0.0;
    for (std::size_t i = 0; i < scans.size(); ++i) {
      outcome_.scans[i].T_map_scan = poses[i];
      views_.emplace_back();
      const PointCloud* cloud = scans[i] ? &scans[i]->cloud : nullptr;
      if (cloud == nullptr || cloud->size() < 50) {
        outcome_.scans[i].reason = "fewer than 50 points";
        continue;
      }
      if (!cloud->hasNormals() || !allFinite(*cloud)) {
        outcome_.scans[i].reason = "points or normals that are not finite";
        continue;
      }
      const SamplingOptions& s = options.sampling;
      views_[i].moving = std::make_shared<const PointCloud>(
          sampleCloud(*cloud, s.moving_method, s.moving_factor, s, seed + 2 * i));
      views_[i].reference = std::make_shared<const IndexedCloud>(
          sampleCloud(*cloud, s.reference_method, s.reference_factor, s, seed + 2 * i + 1));
      usable_.push_back(static_cast<int>(i));
      extents += extent(views_[i].reference->cloud());
      outcome_.spacing_m += views_[i].reference->spacing();
    }
    if (usable_.empty()) return;
    outcome_.spacing_m /= static_cast<double>(usable_.size());
    // Initial poses that are off by more than a third of the scan's size are not initial poses.
    drift_ = options.global.loop_drift_m > 0.0
                 ? options.global.loop_drift_m
                 : 0.35 * extents / static_cast<double>(usable_.size());
  }

  Result<ScanSetOutcome> run() {
    if (usable_.empty()) {
      return Status(StatusCode::kNotEnoughData, "no scan has points to register");
    }
    // Twice: overlap predicted from the initial poses, then from what the first pass found.
    for (int pass = 0; pass < 2; ++pass) {
      findEdges(pass);
      connect();
      const Status solved = solveGraph();
      if (!solved) return solved;
    }
    rescueLoneScans();
    const Status solved = solveGraph();
    if (!solved) return solved;
    refine();
    report();
    return outcome_;
  }

 private:
  IcpOptions icpOptions(double distance_m) const {
    IcpOptions o = options_.icp;
    if (o.distance_start_m <= 0.0) o.distance_start_m = std::max(distance_m, 1e-9);
    if (o.max_translation_m <= 0.0) o.max_translation_m = drift_;
    return o;
  }

  void findEdges(int pass) {
    const double distance = pass == 0 ? drift_ : 4.0 * outcome_.spacing_m;
    const auto pairs =
        overlappingPairs(views_, poses_, usable_, std::max(distance, 1e-9),
                         options_.global.loop_min_overlap, 1, options_.correspondence, threads_);
    outcome_.candidates = pairs.size();
    edges_.clear();
    distances_.clear();
    for (const OverlapPair& pair : pairs) {
      Reference reference = {{views_[at(pair.from)].reference, Eigen::Isometry3d::Identity(), -1}};
      addEdge(pair.from, pair.from, pair.to, reference, distance);
    }
  }

  // ICP of scan `to` against `reference` in the frame of `frame`; an edge when it is accepted.
  bool addEdge(int frame, int from, int to, const Reference& reference, double distance) {
    Moving moving;
    moving.samples = *views_[at(to)].moving;
    const Eigen::Isometry3d T_start = poses_[at(frame)].inverse() * poses_[at(to)];
    const IcpResult result = icp(reference, moving, T_start, T_start, Variant::kFull,
                                 icpOptions(distance), options_.correspondence, threads_);
    if (!result.accepted) {
      outcome_.scans[at(to)].reason = "no pair was verified: " + result.status.message();
      return false;
    }
    edges_.push_back({from, to, result.T_ref_mov, result.information, true});
    distances_.push_back(result.mean_distance_m);
    overlaps_.resize(edges_.size());
    overlaps_.back() = result.overlap;
    return true;
  }

  // Spanning tree of the best overlapping edges from the first usable scan on; initial poses of the
  // graph follow it. Fills connected_.
  void connect() {
    connected_.assign(views_.size(), false);
    connected_[at(usable_.front())] = true;
    for (;;) {
      std::size_t best = edges_.size();
      for (std::size_t k = 0; k < edges_.size(); ++k) {
        if (connected_[at(edges_[k].from)] == connected_[at(edges_[k].to)]) continue;
        if (best == edges_.size() || overlaps_[k] > overlaps_[best]) best = k;
      }
      if (best == edges_.size()) return;
      const PoseGraphEdge& e = edges_[best];
      if (connected_[at(e.from)]) {
        poses_[at(e.to)] = poses_[at(e.from)] * e.T_from_to;
      } else {
        poses_[at(e.from)] = poses_[at(e.to)] * e.T_from_to.inverse();
      }
      connected_[at(e.from)] = connected_[at(e.to)] = true;
    }
  }

  Status solveGraph() {
    std::vector<PoseGraphEdge> used;
    for (const PoseGraphEdge& e : edges_) {
      if (connected_[at(e.from)] && connected_[at(e.to)]) used.push_back(e);
    }
    if (used.empty()) return Status::ok();
    const auto summary =
        optimizePoseGraph(used, at(usable_.front()), options_.global.loop_residual_sigmas, poses_);
    if (!summary) return summary.status();
    outcome_.graph = *summary;
    return Status::ok();
  }

  // A scan that overlaps no other one enough may still overlap all of them together.
  void rescueLoneScans() {
    for (int v : usable_) {
      if (connected_[at(v)]) continue;
      Reference reference;
      for (int other : usable_) {
        if (connected_[at(other)]) {
          reference.push_back({views_[at(other)].reference, poses_[at(other)], other});
        }
      }
      Moving moving;
      moving.samples = *views_[at(v)].moving;
      const IcpResult result = icp(reference, moving, poses_[at(v)], poses_[at(v)], Variant::kFull,
                                   icpOptions(drift_), options_.correspondence, threads_);
      if (!result.accepted) continue;
      const int root = usable_.front();
      Matrix6 information = result.information;
      edges_.push_back({root, v, poses_[at(root)].inverse() * result.T_ref_mov, information, true});
      distances_.push_back(result.mean_distance_m);
      overlaps_.push_back(result.overlap);
      poses_[at(v)] = result.T_ref_mov;
      connected_[at(v)] = true;
    }
  }

  void refine() {
    if (!options_.global.joint_refinement) return;
    std::vector<int> active;
    for (int v : usable_) {
      if (connected_[at(v)]) active.push_back(v);
    }
    const auto refined = refineJointly(views_, active, options_, threads_, poses_);
    if (refined) outcome_.refinement = *refined;
  }

  void report() {
    outcome_.edges = edges_.size();
    for (int v : usable_) {
      ScanOutcome& scan = outcome_.scans[at(v)];
      double sum = 0.0;
      for (std::size_t k = 0; k < edges_.size(); ++k) {
        if (edges_[k].from != v && edges_[k].to != v) continue;
        ++scan.edges;
        sum += distances_[k];
      }
      scan.registered = connected_[at(v)];
      if (scan.registered) {
        scan.reason.clear();
        scan.T_map_scan = poses_[at(v)];
        if (scan.edges > 0) scan.mean_distance_m = sum / static_cast<double>(scan.edges);
      } else if (scan.reason.empty()) {
        scan.reason = scan.edges > 0 ? "only matched to scans that are not registered"
                                     : "no other scan overlaps it at the initial poses";
      }
    }
  }

  const RegistrationOptions& options_;
  const int threads_;
  std::vector<Eigen::Isometry3d> poses_;
  std::vector<GlobalView> views_;
  std::vector<int> usable_;
  std::vector<PoseGraphEdge> edges_;
  std::vector<double> distances_;
  std::vector<double> overlaps_;
  std::vector<bool> connected_;
  double drift_ = 0.0;
  ScanSetOutcome outcome_;
};

}  // namespace

RegistrationOptions scanSetOptions() {
  RegistrationOptions o;
  // Normal-space sampling favours the grazing rims of a scan, which lasers measure worst.
  o.sampling.moving_method = SamplingMethod::kUniform;
  o.sampling.moving_factor = 20.0;
  o.sampling.reference_method = SamplingMethod::kUniform;
  o.sampling.reference_factor = 3.0;
  o.sampling.min_samples = 2000;
  o.icp.metric = Metric::kPointToPlane;
  o.icp.stop = StopRule::kAtConvergence;
  o.icp.kernel = RobustKernel::kHuber;
  o.icp.max_iterations = 40;
  o.icp.converged_translation_m = 1e-6;
  o.icp.accept_mean_m = 0.0;
  o.icp.min_overlap = 0.15;
  o.icp.max_rotation_deg = 15.0;
  o.icp.distance_decay = 0.85;
  o.global.loop_drift_m = 0.0;
  o.global.loop_min_overlap = 0.15;
  o.global.refinement_samples = 3000;
  o.global.refinement_rounds = 20;
  o.global.refinement_min_overlap = 0.1;
  return o;
}

Result<ScanSetOutcome> registerScans(const std::vector<std::shared_ptr<const View>>& scans,
                                     const std::vector<Eigen::Isometry3d>& T_map_scan,
                                     const RegistrationOptions& options, int threads,
                                     std::uint64_t seed) {
  validate(options);
  if (threads < 1) throw ConfigurationError("registration: threads is below 1");
  if (scans.size() != T_map_scan.size()) {
    return Status(StatusCode::kInvalidInput, std::to_string(scans.size()) + " scans but " +
                                                 std::to_string(T_map_scan.size()) +
                                                 " initial poses");
  }
  for (std::size_t i = 0; i < T_map_scan.size(); ++i) {
    if (!isFinite(T_map_scan[i])) {
      return Status(StatusCode::kInvalidInput,
                    "the initial pose of scan " + std::to_string(i) + " is not finite");
    }
  }
  return ScanSet(scans, T_map_scan, options, threads, seed).run();
}

std::vector<Eigen::Isometry3d> disturbed(const std::vector<Eigen::Isometry3d>& poses,
                                         double angle_rad, double distance_m, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto uniform = [&]() { return static_cast<double>(random() >> 11U) * 0x1.0p-53; };
  const auto direction = [&]() -> Eigen::Vector3d {
    const double z = 2.0 * uniform() - 1.0;
    const double azimuth = 6.283185307179586 * uniform();
    const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
    return {r * std::cos(azimuth), r * std::sin(azimuth), z};
  };
  std::vector<Eigen::Isometry3d> result = poses;
  for (std::size_t i = 1; i < result.size(); ++i) {
    const Eigen::Vector3d axis = direction();
    const Eigen::Vector3d shift = direction();
    result[i] = result[i] * makePose(distance_m * shift, expSo3(Eigen::Vector3d(angle_rad * axis)));
  }
  return result;
}

}  // namespace scanner::registration
