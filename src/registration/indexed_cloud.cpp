#include "scanner/registration/indexed_cloud.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>

namespace scanner::registration {
namespace {

// nanoflann's view of the points.
struct PointsAdaptor {
  const std::vector<Eigen::Vector3f>& points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using KdTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointsAdaptor, float>,
                                        PointsAdaptor, 3, std::uint32_t>;

// Result set that only takes compatible points: the search goes on past incompatible ones, and is
// pruned by the nearest compatible one.
class NearestCompatible {
 public:
  NearestCompatible(const std::vector<Eigen::Vector3f>& normals, const Eigen::Vector3f& normal,
                    float min_cos, bool either_sign, float squared_bound)
      : normals_(normals),
        normal_(normal),
        min_cos_(min_cos),
        either_sign_(either_sign),
        best_(squared_bound) {}

  bool addPoint(float squared_distance, std::uint32_t index) {
    if (squared_distance >= best_) return true;
    const float cosine = normals_[index].dot(normal_);
    if ((either_sign_ ? std::abs(cosine) : cosine) < min_cos_) return true;
    best_ = squared_distance;
    index_ = index;
    found_ = true;
    return true;
  }
  float worstDist() const { return best_; }
  bool full() const { return found_; }
  std::size_t size() const { return found_ ? 1 : 0; }
  std::uint32_t index() const { return index_; }

 private:
  const std::vector<Eigen::Vector3f>& normals_;
  const Eigen::Vector3f& normal_;
  float min_cos_;
  bool either_sign_;
  float best_;
  std::uint32_t index_ = 0;
  bool found_ = false;
};

double meanSpacing(const PointCloud& cloud, const KdTree& tree) {
  if (cloud.size() < 2) return 0.0;
  // 500 samples give the mean to a few per cent; it only sets thresholds.
  const std::size_t step = std::max<std::size_t>(1, cloud.size() / 500);
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < cloud.size(); i += step, ++count) {
    std::uint32_t index[2];
    float squared[2] = {0.0F, 0.0F};
    tree.knnSearch(cloud.points[i].data(), 2, index, squared);
    sum += std::sqrt(static_cast<double>(squared[1]));
  }
  return sum / static_cast<double>(count);
}

}  // namespace

struct IndexedCloud::Tree {
  explicit Tree(const PointCloud& cloud)
      : adaptor{cloud.points}, index(3, adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(10)) {
    index.buildIndex();
  }
  PointsAdaptor adaptor;
  KdTree index;
};

IndexedCloud::IndexedCloud(PointCloud samples) : cloud_(std::move(samples)) {
  if (cloud_.empty()) return;
  tree_ = std::make_unique<Tree>(cloud_);
  spacing_ = meanSpacing(cloud_, tree_->index);
  median_ = medianPoint(cloud_);
}

IndexedCloud::~IndexedCloud() = default;

IndexedCloud::Match IndexedCloud::nearestCompatible(const Eigen::Vector3f& point,
                                                    const Eigen::Vector3f& normal, float min_cos,
                                                    bool either_sign, float squared_bound) const {
  if (!tree_) return {};
  NearestCompatible result(cloud_.normals, normal, min_cos, either_sign, squared_bound);
  tree_->index.findNeighbors(result, point.data(), nanoflann::SearchParams());
  return {result.full(), result.index(), result.worstDist()};
}

std::vector<std::size_t> IndexedCloud::nearest(const Eigen::Vector3f& point, std::size_t k) const {
  if (!tree_) return {};
  std::vector<std::uint32_t> index(k);
  std::vector<float> squared(k);
  const std::size_t found = tree_->index.knnSearch(point.data(), k, index.data(), squared.data());
  return {index.begin(), index.begin() + static_cast<std::ptrdiff_t>(found)};
}

Eigen::Vector3d medianOf(const Reference& reference) {
  PointCloud all;
  for (const PosedIndex& member : reference) {
    const Eigen::Isometry3f T = member.T_ref_cloud.cast<float>();
    for (const Eigen::Vector3f& p : member.cloud->cloud().points) all.points.push_back(T * p);
  }
  return medianPoint(all);
}

double spacingOf(const Reference& reference) {
  double sum = 0.0;
  for (const PosedIndex& member : reference) sum += member.cloud->spacing();
  return reference.empty() ? 0.0 : sum / static_cast<double>(reference.size());
}

}  // namespace scanner::registration
