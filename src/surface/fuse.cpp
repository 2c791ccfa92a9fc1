#include "scanner/surface/fuse.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "scanner/core/parallel.h"
#include "scanner/core/se3.h"
#include "scanner/core/status.h"
#include "surface/knn.h"
#include "surface/point_grid.h"
#include "surface/projection.h"
#include "surface/voxel_map.h"

namespace scanner::surface {
namespace {

double cosDeg(double degrees) { return std::cos(degrees * 3.14159265358979323846 / 180.0); }

/// 0 when empty.
double median(std::vector<double>& values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void requireUsable(const std::vector<PosedCloud>& views, int threads) {
  if (threads < 1) {
    throw ConfigurationError("fuse: threads is " + std::to_string(threads) +
                             ", must be at least 1");
  }
  for (std::size_t i = 0; i < views.size(); ++i) {
    const std::string name = "fuse: view " + std::to_string(i);
    if (views[i].cloud == nullptr) throw ConfigurationError(name + " has no cloud");
    if (!isFinite(views[i].T_map_cloud)) throw ConfigurationError(name + " has a pose with NaN");
  }
}

struct Scale {
  double spacing_m = 0.0;
  double noise_m = 0.0;
};

/// Samples of nearest-neighbour distance and of the deviation from the local plane in one view.
void sampleView(const PointCloud& cloud, std::vector<double>& spacings,
                std::vector<double>& noises) {
  constexpr std::size_t kSamples = 400;
  constexpr std::size_t kNeighbors = 16;
  const PointCloud finite = finitePoints(cloud, false);
  if (finite.size() < 4) return;
  const KdTree tree(finite.points);
  std::vector<std::size_t> indices;
  std::vector<float> d2;
  const std::size_t step = std::max<std::size_t>(1, finite.size() / kSamples);
  for (std::size_t i = 0; i < finite.size(); i += step) {
    tree.nearest(finite.points[i], kNeighbors, indices, d2);
    const auto apart = std::find_if(d2.begin(), d2.end(), [](float d) { return d > 0.0F; });
    if (apart == d2.end()) continue;  // all of them in one place
    spacings.push_back(std::sqrt(double{*apart}));
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const std::size_t j : indices) mean += finite.points[j].cast<double>();
    mean /= static_cast<double>(indices.size());
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const std::size_t j : indices) {
      const Eigen::Vector3d d = finite.points[j].cast<double>() - mean;
      scatter += d * d.transpose();
    }
    const double smallest =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter, Eigen::EigenvaluesOnly)
            .eigenvalues()[0];
    noises.push_back(std::sqrt(std::max(0.0, smallest) / static_cast<double>(indices.size() - 3)));
  }
}

Scale estimateScale(const std::vector<PosedCloud>& views, int threads) {
  constexpr std::size_t kViews = 6;
  std::vector<const PointCloud*> chosen;
  const std::size_t step = std::max<std::size_t>(1, (views.size() + kViews - 1) / kViews);
  for (std::size_t i = 0; i < views.size(); i += step) chosen.push_back(views[i].cloud);
  std::vector<std::vector<double>> spacings(chosen.size());
  std::vector<std::vector<double>> noises(chosen.size());
  parallelFor(chosen.size(), 1, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) sampleView(*chosen[i], spacings[i], noises[i]);
  });
  for (std::size_t i = 1; i < chosen.size(); ++i) {
    spacings[0].insert(spacings[0].end(), spacings[i].begin(), spacings[i].end());
    noises[0].insert(noises[0].end(), noises[i].begin(), noises[i].end());
  }
  if (chosen.empty()) return {};
  return {median(spacings[0]), median(noises[0])};
}

/// Median of the finite, positive sigmas of a sample of the points; 0 without any.
double medianSigma(const std::vector<PosedCloud>& views) {
  std::vector<double> sample;
  for (const PosedCloud& view : views) {
    if (!view.cloud->hasSigmas()) continue;
    const std::size_t step = std::max<std::size_t>(1, view.cloud->size() / 1000);
    for (std::size_t i = 0; i < view.cloud->size(); i += step) {
      const double s = double{view.cloud->sigmas[i]};
      if (std::isfinite(s) && s > 0.0) sample.push_back(s);
    }
  }
  return median(sample);
}

/// Flags of the points that the filters keep.
std::vector<char> filter(const FusedPoints& points, const FusionOptions& o, double radius_m,
                         int threads, FusionStatistics& stats) {
  const PointGrid grid(points.points, radius_m);
  enum : char { kDrop, kKeep, kUnsupported, kContradicted };
  std::vector<char> keep(points.size(), kKeep);
  const auto cos_angle = static_cast<float>(cosDeg(o.normal_angle_deg));
  const double covered = o.coverage_factor * o.min_views;
  parallelFor(points.size(), 2048, threads, [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> seen;
    for (std::size_t k = begin; k < end; ++k) {
      const std::size_t i = grid.order()[k];
      seen.clear();
      int neighbors = -1;  // the point finds itself
      double around = 0.0;
      double agreeing = 0.0;
      grid.forEachWithin(points.points[i], radius_m, [&](std::size_t j, float) {
        const float c = points.normals[j].dot(points.normals[i]);
        // The other side of a thin sheet neither speaks for nor against the point.
        if (c > -0.5F) around += double{points.weights[j]};
        if (c > cos_angle) agreeing += double{points.weights[j]};
        if (c <= 0.0F) return;
        ++neighbors;
        seen.push_back(points.views[j]);
      });
      if (neighbors < o.min_neighbors) {
        keep[i] = kDrop;
      } else if (agreeing < o.min_agreement * around) {
        keep[i] = kContradicted;
      } else if (points.views[i] < static_cast<std::uint32_t>(o.min_views)) {
        // The upper quartile, so that a few stray averages next to it do not count as cover.
        const auto upper = seen.begin() + static_cast<std::ptrdiff_t>(seen.size() * 3 / 4);
        std::nth_element(seen.begin(), upper, seen.end());
        if (static_cast<double>(*upper) >= covered) keep[i] = kUnsupported;
      }
    }
  });
  for (char& k : keep) {
    stats.isolated += k == kDrop ? 1 : 0;
    stats.unsupported += k == kUnsupported ? 1 : 0;
    stats.contradicted += k == kContradicted ? 1 : 0;
    k = k == kKeep ? 1 : 0;
  }
  return keep;
}

/// Greedy thinning, best supported points first. A dropped point gives its colour and weight to the
/// one it is dropped for.
std::vector<char> thin(FusedPoints& points, double distance_m, double cos_normal_angle) {
  const PointGrid grid(points.points, distance_m);
  std::vector<std::uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return points.weights[a] > points.weights[b];
  });
  enum : char { kGone = 0, kOpen = 1, kKept = 2 };
  std::vector<char> state(points.size(), kOpen);
  const auto cos_angle = static_cast<float>(cos_normal_angle);
  for (const std::uint32_t i : order) {
    if (state[i] != kOpen) continue;
    state[i] = kKept;
    Eigen::Vector3f color = points.weights[i] * points.colors[i];
    float weight = points.weights[i];
    grid.forEachWithin(points.points[i], distance_m, [&](std::size_t j, float) {
      if (state[j] != kOpen || points.normals[j].dot(points.normals[i]) < cos_angle) return;
      state[j] = kGone;
      color += points.weights[j] * points.colors[j];
      weight += points.weights[j];
      points.views[i] = std::max(points.views[i], points.views[j]);
    });
    points.colors[i] = color / weight;
    points.weights[i] = weight;
  }
  return state;
}

PointCloud toCloud(const FusedPoints& points, const VoxelGridSettings& s) {
  PointCloud out;
  out.points = points.points;
  out.normals = points.normals;
  if (s.use_colors) {
    out.colors.reserve(points.size());
    const auto channel = [](float v) {
      return static_cast<std::uint8_t>(std::clamp(std::lround(v), 0L, 255L));
    };
    for (const auto& c : points.colors) {
      out.colors.push_back({channel(c.x()), channel(c.y()), channel(c.z())});
    }
  }
  if (s.use_sigmas) {
    out.sigmas.reserve(points.size());
    for (const float w : points.weights) {
      out.sigmas.push_back(static_cast<float>(s.reference_sigma_m / std::sqrt(double{w})));
    }
  }
  return out;
}

}  // namespace

PointCloud fuse(const std::vector<PosedCloud>& views, const FusionOptions& options, int threads,
                FusionStatistics* statistics) {
  requireUsable(views, threads);
  FusionStatistics stats;
  VoxelGridSettings settings;
  settings.cos_normal_angle = cosDeg(options.normal_angle_deg);
  settings.use_colors = settings.use_sigmas = true;
  for (const PosedCloud& view : views) {
    stats.input_points += view.cloud->size();
    if (view.cloud->empty()) continue;
    settings.use_colors = settings.use_colors && view.cloud->hasColors();
    settings.use_sigmas = settings.use_sigmas && view.cloud->hasSigmas();
  }
  const double sigma = settings.use_sigmas ? medianSigma(views) : 0.0;
  settings.use_sigmas = sigma > 0.0;
  settings.reference_sigma_m = settings.use_sigmas ? sigma : 1.0;
  const Scale scale = estimateScale(views, threads);
  stats.spacing_m = scale.spacing_m;
  stats.noise_m = std::max(scale.noise_m, sigma);
  stats.voxel_m = options.voxel_m > 0.0 ? options.voxel_m
                                        : std::max(2.0 * stats.spacing_m, 2.0 * stats.noise_m);
  settings.voxel_m = stats.voxel_m;
  FusedPoints points;
  if (stats.voxel_m > 0.0) {
    points = fuseIntoVoxels(views, settings, threads, stats.unusable_points);
  } else {
    stats.unusable_points = stats.input_points;  // nothing finite, or everything in one place
  }
  stats.voxels = points.size();
  keepOnly(points,
           filter(points, options, options.neighbor_radius_voxels * stats.voxel_m, threads, stats));
  for (int round = 0; round < options.projection_rounds; ++round) {
    projectOntoLocalSurface(points, options.projection_radius_voxels * stats.voxel_m,
                            options.projection_degree, settings.cos_normal_angle, threads);
  }
  if (options.thinning_voxels > 0.0) {
    const std::size_t before = points.size();
    keepOnly(points,
             thin(points, options.thinning_voxels * stats.voxel_m, settings.cos_normal_angle));
    stats.thinned = before - points.size();
  }
  stats.output_points = points.size();
  if (statistics != nullptr) *statistics = stats;
  return toCloud(points, settings);
}

}  // namespace scanner::surface
