#include <algorithm>
#include <cmath>
#include <cstddef>

#include "simulation/hand_path.h"
#include "simulation/step_curve.h"

namespace scanner::simulation {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kRadians = kPi / 180.0;

constexpr double kPasses = 3.0;
constexpr double kAside = 38.0 * kRadians;  ///< azimuth between the passes
constexpr double kStandoff_m = 0.6;
constexpr double kLowest_m = 0.27;  ///< of the camera above the ground
constexpr double kTurn = 0.34;      ///< half the duration of a turn, of a pass

/// Three passes on a cylinder round the pole.
struct PassesShape {
  Eigen::Vector3d foot;  ///< of the axis
  double radius_m;       ///< of the camera's cylinder
  double middle_m;       ///< mean height of the camera above the foot
  double swing_m;        ///< and how far up and down from there
};

struct PassesPoint {
  double azimuth;
  double height;
};

/// `progress` 0..3, one per pass.
PassesPoint passesPoint(const PassesShape& shape, double progress) {
  const double turned =
      smoothStep((progress - 1.0) / kTurn).value + smoothStep((progress - 2.0) / kTurn).value - 1.0;
  return {-0.5 * kPi + kAside * turned, shape.middle_m - shape.swing_m * std::cos(kPi * progress)};
}

Eigen::Vector3d onCylinder(const PassesShape& shape, const PassesPoint& point, double radius_m) {
  return shape.foot + Eigen::Vector3d(radius_m * std::cos(point.azimuth),
                                      radius_m * std::sin(point.azimuth), point.height);
}

std::vector<double> lengthsAlong(const PassesShape& shape, int samples) {
  std::vector<double> lengths = {0.0};
  Eigen::Vector3d last = onCylinder(shape, passesPoint(shape, 0.0), shape.radius_m);
  for (int i = 1; i <= samples; ++i) {
    const PassesPoint point = passesPoint(shape, kPasses * i / samples);
    const Eigen::Vector3d next = onCylinder(shape, point, shape.radius_m);
    lengths.push_back(lengths.back() + (next - last).norm());
    last = next;
  }
  return lengths;
}

/// The swing for which 49 steps have the published length, if the subject is tall enough.
PassesShape shapeOf(const Eigen::AlignedBox3d& bounds, int samples) {
  const StepTargets target;
  const Eigen::Vector3d half = 0.5 * bounds.sizes();
  PassesShape shape;
  shape.foot << bounds.center().head<2>(), bounds.min().z();
  shape.radius_m = std::max(half.x(), half.y()) + kStandoff_m;
  double low = 0.05;
  double high = std::max(low, half.z() - 0.2);
  for (int i = 0; i < 50; ++i) {
    shape.swing_m = 0.5 * (low + high);
    const bool too_long = lengthsAlong(shape, samples).back() > target.steps * target.rho_m;
    (too_long ? high : low) = shape.swing_m;
  }
  shape.middle_m = std::max(half.z(), shape.swing_m + kLowest_m);
  return shape;
}

}  // namespace

std::vector<CameraKnot> passesPath(const PathRequest& request) {
  constexpr int kSamples = 1500;
  constexpr double kYaw = 1.0 * kRadians;
  constexpr double kTilt = 1.0 * kRadians;
  constexpr double kRoll = 0.75 * kRadians;
  constexpr double kRadial_m = 0.012;
  constexpr double kDown = 5.0 * kRadians;  // held above the chest, looking slightly down

  const StepTargets target;
  const PassesShape shape = shapeOf(request.subject.bounds, kSamples);
  const std::vector<double> lengths = lengthsAlong(shape, kSamples);
  const double share = std::min(1.0, static_cast<double>(request.steps) / target.steps);

  Random random(request.seed);
  const int knots = request.steps + 1;
  std::vector<double> steps = wander(request.steps, -0.3, 2.0, random);
  if (!steps.empty()) steps[0] = -2.0;
  const std::vector<double> yaw = wander(knots, 0.4, 2.2, random);
  const std::vector<double> tilt = wander(knots, 0.4, 2.2, random);
  const std::vector<double> roll = wander(knots, 0.4, 2.2, random);
  const std::vector<double> radial = wander(knots, 0.7, 2.2, random);
  // The turns slow the hand down enough; the rest is the unevenness of the published steps.
  const double spread = request.uneven ? 0.25 : 0.0;
  const double wobble = request.uneven ? 1.0 : 0.3;

  std::vector<CameraKnot> path;
  for (const double place : placesAlongPath(steps, spread)) {
    const std::size_t i = path.size();
    const double wanted = place * share * lengths.back();
    const auto above = std::upper_bound(lengths.begin() + 1, lengths.end() - 1, wanted);
    const double before = *(above - 1);
    const double index =
        static_cast<double>(above - lengths.begin()) - 1.0 + (wanted - before) / (*above - before);
    const PassesPoint point = passesPoint(shape, kPasses * index / kSamples);
    CameraKnot knot;
    knot.position = onCylinder(shape, point, shape.radius_m + kRadial_m * radial[i]);
    knot.heading = point.azimuth + kPi + wobble * kYaw * yaw[i];
    knot.tilt = kDown + wobble * kTilt * tilt[i];
    knot.roll = wobble * kRoll * roll[i];
    path.push_back(knot);
  }
  return path;
}

}  // namespace scanner::simulation
