#include "scanner/registration/sampling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>
#include <string>

namespace scanner::registration {
namespace {

constexpr double kPi = 3.14159265358979323846;

std::vector<std::vector<std::size_t>> fillBuckets(const std::vector<Eigen::Vector3f>& normals,
                                                  const NormalBuckets& buckets) {
  std::vector<std::vector<std::size_t>> content(buckets.count());
  for (std::size_t i = 0; i < normals.size(); ++i) content[buckets.of(normals[i])].push_back(i);
  return content;
}

// How many each bucket gives so that the total is `count`: min(size, level), and one more from some
// buckets that have it, chosen by the generator, to make up the remainder.
std::vector<std::size_t> shares(const std::vector<std::vector<std::size_t>>& content,
                                std::size_t count, std::mt19937_64& random) {
  std::size_t level = 0;
  std::size_t given = 0;
  for (;;) {
    std::size_t deeper = 0;
    for (const auto& bucket : content) deeper += bucket.size() > level ? 1 : 0;
    if (deeper == 0 || given + deeper > count) break;
    given += deeper;
    ++level;
  }
  std::vector<std::size_t> share(content.size());
  std::vector<std::size_t> deeper;
  for (std::size_t b = 0; b < content.size(); ++b) {
    share[b] = std::min(content[b].size(), level);
    if (content[b].size() > level) deeper.push_back(b);
  }
  // Fisher-Yates by hand: std::shuffle's draws differ between standard libraries.
  for (std::size_t i = 0; given < count && i < deeper.size(); ++i, ++given) {
    const std::size_t j = i + static_cast<std::size_t>(random() % (deeper.size() - i));
    std::swap(deeper[i], deeper[j]);
    ++share[deeper[i]];
  }
  return share;
}

// `count` of 0..size-1 at equal steps, from a random offset below one step.
template <typename Emit>
void spread(std::size_t size, std::size_t count, std::mt19937_64& random, const Emit& emit) {
  const double step = static_cast<double>(size) / static_cast<double>(count);
  const double offset = step * static_cast<double>(random() >> 11U) * 0x1.0p-53;
  for (std::size_t k = 0; k < count; ++k) {
    emit(std::min(size - 1, static_cast<std::size_t>(offset + step * static_cast<double>(k))));
  }
}

std::vector<std::size_t> allIndices(std::size_t size) {
  std::vector<std::size_t> all(size);
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}

}  // namespace

NormalBuckets::NormalBuckets(double bucket_rad) : bucket_rad_(bucket_rad) {
  if (!(bucket_rad > 0.0 && bucket_rad <= kPi)) {
    throw ConfigurationError("sampling.bucket_deg: " + std::to_string(bucket_rad * 180.0 / kPi) +
                             " is not within 0 .. 180");
  }
  columns_ = static_cast<std::size_t>(std::max(1.0, std::ceil(2.0 * kPi / bucket_rad - 1e-9)));
  rows_ = static_cast<std::size_t>(std::max(1.0, std::ceil(kPi / bucket_rad - 1e-9)));
}

std::size_t NormalBuckets::of(const Eigen::Vector3f& normal) const {
  const double theta = std::atan2(static_cast<double>(normal.y()), static_cast<double>(normal.x()));
  const double phi = std::acos(std::clamp(static_cast<double>(normal.z()), -1.0, 1.0));
  const auto column = static_cast<std::size_t>(std::max(0.0, (theta + kPi) / bucket_rad_));
  const auto row = static_cast<std::size_t>(phi / bucket_rad_);
  return std::min(row, rows_ - 1) * columns_ + std::min(column, columns_ - 1);
}

std::vector<std::size_t> sampleNormalSpace(const std::vector<Eigen::Vector3f>& normals,
                                           std::size_t count, double bucket_rad,
                                           std::uint64_t seed) {
  if (count >= normals.size()) return allIndices(normals.size());
  const auto content = fillBuckets(normals, NormalBuckets(bucket_rad));
  std::mt19937_64 random(seed);
  const std::vector<std::size_t> share = shares(content, count, random);
  std::vector<std::size_t> chosen;
  chosen.reserve(count);
  for (std::size_t b = 0; b < content.size(); ++b) {
    if (share[b] == 0) continue;
    spread(content[b].size(), share[b], random,
           [&](std::size_t k) { chosen.push_back(content[b][k]); });
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

std::vector<std::size_t> sampleUniform(std::size_t size, std::size_t count, std::uint64_t seed) {
  if (count >= size) return allIndices(size);
  std::vector<std::size_t> chosen;
  if (count == 0) return chosen;
  std::mt19937_64 random(seed);
  spread(size, count, random, [&](std::size_t k) { chosen.push_back(k); });
  return chosen;
}

std::vector<std::size_t> sampleVoxel(const std::vector<Eigen::Vector3f>& points, double voxel_m) {
  if (!(voxel_m > 0.0)) {
    throw ConfigurationError("sampling.voxel_m: " + std::to_string(voxel_m) + " is not positive");
  }
  using Key = std::array<std::int64_t, 3>;
  std::vector<std::pair<Key, std::size_t>> keyed;
  keyed.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    Key key;
    for (int a = 0; a < 3; ++a) {
      key[static_cast<std::size_t>(a)] =
          static_cast<std::int64_t>(std::floor(static_cast<double>(points[i][a]) / voxel_m));
    }
    keyed.emplace_back(key, i);
  }
  std::sort(keyed.begin(), keyed.end());
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < keyed.size(); ++i) {
    if (i == 0 || keyed[i].first != keyed[i - 1].first) chosen.push_back(keyed[i].second);
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

std::vector<std::size_t> dropCrowdedBuckets(const std::vector<Eigen::Vector3f>& normals,
                                            double bucket_rad) {
  const auto content = fillBuckets(normals, NormalBuckets(bucket_rad));
  std::vector<std::size_t> counts;
  for (const auto& bucket : content) {
    if (!bucket.empty()) counts.push_back(bucket.size());
  }
  if (counts.empty()) return {};
  // Lower median: with an even number of buckets, the mean of the middle two would be no count.
  const auto middle = counts.begin() + static_cast<std::ptrdiff_t>((counts.size() - 1) / 2);
  std::nth_element(counts.begin(), middle, counts.end());
  std::vector<std::size_t> kept;
  for (const auto& bucket : content) {
    if (bucket.size() <= *middle) kept.insert(kept.end(), bucket.begin(), bucket.end());
  }
  std::sort(kept.begin(), kept.end());
  return kept;
}

PointCloud sampleCloud(const PointCloud& cloud, SamplingMethod method, double factor,
                       const SamplingOptions& options, std::uint64_t seed) {
  const double wanted = std::ceil(static_cast<double>(cloud.size()) / factor);
  const std::size_t count = std::max(static_cast<std::size_t>(wanted),
                                     static_cast<std::size_t>(std::max(0, options.min_samples)));
  switch (method) {
    case SamplingMethod::kUniform:
      return subset(cloud, sampleUniform(cloud.size(), count, seed));
    case SamplingMethod::kVoxel:
      return subset(cloud, sampleVoxel(cloud.points, options.voxel_m));
    case SamplingMethod::kNormalSpace:
      break;
  }
  const double bucket_rad = options.bucket_deg * kPi / 180.0;
  return subset(cloud, sampleNormalSpace(cloud.normals, count, bucket_rad, seed));
}

}  // namespace scanner::registration
