#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "scanner/core/camera.h"
#include "scanner/core/options.h"
#include "scanner/simulation/scene.h"

namespace scanner::simulation {

/// Block `simulation.render`.
struct RenderOptions {
  int samples = 4;            ///< per pixel, stratified; edges get more, see adaptive
  bool adaptive = true;       ///< more samples where depth, part or light differ within a pixel
  bool shadows = true;        ///< of the sun
  bool sky_occlusion = true;  ///< less sky light in hollows
  bool specular = true;
  int motion_samples = 4;  ///< poses over the exposure; 1: no motion blur
  double lens_blur_px =
      0.4;  ///< standard deviation, at 1024 pixels of width; scales with the width
};
void describe(OptionVisitor& v, RenderOptions& o);

/// Pictures a scene with Embree. Immutable after construction and thread-safe; the same bytes for
/// every thread count.
class Renderer {
 public:
  /// Keeps its own copy of what it needs of the scene but for the shaders' captures. Throws
  /// ConfigurationError for a part whose indices or sizes do not fit.
  Renderer(const Scene& scene, const RenderOptions& options, int threads);
  ~Renderer();
  Renderer(Renderer&&) noexcept;

  /// Linear radiance, CV_32FC3 in the order R G B, of the *raw* image (K and D of `camera`; R and P
  /// are not used). `T_map_camera`: poses of the raw optical frame at equal steps over the
  /// exposure, at least one; a static scene seen from each is averaged. White paper in full sun is
  /// about 1.
  cv::Mat radiance(const CameraModel& camera, const std::vector<Eigen::Isometry3d>& T_map_camera,
                   int seed) const;

  /// Exact depth through the centre of every pixel of the *rectified* image of `camera` (its R and
  /// P): CV_32FC1, z in the rectified optical frame, metres, NaN for sky. `object_only`: NaN also
  /// where surroundings are in front or behind.
  cv::Mat rectifiedDepth(const CameraModel& camera, const Eigen::Isometry3d& T_map_camera,
                         bool object_only) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace scanner::simulation
