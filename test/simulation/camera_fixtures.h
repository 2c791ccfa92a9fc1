#pragma once

#include <functional>
#include <opencv2/calib3d.hpp>
#include <vector>

#include "scanner/core/camera.h"
#include "scanner/simulation/scene.h"

namespace scanner::test {

/// A square sheet of 2 `half` m that faces the camera at the origin (looking along z), `depth` m
/// away, turned by `slant` rad about the y axis.
inline simulation::Part makeSheet(float half, float depth, float slant, simulation::Shader shader) {
  simulation::Part part;
  part.name = "sheet";
  const Eigen::Matrix3f turn =
      Eigen::AngleAxisf(slant, Eigen::Vector3f::UnitY()).toRotationMatrix();
  for (const float y : {-half, half}) {
    for (const float x : {-half, half}) {
      part.vertices.push_back(turn * Eigen::Vector3f(x, y, 0.0F) + Eigen::Vector3f(0, 0, depth));
      part.normals.push_back(-turn.col(2));
    }
  }
  part.faces = {{0, 2, 1}, {1, 2, 3}};
  part.shader = std::move(shader);
  return part;
}

/// The sheet alone, lit from the camera.
inline simulation::Scene makeSheetScene(simulation::Part sheet) {
  simulation::Scene scene;
  scene.name = "sheet";
  for (const Eigen::Vector3f& vertex : sheet.vertices) scene.bounds.extend(vertex);
  scene.object.push_back(std::move(sheet));
  scene.light.to_sun = -Eigen::Vector3f::UnitZ();
  return scene;
}

inline cv::Matx33d toCv(const Eigen::Matrix3d& m) {
  return {m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0), m(2, 1), m(2, 2)};
}

/// Where OpenCV says that points in the optical frame appear in the raw picture.
inline std::vector<cv::Point2d> project(const CameraModel& camera,
                                        const std::vector<cv::Point3d>& points) {
  std::vector<cv::Point2d> pixels;
  cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), toCv(camera.K), camera.D, pixels);
  return pixels;
}

}  // namespace scanner::test
