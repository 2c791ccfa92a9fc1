#include "scanner/registration/correspondence.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "scanner/core/parallel.h"

namespace scanner::registration {
namespace {

constexpr double kPi = 3.14159265358979323846;

struct Rule {
  float min_cos;
  bool either_sign;
};

Rule ruleOf(const CorrespondenceOptions& options) {
  const double angle = options.compatible_angle_deg * kPi / 180.0;
  if (options.compatibility == Compatibility::kPlainAngle) {
    return {static_cast<float>(std::cos(angle)), false};
  }
  return {static_cast<float>(std::cos(0.5 * angle)), true};  // 2 acos|n1.n2| < theta_c
}

struct Best {
  std::size_t member = 0;
  std::size_t index = 0;
  float squared_distance = 0.0F;
  bool found = false;
};

// One moving sample against every member; the bound shrinks from member to member.
Best bestOf(const Reference& reference, const std::vector<Eigen::Isometry3f>& T_member_mov,
            const Moving& moving, std::size_t i, const Rule& rule, float squared_bound) {
  Best best;
  best.squared_distance = squared_bound;
  for (std::size_t m = reference.size(); m-- > 0;) {  // the youngest member overlaps most
    if (!moving.owners.empty() && moving.owners[i] == reference[m].owner) continue;
    const Eigen::Vector3f point = T_member_mov[m] * moving.samples.points[i];
    const Eigen::Vector3f normal = T_member_mov[m].linear() * moving.samples.normals[i];
    const IndexedCloud::Match match = reference[m].cloud->nearestCompatible(
        point, normal, rule.min_cos, rule.either_sign, best.squared_distance);
    if (match.found) best = {m, match.index, match.squared_distance, true};
  }
  return best;
}

}  // namespace

bool compatible(const Eigen::Vector3f& n1, const Eigen::Vector3f& n2,
                const CorrespondenceOptions& options) {
  const Rule rule = ruleOf(options);
  const float cosine = n1.dot(n2);
  return (rule.either_sign ? std::abs(cosine) : cosine) >= rule.min_cos;
}

std::vector<Correspondence> findCorrespondences(const Reference& reference, const Moving& moving,
                                                const Eigen::Isometry3d& T_ref_mov,
                                                const CorrespondenceOptions& options,
                                                double max_distance_m, int threads) {
  const Rule rule = ruleOf(options);
  double bound = max_distance_m > 0.0 ? max_distance_m : std::numeric_limits<double>::max();
  if (options.max_distance_m > 0.0) bound = std::min(bound, options.max_distance_m);
  const float squared_bound =
      bound > 1e6 ? std::numeric_limits<float>::max() : static_cast<float>(bound * bound);
  std::vector<Eigen::Isometry3f> T_member_mov;
  for (const PosedIndex& m : reference) {
    T_member_mov.push_back((m.T_ref_cloud.inverse() * T_ref_mov).cast<float>());
  }
  std::vector<Best> best(moving.samples.size());
  parallelFor(best.size(), 128, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      best[i] = bestOf(reference, T_member_mov, moving, i, rule, squared_bound);
    }
  });

  std::vector<Correspondence> pairs;
  pairs.reserve(best.size());
  for (std::size_t i = 0; i < best.size(); ++i) {
    if (!best[i].found) continue;
    const PosedIndex& member = reference[best[i].member];
    const PointCloud& cloud = member.cloud->cloud();
    Correspondence pair;
    pair.moving = static_cast<std::uint32_t>(i);
    pair.reference = member.T_ref_cloud * cloud.points[best[i].index].cast<double>();
    pair.normal = member.T_ref_cloud.linear() * cloud.normals[best[i].index].cast<double>();
    // From the doubles, not the float of the search: a perfect fit should read as one.
    pair.distance = (T_ref_mov * moving.samples.points[i].cast<double>() - pair.reference).norm();
    if (cloud.hasSigmas() && moving.samples.hasSigmas()) {
      pair.sigma = std::hypot(static_cast<double>(cloud.sigmas[best[i].index]),
                              static_cast<double>(moving.samples.sigmas[i]));
    }
    pairs.push_back(pair);
  }
  return pairs;
}

std::vector<Correspondence> rejectDistant(std::vector<Correspondence> pairs, double factor) {
  if (pairs.empty() || factor <= 0.0) return pairs;
  std::vector<double> distances;
  distances.reserve(pairs.size());
  for (const Correspondence& pair : pairs) distances.push_back(pair.distance);
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  const double limit = std::max(factor * *middle, 1e-9);  // rounding is not distance
  pairs.erase(std::remove_if(pairs.begin(), pairs.end(),
                             [&](const Correspondence& pair) { return pair.distance > limit; }),
              pairs.end());
  return pairs;
}

}  // namespace scanner::registration
