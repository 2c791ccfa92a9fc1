#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <vector>

namespace scanner::surface {

/// Nearest neighbours of places in a cloud (kd-tree). `points` is not copied and must outlive the
/// tree; finite. Reading is thread-safe.
class KdTree {
 public:
  explicit KdTree(const std::vector<Eigen::Vector3f>& points);
  ~KdTree();
  KdTree(const KdTree&) = delete;
  KdTree& operator=(const KdTree&) = delete;

  /// The k nearest points of p, nearest first; fewer when the cloud is smaller.
  void nearest(const Eigen::Vector3f& p, std::size_t k, std::vector<std::size_t>& indices,
               std::vector<float>& squared_distances) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::surface
