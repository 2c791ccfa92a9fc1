#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "scanner/core/mesh.h"
#include "scanner/core/options.h"
#include "scanner/core/status.h"
#include "scanner/evaluation/report.h"

namespace scanner::evaluation {

/// Block `evaluation`.
struct DeviationOptions {
  double outlier_m =
      0.025;  ///< further from the reference than this: counted in outliers, not used
  double coverage_m = 0.005;  ///< the reference is covered where the model comes this near
  double align_trim = 0.1;  ///< share of the samples, the furthest ones, left out of the alignment
  int align_samples = 20000;
  int coverage_samples = 200000;  ///< on the reference, by area
  int seed = 1;
};
void describe(OptionVisitor& v, DeviationOptions& o);

/// Distances to a triangle mesh, through Embree's point query. Immutable and thread-safe; answers
/// do not depend on how Embree built its tree.
class SurfaceDistance {
 public:
  /// Vertices at exactly the same place count as one, so that seams of a texture do not disturb the
  /// signs. Faces without area are left out. Throws ConfigurationError for a mesh without faces
  /// that have an area, with an index out of range or a vertex that is not finite.
  explicit SurfaceDistance(const Mesh& reference);
  ~SurfaceDistance();
  SurfaceDistance(SurfaceDistance&&) noexcept;

  struct Nearest {
    /// Positive outside (angle-weighted pseudonormals, Baerentzen and Aanaes 2005); exact for a
    /// closed oriented surface. NaN for a point that is not finite.
    double signed_m = std::numeric_limits<double>::quiet_NaN();
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    std::uint32_t face = 0;                            ///< the lowest of those equally near
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< of that face, unit length
    bool on_boundary = false;  ///< the nearest point is on the rim of an open surface
  };
  /// Exact nearest point of the surface, in double precision. `within_m`: a distance known not to
  /// be exceeded, which saves time and changes nothing else.
  Nearest nearest(const Eigen::Vector3d& point,
                  double within_m = std::numeric_limits<double>::infinity()) const;

  /// Whether the surface comes as near as `distance_m`. False for a point that is not finite.
  bool isWithin(const Eigen::Vector3d& point, double distance_m) const;

  /// Half the diagonal of the bounding box, metres.
  double radius() const;
  Eigen::Vector3d center() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// design: keys of deviation.json; one row of tables 5.7 and 5.8. What is not known (a mean over no
/// points) is NaN and becomes null.
struct DeviationStatistics {
  double max_m = kUnknown, min_m = kUnknown;
  double mean_positive_m = kUnknown, mean_negative_m = kUnknown;
  double mean_m = kUnknown;
  double sigma_m = kUnknown;  ///< about the mean, n - 1 in the denominator
  double rmse_m = kUnknown;   ///< about zero
  double median_absolute_m = kUnknown, p95_absolute_m = kUnknown;
  std::size_t points = 0;    ///< compared, outliers not among them
  std::size_t outliers = 0;  ///< further than outlier_m from the reference
  std::size_t skipped = 0;   ///< vertices that are not finite
};

struct Deviation : DeviationStatistics {
  double coverage = 0.0;  ///< share of the reference's area within coverage_m of the model
  Eigen::Isometry3d alignment = Eigen::Isometry3d::Identity();  ///< T_reference_model
  std::vector<float> signed_m;  ///< of every vertex of the model; outliers included, NaN if skipped
};

/// Signed distance of every point, moved by `T_reference_cloud`; NaN for a point that is not
/// finite.
std::vector<float> signedDistances(const PointCloud& cloud, const SurfaceDistance& reference,
                                   const Eigen::Isometry3d& T_reference_cloud, int threads);

DeviationStatistics deviationStatistics(const std::vector<float>& signed_m, double outlier_m);

/// Signed distance of every vertex of `model`, moved by `T_reference_model`. kNotEnoughData for an
/// empty model or when every point is an outlier, kInvalidInput for a face index out of range.
Result<Deviation> deviation(const Mesh& model, const SurfaceDistance& reference,
                            const Mesh& reference_mesh, const Eigen::Isometry3d& T_reference_model,
                            const DeviationOptions& options, int threads);

/// Rigid motion T_reference_model that brings the model onto the reference: point-to-plane ICP on
/// samples of the model, coarse to fine, from `initial`; errors of a few centimetres and degrees
/// are recovered. The furthest samples are trimmed, the rest weighted by Tukey's function, pairs
/// with opposed normals or on the rim of an open reference left out. Directions that the shape does
/// not fix keep their initial value. kNoConvergence, kNotEnoughData.
Result<Eigen::Isometry3d> align(const Mesh& model, const SurfaceDistance& reference,
                                const Mesh& reference_mesh, const Eigen::Isometry3d& initial,
                                const DeviationOptions& options, int threads);

/// The start for align() when nothing is known but that z is up in both frames: `initial`, or the
/// model's median on the reference's, turned about z, whichever a few coarse iterations bring
/// clearly nearest. kNotEnoughData.
Result<Eigen::Isometry3d> searchPlacement(const Mesh& model, const SurfaceDistance& reference,
                                          const Mesh& reference_mesh,
                                          const Eigen::Isometry3d& initial,
                                          const DeviationOptions& options, int threads);

/// Colour of a deviation: blue at -range_m, through cyan to green at 0, through yellow to red at
/// +range_m. Dark grey for NaN.
Rgb8 deviationColor(double signed_m, double range_m);

inline constexpr Rgb8 kOutlierColor{150, 150, 150};

/// The model with every vertex in the colour of its deviation: blue below, green on, red above the
/// surface, at most +-range_m; outliers grey. Throws ConfigurationError when the deviation is of
/// another model.
Mesh colorCoded(const Mesh& model, const Deviation& deviation, double range_m, double outlier_m);

}  // namespace scanner::evaluation
