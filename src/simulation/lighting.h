#pragma once

#include <Eigen/Core>
#include <vector>

#include "scanner/simulation/renderer.h"
#include "simulation/embree_scene.h"

namespace scanner::simulation {

/// How much of the sky each place sees: computed once, because it varies slowly and would cost many
/// rays per pixel. The object and whatever has fine triangles is known per vertex; the level ground
/// near the object on a grid of its own, because its triangles are large.
class SkyVisibility {
 public:
  SkyVisibility(const EmbreeScene& scene, const Eigen::AlignedBox3f& object, int threads);
  /// Cosine-weighted share of the sky's hemisphere, 0..1, of a surface at the hit.
  float at(const SurfaceHit& hit, const SurfacePoint& point) const;

 private:
  float onGround(const Eigen::Vector3f& position) const;

  const EmbreeScene& scene_;
  std::vector<std::vector<float>> vertices_;  ///< per part; empty for parts with large triangles
  Eigen::Vector2f ground_origin_;
  int ground_cells_ = 0;
  std::vector<float> ground_;
};

/// Radiance of the sky in a unit direction, with thin clouds.
Eigen::Vector3f skyRadiance(const Daylight& light, const Eigen::Vector3f& direction);

/// Radiance that a surface sends towards the eye (`to_eye`, unit). `sun`: visible share of the sun,
/// `sky`: of the sky.
Eigen::Vector3f shade(const Daylight& light, const Appearance& look, const Eigen::Vector3f& to_eye,
                      float sun, float sky, bool specular);

}  // namespace scanner::simulation
