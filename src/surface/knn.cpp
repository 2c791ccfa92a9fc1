#include "surface/knn.h"

#include <nanoflann.hpp>

namespace scanner::surface {
namespace {

struct Adaptor {
  const std::vector<Eigen::Vector3f>& points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i][static_cast<Eigen::Index>(axis)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Adaptor>,
                                                 Adaptor, 3, std::size_t>;

}  // namespace

struct KdTree::Impl {
  explicit Impl(const std::vector<Eigen::Vector3f>& points)
      : adaptor{points}, tree(3, adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(16)) {
    tree.buildIndex();
  }
  Adaptor adaptor;
  Tree tree;
};

KdTree::KdTree(const std::vector<Eigen::Vector3f>& points)
    : impl_(std::make_unique<Impl>(points)) {}
KdTree::~KdTree() = default;

void KdTree::nearest(const Eigen::Vector3f& p, std::size_t k, std::vector<std::size_t>& indices,
                     std::vector<float>& squared_distances) const {
  indices.resize(k);
  squared_distances.resize(k);
  if (impl_->adaptor.points.empty()) k = 0;
  const std::size_t found =
      k == 0 ? 0 : impl_->tree.knnSearch(p.data(), k, indices.data(), squared_distances.data());
  indices.resize(found);
  squared_distances.resize(found);
}

}  // namespace scanner::surface
