#include "surface/voxel_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "scanner/core/parallel.h"

namespace scanner::surface {
namespace {

constexpr std::size_t kBlock =
    8;  // views reduced at a time; part of the result, not of the threads
constexpr std::int64_t kBias = std::int64_t{1} << 20;
// A point far more certain than the rest must not decide alone.
constexpr double kLargestWeight = 25.0;

bool keyOf(const Eigen::Vector3d& p, double voxel_m, std::uint64_t& key, Eigen::Vector3f& offset) {
  std::array<std::uint64_t, 3> cell{};
  for (int axis = 0; axis < 3; ++axis) {
    const double index = std::floor(p[axis] / voxel_m);
    if (!(std::abs(index) < static_cast<double>(kBias))) return false;
    cell[static_cast<std::size_t>(axis)] =
        static_cast<std::uint64_t>(static_cast<std::int64_t>(index) + kBias);
    offset[axis] = static_cast<float>(p[axis] - (index + 0.5) * voxel_m);
  }
  key = (cell[2] << 42) | (cell[1] << 21) | cell[0];
  return true;
}

Eigen::Vector3d centerOf(std::uint64_t key, double voxel_m) {
  const std::uint64_t mask = (std::uint64_t{1} << 21) - 1;
  const auto axis = [&](int shift) {
    const auto cell = static_cast<std::int64_t>((key >> shift) & mask) - kBias;
    return (static_cast<double>(cell) + 0.5) * voxel_m;
  };
  return {axis(0), axis(21), axis(42)};
}

/// Adds `sum` to the sum of its voxel (those from `first` on) that faces its way, or as a new one.
void addToVoxel(std::vector<VoxelSum>& sums, std::size_t first, const VoxelSum& sum,
                float cos_angle, bool same_view) {
  std::size_t best = sums.size();
  float best_cos = cos_angle;
  for (std::size_t i = first; i < sums.size(); ++i) {
    const float c = sums[i].normal.dot(sum.normal) /
                    std::max(1e-20F, sums[i].normal.norm() * sum.normal.norm());
    if (c >= best_cos) {
      best_cos = c;
      best = i;
    }
  }
  if (best == sums.size()) {
    sums.push_back(sum);
    return;
  }
  VoxelSum& into = sums[best];
  into.offset += sum.offset;
  into.normal += sum.normal;
  into.color += sum.color;
  into.weight += sum.weight;
  into.views = same_view ? 1 : into.views + sum.views;
}

std::vector<VoxelSum> reduceView(const PosedCloud& view, const VoxelGridSettings& s,
                                 std::size_t& unusable) {
  const PointCloud& cloud = *view.cloud;
  if (!cloud.hasNormals()) {
    unusable = cloud.size();
    return {};
  }
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order;
  std::vector<VoxelSum> singles;
  order.reserve(cloud.size());
  singles.reserve(cloud.size());
  const Eigen::Matrix3f R = view.T_map_cloud.linear().cast<float>();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const float sigma = s.use_sigmas ? cloud.sigmas[i] : 1.0F;
    VoxelSum one;
    const bool usable =
        cloud.points[i].allFinite() && cloud.normals[i].allFinite() &&
        cloud.normals[i].squaredNorm() > 0.25F && std::isfinite(sigma) && sigma > 0.0F &&
        keyOf(view.T_map_cloud * cloud.points[i].cast<double>(), s.voxel_m, one.key, one.offset);
    if (!usable) {
      ++unusable;
      continue;
    }
    const double ratio = s.use_sigmas ? s.reference_sigma_m / static_cast<double>(sigma) : 1.0;
    one.weight = static_cast<float>(std::min(kLargestWeight, ratio * ratio));
    one.offset *= one.weight;
    one.normal = one.weight * (R * cloud.normals[i]).normalized();
    if (s.use_colors) {
      const Rgb8 c = cloud.colors[i];
      one.color = one.weight * Eigen::Vector3f(c.r, c.g, c.b);
    }
    one.views = 1;
    order.emplace_back(one.key, static_cast<std::uint32_t>(singles.size()));
    singles.push_back(one);
  }
  std::sort(order.begin(), order.end());
  std::vector<VoxelSum> sums;
  std::size_t first = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i == 0 || order[i].first != order[i - 1].first) first = sums.size();
    addToVoxel(sums, first, singles[order[i].second], static_cast<float>(s.cos_normal_angle), true);
  }
  return sums;
}

std::vector<VoxelSum> merge(const std::vector<VoxelSum>& a, const std::vector<VoxelSum>& b,
                            double cos_angle) {
  if (a.empty()) return b;
  std::vector<VoxelSum> out;
  out.reserve(a.size() + b.size() / 2);
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.size() || j < b.size()) {
    const std::uint64_t key =
        j == b.size() || (i < a.size() && a[i].key <= b[j].key) ? a[i].key : b[j].key;
    const std::size_t first = out.size();
    while (i < a.size() && a[i].key == key) out.push_back(a[i++]);
    while (j < b.size() && b[j].key == key) {
      addToVoxel(out, first, b[j++], static_cast<float>(cos_angle), false);
    }
  }
  return out;
}

FusedPoints average(const std::vector<VoxelSum>& sums, double voxel_m) {
  FusedPoints out;
  const auto reserve = [&](auto& v) { v.reserve(sums.size()); };
  reserve(out.points), reserve(out.normals), reserve(out.colors);
  reserve(out.weights), reserve(out.views);
  for (const VoxelSum& s : sums) {
    if (!(s.normal.norm() > 1e-6F * s.weight)) continue;
    const Eigen::Vector3d offset = (s.offset / s.weight).cast<double>();
    out.points.push_back((centerOf(s.key, voxel_m) + offset).cast<float>());
    out.normals.push_back(s.normal.normalized());
    out.colors.push_back(s.color / s.weight);
    out.weights.push_back(s.weight);
    out.views.push_back(s.views);
  }
  return out;
}

}  // namespace

FusedPoints fuseIntoVoxels(const std::vector<PosedCloud>& views, const VoxelGridSettings& settings,
                           int threads, std::size_t& unusable) {
  std::vector<VoxelSum> all;
  for (std::size_t begin = 0; begin < views.size(); begin += kBlock) {
    const std::size_t n = std::min(kBlock, views.size() - begin);
    std::array<std::vector<VoxelSum>, kBlock> block;
    std::array<std::size_t, kBlock> left_out{};
    parallelFor(n, 1, threads, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        block[i] = reduceView(views[begin + i], settings, left_out[i]);
      }
    });
    for (const std::size_t count : left_out) unusable += count;
    for (std::size_t step = 1; step < kBlock; step *= 2) {
      parallelFor(kBlock / (2 * step), 1, threads, [&](std::size_t first, std::size_t last) {
        for (std::size_t pair = first; pair < last; ++pair) {
          auto& a = block[pair * 2 * step];
          auto& b = block[pair * 2 * step + step];
          if (!b.empty()) a = merge(a, b, settings.cos_normal_angle);
          b = {};
        }
      });
    }
    all = merge(all, block[0], settings.cos_normal_angle);
  }
  return average(all, settings.voxel_m);
}

void keepOnly(FusedPoints& p, const std::vector<char>& keep) {
  std::size_t n = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    if (!keep[i]) continue;
    p.points[n] = p.points[i];
    p.normals[n] = p.normals[i];
    p.colors[n] = p.colors[i];
    p.weights[n] = p.weights[i];
    p.views[n] = p.views[i];
    ++n;
  }
  p.points.resize(n), p.normals.resize(n), p.colors.resize(n);
  p.weights.resize(n), p.views.resize(n);
}

}  // namespace scanner::surface
