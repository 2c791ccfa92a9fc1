#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "scanner/core/time.h"

namespace scanner {

struct Rgb8 {
  std::uint8_t r = 0, g = 0, b = 0;
  bool operator==(const Rgb8& o) const { return r == o.r && g == o.g && b == o.b; }
};

/// Points with optional attributes, structure of arrays. An attribute vector is either empty or as
/// long as `points`. Frame and units: stated by whoever holds it; metres throughout.
struct PointCloud {
  std::vector<Eigen::Vector3f> points;
  std::vector<Eigen::Vector3f> normals;  ///< unit length, towards the camera; NaN where undefined
  std::vector<Rgb8> colors;
  std::vector<float> sigmas;  ///< standard deviation of the depth, metres

  std::size_t size() const { return points.size(); }
  bool empty() const { return points.empty(); }
  bool hasNormals() const { return !points.empty() && normals.size() == points.size(); }
  bool hasColors() const { return !points.empty() && colors.size() == points.size(); }
  bool hasSigmas() const { return !points.empty() && sigmas.size() == points.size(); }
  void reserve(std::size_t n);
  /// Appends point i of `other`. Both must carry the same attributes (or this one be empty).
  void appendFrom(const PointCloud& other, std::size_t i);
  void append(const PointCloud& other);
};

/// Row-major cloud of one rectified left image: point (row, col) is at row * width + col; NaN where
/// there is no depth. Frame: rectified left optical (x right, y down, z forward).
struct OrganizedCloud {
  Time stamp;
  int width = 0;
  int height = 0;
  PointCloud cloud;
};

/// One conditioned view, ready for registration: finite points with finite normals only, in
/// base_link at `stamp`. Points keep the row-major order of the image they came from.
struct View {
  int index = -1;  ///< number of the stereo frame in the recording, from 0
  Time stamp;
  PointCloud cloud;
};

/// Rigidly moved copy; normals rotate, the rest is kept.
PointCloud transformed(const PointCloud& cloud, const Eigen::Isometry3d& T);
/// Points whose position is finite and, when `need_normals`, whose normal is finite.
PointCloud finitePoints(const PointCloud& cloud, bool need_normals);
/// Copy of the points at `indices`, in that order.
PointCloud subset(const PointCloud& cloud, const std::vector<std::size_t>& indices);
/// Every `factor`-th point, from the first on. factor >= 1.
PointCloud decimated(const PointCloud& cloud, int factor);
/// Per-axis median of the finite points. NaN for an empty cloud.
Eigen::Vector3d medianPoint(const PointCloud& cloud);
bool allFinite(const PointCloud& cloud);

}  // namespace scanner
