#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "evaluation/surface_samples.h"
#include "scanner/core/parallel.h"
#include "scanner/core/se3.h"
#include "scanner/evaluation/deviation.h"

namespace scanner::evaluation {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

constexpr double kPi = 3.14159265358979323846;
constexpr std::size_t kGrain = 256;
constexpr std::size_t kMinPairs = 12;
constexpr double kTukey = 4.685;          // 95 % efficiency on normal noise
constexpr double kMadToSigma = 1.4826;    // of normal noise
constexpr double kStricter = 0.7;         // tolerance of an iteration over the one before
constexpr double kFinest = 1e-7;          // of the reference's radius
constexpr double kMinNormalCosine = 0.5;  // 60 degrees
constexpr double kFreeDirection = 1e-7;   // of the largest eigenvalue: the shape says nothing there

/// One sample and its nearest point of the reference.
struct Pair {
  Eigen::Vector3d moved;  ///< the sample, in the reference frame
  Eigen::Vector3d normal;
  double residual_m = 0.0;  ///< along the normal
  double distance_m = 0.0;
  bool usable = false;
};

struct NormalEquations {
  Matrix6d A = Matrix6d::Zero();
  Twist b = Twist::Zero();
};

/// Iterated closest points of a set of samples, from one pose on. Unless that is known to be near,
/// outliers are told from displacement only by and by.
class TrimmedIcp {
 public:
  TrimmedIcp(const SurfaceSamples& samples, const SurfaceDistance& reference, double trim,
             int threads, const Eigen::Isometry3d& start, bool near)
      : samples_(samples),
        reference_(reference),
        trim_(trim),
        threads_(threads),
        T_reference_model_(start),
        tolerance_m_(near ? 0.0 : std::numeric_limits<double>::infinity()),
        pairs_(samples.points.size()) {}

  /// One iteration; how far it moved the model at most, in metres. kNoConvergence when too few
  /// pairs are left.
  Result<double> iterate();
  const Eigen::Isometry3d& pose() const { return T_reference_model_; }
  /// Median distance of all samples as paired last; robust against outliers up to a half.
  double medianDistance() const;
  /// The weights have reached their final strictness.
  bool annealed() const { return annealed_; }

 private:
  void pair();
  double trimAndWeigh();
  NormalEquations accumulate(double limit_m, const Eigen::Vector3d& center, double radius) const;

  const SurfaceSamples& samples_;
  const SurfaceDistance& reference_;
  double trim_;
  int threads_;
  Eigen::Isometry3d T_reference_model_;
  double tolerance_m_;  ///< pairs nearer than this have a say, whatever the noise seems to be
  bool annealed_ = false;
  std::vector<Pair> pairs_;
  std::vector<Eigen::Vector3d> surface_points_;  ///< of the iteration before: bounds for the search
};

void TrimmedIcp::pair() {
  const bool first = surface_points_.empty();
  surface_points_.resize(pairs_.size());
  parallelFor(pairs_.size(), kGrain, threads_, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Pair& pair = pairs_[i];
      pair.moved = T_reference_model_ * samples_.points[i];
      const auto nearest =
          first ? reference_.nearest(pair.moved)
                : reference_.nearest(pair.moved, (pair.moved - surface_points_[i]).norm());
      surface_points_[i] = nearest.point;
      pair.normal = nearest.normal;
      pair.distance_m = std::abs(nearest.signed_m);
      pair.residual_m = nearest.normal.dot(pair.moved - nearest.point);
      pair.usable = !nearest.on_boundary;
      if (!samples_.normals.empty()) {
        const double cosine =
            (T_reference_model_.linear() * samples_.normals[i]).dot(nearest.normal);
        if (cosine < kMinNormalCosine) pair.usable = false;  // NaN, unknown, stays in
      }
    }
  });
}

double TrimmedIcp::medianDistance() const {
  std::vector<double> distances;
  distances.reserve(pairs_.size());
  for (const Pair& pair : pairs_) distances.push_back(pair.distance_m);
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

/// Leaves out the furthest pairs; returns the distance from which Tukey's function gives the others
/// no weight, 0 when too few are left.
double TrimmedIcp::trimAndWeigh() {
  std::vector<double> distances;
  for (const Pair& pair : pairs_) {
    if (pair.usable) distances.push_back(pair.distance_m);
  }
  if (distances.size() < kMinPairs) return 0.0;
  std::sort(distances.begin(), distances.end());
  const auto last =
      static_cast<std::size_t>((1.0 - trim_) * static_cast<double>(distances.size() - 1));
  const double trimmed_m = distances[last];
  for (Pair& pair : pairs_) pair.usable = pair.usable && pair.distance_m <= trimmed_m;
  // A displaced side of a box is half of the points, and all of them look like outliers beside
  // sides that slid along themselves. So the first iterations weigh all alike, and grow stricter.
  tolerance_m_ = std::isinf(tolerance_m_) ? 2.0 * trimmed_m : kStricter * tolerance_m_;
  const double tukey_m = kTukey * kMadToSigma * distances[last / 2];
  annealed_ = tolerance_m_ <= tukey_m || tolerance_m_ <= kFinest * reference_.radius();
  // The floor keeps a perfect fit from weighting its own rounding.
  return std::max({tolerance_m_, tukey_m, kFinest * reference_.radius()});
}

NormalEquations TrimmedIcp::accumulate(double limit_m, const Eigen::Vector3d& center,
                                       double radius) const {
  std::vector<NormalEquations> chunks(chunkCount(pairs_.size(), kGrain));
  parallelFor(pairs_.size(), kGrain, threads_, [&](std::size_t begin, std::size_t end) {
    NormalEquations& own = chunks[begin / kGrain];
    for (std::size_t i = begin; i < end; ++i) {
      const Pair& pair = pairs_[i];
      if (!pair.usable || pair.distance_m > limit_m) continue;
      const double ratio = pair.distance_m / limit_m;
      const double weight = (1.0 - ratio * ratio) * (1.0 - ratio * ratio);
      Twist row;
      row << pair.normal, (pair.moved - center).cross(pair.normal) / radius;
      own.A += weight * row * row.transpose();
      own.b -= weight * pair.residual_m * row;
    }
  });
  NormalEquations sum;
  for (const NormalEquations& chunk : chunks) {
    sum.A += chunk.A;
    sum.b += chunk.b;
  }
  return sum;
}

Result<double> TrimmedIcp::iterate() {
  pair();
  const double limit_m = trimAndWeigh();
  if (limit_m <= 0.0) {
    return Status(StatusCode::kNoConvergence,
                  "alignment: almost no part of the model faces the reference");
  }
  // Rotations are about the reference's centre and scaled to metres at its rim.
  const Eigen::Vector3d center = reference_.center();
  const double radius = reference_.radius();
  const NormalEquations equations = accumulate(limit_m, center, radius);
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(equations.A);
  Twist step = Twist::Zero();
  for (int i = 0; i < 6; ++i) {
    const double value = solver.eigenvalues()[i];
    if (!(value > kFreeDirection * solver.eigenvalues()[5])) continue;
    const Twist direction = solver.eigenvectors().col(i);
    step += direction.dot(equations.b) / value * direction;
  }
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = expSo3(step.tail<3>() / radius).toRotationMatrix();
  motion.translation() = center - motion.linear() * center + step.head<3>();
  T_reference_model_ = motion * T_reference_model_;
  T_reference_model_.linear() = nearestRotation(T_reference_model_.linear());
  return step.head<3>().norm() + step.tail<3>().norm();
}

SurfaceSamples everyNth(const SurfaceSamples& samples, std::size_t count) {
  SurfaceSamples out;
  const std::size_t n = std::min(count, samples.points.size());
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t i = k * samples.points.size() / n;
    out.points.push_back(samples.points[i]);
    if (!samples.normals.empty()) out.normals.push_back(samples.normals[i]);
  }
  return out;
}

Result<SurfaceSamples> modelSamples(const Mesh& model, const DeviationOptions& options) {
  if (Status status = checkModel(model); !status) return status;
  SurfaceSamples samples =
      sampleSurface(model, static_cast<std::size_t>(options.align_samples), options.seed);
  if (samples.points.size() < kMinPairs) {
    return Status(
        StatusCode::kNotEnoughData,
        "alignment: the model has " + std::to_string(samples.points.size()) + " usable points");
  }
  return samples;
}

Eigen::Vector3d medianOf(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d median;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    values.reserve(points.size());
    for (const auto& p : points) values.push_back(p[axis]);
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    median[axis] = *middle;
  }
  return median;
}

}  // namespace

Result<Eigen::Isometry3d> align(const Mesh& model, const SurfaceDistance& reference,
                                const Mesh& /*reference_mesh*/, const Eigen::Isometry3d& initial,
                                const DeviationOptions& options, int threads) {
  struct Level {
    std::size_t samples;
    int iterations;
    double converged;  ///< step, as a share of the reference's radius
    bool near;
  };
  const Result<SurfaceSamples> all = modelSamples(model, options);
  if (!all) return all.status();
  Eigen::Isometry3d T = initial;
  double step_m = 0.0;
  for (const Level& level : {Level{1000, 80, 1e-4, false}, Level{5000, 30, 1e-5, true},
                             Level{all->points.size(), 60, 1e-8, true}}) {
    const SurfaceSamples samples = everyNth(*all, level.samples);
    TrimmedIcp icp(samples, reference, options.align_trim, threads, T, level.near);
    for (int i = 0; i < level.iterations; ++i) {
      const Result<double> step = icp.iterate();
      if (!step) return step.status();
      step_m = *step;
      if (icp.annealed() && step_m < level.converged * reference.radius()) break;
    }
    T = icp.pose();
  }
  if (!(step_m < 1e-5 * reference.radius())) {
    return Status(
        StatusCode::kNoConvergence,
        "alignment: still moving by " + std::to_string(1e3 * step_m) + " mm an iteration");
  }
  return T;
}

Result<Eigen::Isometry3d> searchPlacement(const Mesh& model, const SurfaceDistance& reference,
                                          const Mesh& reference_mesh,
                                          const Eigen::Isometry3d& initial,
                                          const DeviationOptions& options, int threads) {
  constexpr std::size_t kSamples = 800;
  constexpr int kTurns = 24, kIterations = 20;
  constexpr double kClearlyBetter = 0.7;
  const Result<SurfaceSamples> all = modelSamples(model, options);
  if (!all) return all.status();
  const SurfaceSamples samples = everyNth(*all, kSamples);
  const Eigen::Vector3d from = medianOf(samples.points);
  const Eigen::Vector3d to = medianOf(sampleSurface(reference_mesh, kSamples, options.seed).points);
  Eigen::Isometry3d best = initial;
  double best_m = std::numeric_limits<double>::infinity();
  for (int turn = -1; turn < kTurns; ++turn) {
    Eigen::Isometry3d start = initial;
    if (turn >= 0) {
      start = Eigen::AngleAxisd(2.0 * kPi * turn / kTurns, Eigen::Vector3d::UnitZ());
      start.translation() = to - start.linear() * from;
    }
    TrimmedIcp icp(samples, reference, options.align_trim, threads, start, false);
    bool usable = true;
    for (int i = 0; usable && i < kIterations; ++i) usable = icp.iterate().isOk();
    // What the caller said counts for more than a start that is only a little nearer.
    const double distance_m = icp.medianDistance() * (turn < 0 ? kClearlyBetter : 1.0);
    if (!usable || !(distance_m < best_m)) continue;
    best_m = distance_m;
    best = icp.pose();
  }
  if (std::isinf(best_m)) {
    return Status(StatusCode::kNoConvergence, "alignment: no start brings the model near");
  }
  return best;
}

}  // namespace scanner::evaluation
