#include "simulation/hand_path.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace scanner::simulation {

Eigen::Matrix3d cameraOrientation(double heading, double tilt, double roll) {
  // Optical axes of a level camera that looks along x of the map.
  Eigen::Matrix3d level;
  level << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ()).toRotationMatrix() * level *
         Eigen::AngleAxisd(-tilt, Eigen::Vector3d::UnitX()).toRotationMatrix() *
         Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

evaluation::MotionSummary stepStatistics(const std::vector<CameraKnot>& knots,
                                         const Eigen::Isometry3d& T_base_camera) {
  const Eigen::Isometry3d T_camera_base = T_base_camera.inverse(Eigen::Isometry);
  Trajectory trajectory;
  for (const CameraKnot& knot : knots) {
    Eigen::Isometry3d T_map_camera = Eigen::Isometry3d::Identity();
    T_map_camera.linear() = cameraOrientation(knot.heading, knot.tilt, knot.roll);
    T_map_camera.translation() = knot.position;
    trajectory.push_back({Time(), T_map_camera * T_camera_base});
  }
  return evaluation::summarize(evaluation::motionsBetweenNeighbours(trajectory));
}

void standardize(std::vector<double>& values) {
  if (values.empty()) return;
  const auto count = static_cast<double>(values.size());
  double mean = 0.0;
  for (const double value : values) mean += value / count;
  double square = 0.0;
  for (const double value : values) square += (value - mean) * (value - mean) / count;
  const double scale = square > 1e-12 ? 1.0 / std::sqrt(square) : 0.0;
  for (double& value : values) value = (value - mean) * scale;
}

std::vector<double> wander(int count, double correlation, double limit, Random& random) {
  std::vector<double> values;
  const double fresh = std::sqrt(1.0 - correlation * correlation);
  double value = random.normal();
  for (int i = 0; i < count; ++i) {
    values.push_back(std::clamp(value, -limit, limit));
    value = correlation * value + fresh * random.normal();
  }
  standardize(values);
  for (double& v : values) v = std::clamp(v, -limit, limit);
  return values;
}

std::vector<double> placesAlongPath(const std::vector<double>& unit, double spread) {
  constexpr double kShortest = 0.15;  // as the first step of table 5.2
  std::vector<double> places = {0.0};
  for (const double value : unit) {
    places.push_back(places.back() + std::max(kShortest, 1.0 + spread * value));
  }
  const double total = places.back();
  for (double& place : places) place = total > 0.0 ? place / total : 0.0;
  return places;
}

}  // namespace scanner::simulation
