#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "scanner/core/mesh.h"

namespace scanner::surface {

struct ViewPoint {
  Eigen::Isometry3d T_map_camera = Eigen::Isometry3d::Identity();  ///< optical: z forward, y down
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();                 ///< pixels
};

/// A camera that sees the whole mesh: it looks along `direction` (from the camera to the object,
/// map frame, any length but zero) at the centre of the bounding box, with `up` upwards in the
/// picture.
ViewPoint autoView(const Mesh& mesh, const Eigen::Vector3d& direction, int width, int height,
                   const Eigen::Vector3d& up = Eigen::Vector3d::UnitZ());

/// Pictures a mesh without any display: z-buffer, perspective-correct vertex colours, and a
/// headlight shading by the normal. Faces seen from behind are darker and bluish, so that a mesh
/// turned inside out shows. A mesh without faces is drawn as points. Returns CV_8UC3 (BGR) of
/// height x width filled with `background` elsewhere. Throws ConfigurationError for a size below 1.
cv::Mat renderMesh(const Mesh& mesh, const Eigen::Isometry3d& T_map_camera,
                   const Eigen::Matrix3d& K, int width, int height,
                   Rgb8 background = {255, 255, 255});

}  // namespace scanner::surface
