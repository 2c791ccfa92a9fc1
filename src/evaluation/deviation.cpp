#include "scanner/evaluation/deviation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nanoflann.hpp>

#include "evaluation/surface_samples.h"
#include "scanner/core/parallel.h"

namespace scanner::evaluation {
namespace {

constexpr std::size_t kGrain = 2048;

/// Nearest point of a cloud, for models without faces.
class PointTree {
 public:
  explicit PointTree(const std::vector<Eigen::Vector3f>& points)
      : points_(points), tree_(3, *this) {
    tree_.buildIndex();
  }
  bool isWithin(const Eigen::Vector3d& p, double distance_m) const {
    const Eigen::Vector3f query = p.cast<float>();
    std::uint32_t index = 0;
    float squared_m = 0.0F;
    return tree_.knnSearch(query.data(), 1, &index, &squared_m) == 1 &&
           static_cast<double>(squared_m) <= distance_m * distance_m;
  }
  std::size_t kdtree_get_point_count() const { return points_.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points_[i][static_cast<Eigen::Index>(axis)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }

 private:
  const std::vector<Eigen::Vector3f>& points_;
  nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointTree>, PointTree, 3>
      tree_;
};

/// The model without what is not finite.
Mesh finitePart(const Mesh& model) {
  Mesh out;
  std::vector<std::uint32_t> moved(model.vertices.size(), 0);
  const auto& points = model.vertices.points;
  for (std::size_t i = 0; i < points.size(); ++i) {
    moved[i] = static_cast<std::uint32_t>(out.vertices.size());
    if (points[i].allFinite()) out.vertices.points.push_back(points[i]);
  }
  for (const auto& [a, b, c] : model.faces) {
    if (!points[a].allFinite() || !points[b].allFinite() || !points[c].allFinite()) continue;
    if ((points[b] - points[a])
            .cast<double>()
            .cross((points[c] - points[a]).cast<double>())
            .norm() > 0.0) {
      out.faces.push_back({moved[a], moved[b], moved[c]});
    }
  }
  return out;
}

template <typename Surface>
double shareWithin(const std::vector<Eigen::Vector3d>& points, const Surface& surface,
                   const Eigen::Isometry3d& T_surface_point, double distance_m, int threads) {
  std::vector<std::size_t> covered(chunkCount(points.size(), kGrain), 0);
  parallelFor(points.size(), kGrain, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (surface.isWithin(T_surface_point * points[i], distance_m)) ++covered[begin / kGrain];
    }
  });
  std::size_t sum = 0;
  for (const std::size_t n : covered) sum += n;
  return static_cast<double>(sum) / static_cast<double>(points.size());
}

double coverage(const Mesh& model, const Mesh& reference_mesh,
                const Eigen::Isometry3d& T_reference_model, const DeviationOptions& options,
                int threads) {
  const auto samples = sampleSurface(
      reference_mesh, static_cast<std::size_t>(options.coverage_samples), options.seed);
  const Eigen::Isometry3d T_model_reference = T_reference_model.inverse();
  const Mesh usable = finitePart(model);
  if (usable.faces.empty()) {
    return shareWithin(samples.points, PointTree(usable.vertices.points), T_model_reference,
                       options.coverage_m, threads);
  }
  return shareWithin(samples.points, SurfaceDistance(usable), T_model_reference, options.coverage_m,
                     threads);
}

/// The value below which `share` of the sorted values lie, interpolated.
double quantile(const std::vector<double>& sorted, double share) {
  const double at = share * static_cast<double>(sorted.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const std::size_t high = std::min(low + 1, sorted.size() - 1);
  return sorted[low] + (at - static_cast<double>(low)) * (sorted[high] - sorted[low]);
}

}  // namespace

void describe(OptionVisitor& v, DeviationOptions& o) {
  v.option("outlier_m", o.outlier_m, {1e-6, 1e3}, "m",
           "further from the reference than this is counted as an outlier");
  v.option("coverage_m", o.coverage_m, {1e-6, 1e3}, "m",
           "the reference is covered where the model comes this near");
  v.option("align_trim", o.align_trim, {0.0, 0.9}, "",
           "share of the samples, the furthest ones, left out of the alignment");
  v.option("align_samples", o.align_samples, {100, 1e7}, "",
           "samples of the model used by the alignment");
  v.option("coverage_samples", o.coverage_samples, {100, 1e8}, "",
           "samples of the reference, by area, that measure coverage");
  v.option("seed", o.seed, {0, 1e6}, "", "shifts the samples");
}

std::vector<float> signedDistances(const PointCloud& cloud, const SurfaceDistance& reference,
                                   const Eigen::Isometry3d& T_reference_cloud, int threads) {
  std::vector<float> out(cloud.size());
  parallelFor(cloud.size(), kGrain, threads, [&](std::size_t begin, std::size_t end) {
    // Neighbours in memory are mostly neighbours in space: the last answer bounds the next.
    double within_m = std::numeric_limits<double>::infinity();
    Eigen::Vector3d surface_point = Eigen::Vector3d::Zero();
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector3d p = T_reference_cloud * cloud.points[i].cast<double>();
      if (!std::isinf(within_m)) within_m = (p - surface_point).norm();
      const auto nearest = reference.nearest(p, within_m);
      out[i] = static_cast<float>(nearest.signed_m);
      if (std::isnan(nearest.signed_m)) continue;
      surface_point = nearest.point;
      within_m = 0.0;
    }
  });
  return out;
}

DeviationStatistics deviationStatistics(const std::vector<float>& signed_m, double outlier_m) {
  DeviationStatistics out;
  std::vector<double> kept;
  for (const float value : signed_m) {
    if (!std::isfinite(value)) {
      ++out.skipped;
    } else if (std::abs(static_cast<double>(value)) > outlier_m) {
      ++out.outliers;
    } else {
      kept.push_back(static_cast<double>(value));
    }
  }
  out.points = kept.size();
  if (kept.empty()) return out;
  double sum = 0.0, squares = 0.0;
  std::array<double, 2> sum_of_sign{};
  std::array<std::size_t, 2> of_sign{};
  for (const double value : kept) {
    sum += value;
    squares += value * value;
    if (value == 0.0) continue;
    sum_of_sign[value > 0.0 ? 1 : 0] += value;
    ++of_sign[value > 0.0 ? 1 : 0];
  }
  const auto n = static_cast<double>(kept.size());
  out.mean_m = sum / n;
  out.rmse_m = std::sqrt(squares / n);
  if (of_sign[1] > 0) out.mean_positive_m = sum_of_sign[1] / static_cast<double>(of_sign[1]);
  if (of_sign[0] > 0) out.mean_negative_m = sum_of_sign[0] / static_cast<double>(of_sign[0]);
  double about_mean = 0.0;
  for (const double value : kept) about_mean += (value - out.mean_m) * (value - out.mean_m);
  out.sigma_m = kept.size() > 1 ? std::sqrt(about_mean / (n - 1.0)) : 0.0;
  const auto [low, high] = std::minmax_element(kept.begin(), kept.end());
  out.min_m = *low;
  out.max_m = *high;
  for (double& value : kept) value = std::abs(value);
  std::sort(kept.begin(), kept.end());
  out.median_absolute_m = quantile(kept, 0.5);
  out.p95_absolute_m = quantile(kept, 0.95);
  return out;
}

Result<Deviation> deviation(const Mesh& model, const SurfaceDistance& reference,
                            const Mesh& reference_mesh, const Eigen::Isometry3d& T_reference_model,
                            const DeviationOptions& options, int threads) {
  if (const Status status = checkModel(model); !status) return status;
  Deviation out;
  out.alignment = T_reference_model;
  out.signed_m = signedDistances(model.vertices, reference, T_reference_model, threads);
  static_cast<DeviationStatistics&>(out) = deviationStatistics(out.signed_m, options.outlier_m);
  if (out.points == 0) {
    return Status(StatusCode::kNotEnoughData, out.outliers == 0
                                                  ? "no point of the model is finite"
                                                  : "every point of the model is further than " +
                                                        std::to_string(options.outlier_m) +
                                                        " m from the reference: wrong placement?");
  }
  out.coverage = coverage(model, reference_mesh, T_reference_model, options, threads);
  return out;
}

Rgb8 deviationColor(double signed_m, double range_m) {
  if (std::isnan(signed_m)) return {70, 70, 70};
  const double x = 2.0 * std::clamp(signed_m / range_m, -1.0, 1.0);  // -2..2: blue, cyan, green...
  const auto ramp = [](double value) {
    return static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(value, 0.0, 1.0)));
  };
  return {ramp(x), ramp(2.0 - std::abs(x)), ramp(-x)};
}

Mesh colorCoded(const Mesh& model, const Deviation& deviation, double range_m, double outlier_m) {
  if (deviation.signed_m.size() != model.vertices.size()) {
    throw ConfigurationError("colorCoded: " + std::to_string(deviation.signed_m.size()) +
                             " deviations for " + std::to_string(model.vertices.size()) +
                             " vertices");
  }
  Mesh out = model;
  out.vertices.colors.resize(model.vertices.size());
  for (std::size_t i = 0; i < model.vertices.size(); ++i) {
    const double value = static_cast<double>(deviation.signed_m[i]);
    out.vertices.colors[i] =
        std::abs(value) > outlier_m ? kOutlierColor : deviationColor(value, range_m);
  }
  return out;
}

}  // namespace scanner::evaluation
