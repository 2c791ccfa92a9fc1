#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "scanner/simulation/scene.h"

namespace scanner::simulation {

/// Where a ray met the scene.
struct SurfaceHit {
  std::uint32_t part = 0;
  std::uint32_t face = 0;
  float u = 0.0F, v = 0.0F;  ///< barycentric weights of the face's second and third corner
};

/// The triangles of a scene in Embree. Queries are const and thread-safe.
class EmbreeScene {
 public:
  /// Throws ConfigurationError for a part whose indices or sizes do not fit, naming it.
  explicit EmbreeScene(const Scene& scene);
  ~EmbreeScene();
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;

  /// A stream of `count` rays with about a common origin or direction, `stride` bytes from one to
  /// the next; much faster together than one by one.
  void intersect(RTCRayHit* rays, std::size_t count, std::size_t stride = sizeof(RTCRayHit)) const;
  /// tfar of a ray becomes negative when something is in its way.
  void occluded(std::vector<RTCRay>& rays) const;

  const std::vector<Part>& parts() const { return parts_; }
  std::size_t objectParts() const { return object_parts_; }
  SurfaceHit hitOf(const RTCRayHit& ray) const;
  Eigen::Vector3f geometricNormal(const SurfaceHit& hit) const;
  /// Position, interpolated normal and texture coordinates; the footprint is left 0.
  SurfacePoint pointAt(const SurfaceHit& hit) const;
  /// Anything per vertex, interpolated.
  float interpolate(const SurfaceHit& hit, const std::vector<float>& per_vertex) const;

 private:
  std::vector<Part> parts_;  ///< the object's first
  std::size_t object_parts_ = 0;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
};

/// A ray for either query. `direction` must be of unit length.
RTCRay makeRay(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction);
RTCRayHit makeRayHit(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction);

}  // namespace scanner::simulation
