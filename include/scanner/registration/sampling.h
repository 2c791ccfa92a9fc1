#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "scanner/core/cloud.h"
#include "scanner/registration/options.h"

/// Selection of the points that take part in ICP (thesis 4.5; Rusinkiewicz and Levoy, 3DIM 2001).
/// All functions are pure: same input and seed, same indices, in increasing order. Points need
/// finite, unit normals where normals are used.
namespace scanner::registration {

/// Buckets of `bucket_rad` x `bucket_rad` in the spherical angles of a normal (eq. 4.9):
/// theta = atan2(y, x) in [-pi, pi), phi = acos z in [0, pi].
class NormalBuckets {
 public:
  /// Throws ConfigurationError unless 0 < bucket_rad <= pi.
  explicit NormalBuckets(double bucket_rad);
  std::size_t count() const { return columns_ * rows_; }
  std::size_t of(const Eigen::Vector3f& normal) const;

 private:
  double bucket_rad_;
  std::size_t columns_;
  std::size_t rows_;
};

/// `count` points whose normals spread as evenly as possible over the buckets: every bucket gives
/// the same number, or all that it has. Inside a bucket the points are spread over its list (hence
/// over the image, which the order follows), from a seeded offset. All points when count >= size.
std::vector<std::size_t> sampleNormalSpace(const std::vector<Eigen::Vector3f>& normals,
                                           std::size_t count, double bucket_rad,
                                           std::uint64_t seed);

/// `count` points at equal steps through the cloud, from a seeded offset.
std::vector<std::size_t> sampleUniform(std::size_t size, std::size_t count, std::uint64_t seed);

/// The first point of every occupied voxel of side `voxel_m` (metres, > 0).
std::vector<std::size_t> sampleVoxel(const std::vector<Eigen::Vector3f>& points, double voxel_m);

/// Step 7 of the trials: what is left after dropping the samples of every bucket that holds more
/// samples than the median over the occupied buckets. May return everything or nothing; the caller
/// looks.
std::vector<std::size_t> dropCrowdedBuckets(const std::vector<Eigen::Vector3f>& normals,
                                            double bucket_rad);

/// Samples of `cloud` as the options say: ceil(size / factor), at least min_samples.
PointCloud sampleCloud(const PointCloud& cloud, SamplingMethod method, double factor,
                       const SamplingOptions& options, std::uint64_t seed);

}  // namespace scanner::registration
