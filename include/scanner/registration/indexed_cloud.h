#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <vector>

#include "scanner/core/cloud.h"

namespace scanner::registration {

/// Samples of one view with their kd-tree, in the view's own frame. Built once per view and shared
/// by every registration that matches against it; immutable, hence safe to use from many threads.
class IndexedCloud {
 public:
  /// `samples`: finite points with unit normals. An empty cloud is allowed and matches nothing.
  explicit IndexedCloud(PointCloud samples);
  ~IndexedCloud();
  IndexedCloud(const IndexedCloud&) = delete;
  IndexedCloud& operator=(const IndexedCloud&) = delete;

  const PointCloud& cloud() const { return cloud_; }
  /// Mean distance from a sample to its nearest neighbour, metres; 0 with fewer than two samples.
  double spacing() const { return spacing_; }
  const Eigen::Vector3d& median() const { return median_; }  ///< per axis

  struct Match {
    bool found = false;
    std::size_t index = 0;
    float squared_distance = 0.0F;
  };
  /// The nearest sample closer than sqrt(squared_bound) whose normal n has n . normal >= min_cos
  /// (or |n . normal| >= min_cos when `either_sign`). Exact: the tree is searched for compatible
  /// points, not for a fixed number of neighbours that may all be incompatible.
  Match nearestCompatible(const Eigen::Vector3f& point, const Eigen::Vector3f& normal,
                          float min_cos, bool either_sign, float squared_bound) const;
  /// Indices of the (at most) k nearest samples, nearest first.
  std::vector<std::size_t> nearest(const Eigen::Vector3f& point, std::size_t k) const;

 private:
  struct Tree;
  PointCloud cloud_;
  std::unique_ptr<Tree> tree_;
  double spacing_ = 0.0;
  Eigen::Vector3d median_ = Eigen::Vector3d::Zero();
};

/// One member of a reference: its samples, where they lie in the reference frame, and whose they
/// are.
struct PosedIndex {
  std::shared_ptr<const IndexedCloud> cloud;
  Eigen::Isometry3d T_ref_cloud = Eigen::Isometry3d::Identity();
  int owner = -1;  ///< view that the samples come from
};

/// Union of the samples of several views (P_r), never copied together: a point is looked up in each
/// member's own tree. So a reference that grows by a view, or moves, needs no new tree.
using Reference = std::vector<PosedIndex>;

/// The samples that are moved (P_c), in their own frame. `owners` is empty, or names each sample's
/// view; a sample is then never matched to samples of the same owner.
struct Moving {
  PointCloud samples;
  std::vector<int> owners;
};

/// Per-axis median of all samples of the reference, in its frame. NaN when it is empty.
Eigen::Vector3d medianOf(const Reference& reference);
/// Mean spacing of the members; union density is not taken into account. 0 when empty.
double spacingOf(const Reference& reference);

}  // namespace scanner::registration
