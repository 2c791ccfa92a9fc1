#include "scanner/core/cloud.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace scanner {
namespace {

float medianOf(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  const float upper = *middle;
  const float lower = *std::max_element(values.begin(), middle);
  return 0.5F * (lower + upper);
}

}  // namespace

void PointCloud::reserve(std::size_t n) {
  points.reserve(n);
  normals.reserve(n);
  colors.reserve(n);
  sigmas.reserve(n);
}

void PointCloud::appendFrom(const PointCloud& other, std::size_t i) {
  // Asked before the first push_back: `other` may be this cloud.
  const bool with_normals = other.hasNormals();
  const bool with_colors = other.hasColors();
  const bool with_sigmas = other.hasSigmas();
  points.push_back(other.points[i]);
  if (with_normals) normals.push_back(other.normals[i]);
  if (with_colors) colors.push_back(other.colors[i]);
  if (with_sigmas) sigmas.push_back(other.sigmas[i]);
}

void PointCloud::append(const PointCloud& other) {
  if (other.empty()) return;
  if (!empty() && (hasNormals() != other.hasNormals() || hasColors() != other.hasColors() ||
                   hasSigmas() != other.hasSigmas())) {
    throw std::invalid_argument("PointCloud::append: the clouds carry different attributes");
  }
  points.insert(points.end(), other.points.begin(), other.points.end());
  normals.insert(normals.end(), other.normals.begin(), other.normals.end());
  colors.insert(colors.end(), other.colors.begin(), other.colors.end());
  sigmas.insert(sigmas.end(), other.sigmas.begin(), other.sigmas.end());
}

PointCloud transformed(const PointCloud& cloud, const Eigen::Isometry3d& T) {
  PointCloud out = cloud;
  // In double: map coordinates of a building exceed what a float product keeps to a micrometre.
  for (Eigen::Vector3f& p : out.points) p = (T * p.cast<double>()).cast<float>();
  const Eigen::Matrix3d R = T.linear();
  for (Eigen::Vector3f& n : out.normals) n = (R * n.cast<double>()).cast<float>();
  return out;
}

PointCloud finitePoints(const PointCloud& cloud, bool need_normals) {
  if (need_normals && !cloud.empty() && !cloud.hasNormals()) {
    throw std::invalid_argument("finitePoints: the cloud has no normals");
  }
  std::vector<std::size_t> kept;
  kept.reserve(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!cloud.points[i].allFinite()) continue;
    if (need_normals && !cloud.normals[i].allFinite()) continue;
    kept.push_back(i);
  }
  return subset(cloud, kept);
}

PointCloud subset(const PointCloud& cloud, const std::vector<std::size_t>& indices) {
  PointCloud out;
  out.reserve(indices.size());
  for (const std::size_t i : indices) out.appendFrom(cloud, i);
  return out;
}

PointCloud decimated(const PointCloud& cloud, int factor) {
  if (factor < 1) throw std::invalid_argument("decimated: factor must be at least 1");
  PointCloud out;
  const auto step = static_cast<std::size_t>(factor);
  out.reserve(cloud.size() / step + 1);
  for (std::size_t i = 0; i < cloud.size(); i += step) out.appendFrom(cloud, i);
  return out;
}

Eigen::Vector3d medianPoint(const PointCloud& cloud) {
  Eigen::Vector3d median = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  std::vector<float> values;
  values.reserve(cloud.size());
  for (int axis = 0; axis < 3; ++axis) {
    values.clear();
    for (const Eigen::Vector3f& p : cloud.points) {
      if (p.allFinite()) values.push_back(p[axis]);
    }
    if (values.empty()) return median;
    median[axis] = static_cast<double>(medianOf(values));
  }
  return median;
}

bool allFinite(const PointCloud& cloud) {
  const auto finite = [](const Eigen::Vector3f& v) { return v.allFinite(); };
  return std::all_of(cloud.points.begin(), cloud.points.end(), finite) &&
         std::all_of(cloud.normals.begin(), cloud.normals.end(), finite) &&
         std::all_of(cloud.sigmas.begin(), cloud.sigmas.end(),
                     [](float s) { return std::isfinite(s); });
}

}  // namespace scanner
