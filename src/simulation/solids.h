#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

/// Signed distances of simple solids (negative inside) and their combination, after the standard
/// forms collected in Hart, Sphere Tracing (The Visual Computer, 1996). Metres.
namespace scanner::simulation {

/// Box with rounded edges; `half` includes the rounding.
inline float boxDistance(const Eigen::Vector3f& p, const Eigen::Vector3f& half, float rounding) {
  const Eigen::Vector3f q = p.cwiseAbs() - half + Eigen::Vector3f::Constant(rounding);
  return q.cwiseMax(0.0F).norm() + std::min(q.maxCoeff(), 0.0F) - rounding;
}

/// Near its surface about the distance, elsewhere not steeper.
inline float ellipsoidDistance(const Eigen::Vector3f& p, const Eigen::Vector3f& radii) {
  const float k0 = p.cwiseQuotient(radii).norm();
  const float k1 = p.cwiseQuotient(radii.cwiseAbs2()).norm();
  return k1 > 0.0F ? k0 * (k0 - 1.0F) / k1 : -radii.minCoeff();
}

inline float capsuleDistance(const Eigen::Vector3f& p, const Eigen::Vector3f& a,
                             const Eigen::Vector3f& b, float radius) {
  const Eigen::Vector3f ab = b - a;
  const float t = std::clamp((p - a).dot(ab) / ab.squaredNorm(), 0.0F, 1.0F);
  return (p - a - t * ab).norm() - radius;
}

/// Round the z axis.
inline float torusDistance(const Eigen::Vector3f& p, float major, float minor) {
  return std::hypot(std::hypot(p.x(), p.y()) - major, p.z()) - minor;
}

/// Along the z axis, with rounded rims; `half_height` and `radius` include the rounding.
inline float cylinderDistance(const Eigen::Vector3f& p, float radius, float half_height,
                              float rounding) {
  const float dr = std::hypot(p.x(), p.y()) - radius + rounding;
  const float dz = std::abs(p.z()) - half_height + rounding;
  return std::hypot(std::max(dr, 0.0F), std::max(dz, 0.0F)) + std::min(std::max(dr, dz), 0.0F) -
         rounding;
}

/// Union with a fillet about as large as `radius`.
inline float smoothUnion(float a, float b, float radius) {
  const float h = std::max(radius - std::abs(a - b), 0.0F) / radius;
  return std::min(a, b) - 0.25F * h * h * radius;
}
inline float smoothIntersection(float a, float b, float radius) {
  return -smoothUnion(-a, -b, radius);
}
/// `a` without `b`.
inline float smoothDifference(float a, float b, float radius) {
  return smoothIntersection(a, -b, radius);
}

/// 0 below `from`, 1 above `to`, smooth between.
inline float smoothStep(float from, float to, float x) {
  const float t = std::clamp((x - from) / (to - from), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

}  // namespace scanner::simulation
