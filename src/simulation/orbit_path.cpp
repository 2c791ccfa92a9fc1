#include <algorithm>
#include <cmath>
#include <cstddef>

#include "simulation/hand_path.h"

namespace scanner::simulation {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kRadians = kPi / 180.0;

/// The camera goes at a distance round an ellipse, high and low by turns.
struct OrbitShape {
  Eigen::Vector2d centre;
  double half_x;
  double half_y;
  double gaze_m;       ///< mean height looked at
  double gaze_wave_m;  ///< and how far up and down from there
  double rise_m;       ///< mean height of the camera above that
  double camera_wave_m;
};

/// What is solved for so that the steps have the published statistics.
struct OrbitKnobs {
  double standoff_m = 0.48;     ///< from the ellipse
  double laps = 1.0;            ///< that 49 steps make; the loop closes, or overlaps a little
  double spread = 0.31;         ///< relative deviation of the steps' lengths
  double yaw = 2.5 * kRadians;  ///< wobble of the gaze, standard deviations
  double tilt = 1.2 * kRadians;
};

/// Randomness of the hand, drawn once: standardized numbers per step or per knot.
struct OrbitHand {
  double first_azimuth = 0.0;
  std::vector<double> steps, yaw, tilt, roll, radial, height;
};

constexpr double kWavesPerLap = 4.0;  ///< high and low are both seen within 45 deg of every side
constexpr double kRoll = 0.75 * kRadians;
constexpr double kRadial_m = 0.008;
constexpr double kHeight_m = 0.006;

OrbitShape shapeOf(const Eigen::AlignedBox3d& bounds) {
  // Half of the height that a picture shows at the usual distance, seen from above.
  constexpr double kSeen_m = 0.18;
  const Eigen::Vector3d centre = bounds.center();
  const Eigen::Vector3d half = 0.5 * bounds.sizes();
  OrbitShape shape;
  shape.centre = centre.head<2>();
  shape.half_x = half.x();
  shape.half_y = half.y();
  shape.gaze_m = centre.z() + 0.05 * half.z();  // the foot comes into the picture by the tilt
  shape.gaze_wave_m = std::max(0.01, half.z() - kSeen_m);
  shape.rise_m = 0.27;
  // Tilting saves walking, but what is high must not be looked at steeply from below.
  shape.camera_wave_m = shape.gaze_wave_m - std::min(0.5 * shape.gaze_wave_m, 0.08);
  return shape;
}

struct OrbitPoint {
  Eigen::Vector3d position;
  double depth_m;  ///< to what is looked at, level
  double gaze_m;   ///< height of that
};

OrbitPoint orbitPoint(const OrbitShape& shape, double standoff_m, double azimuth, double phase) {
  const Eigen::Vector2d normal(std::cos(azimuth), std::sin(azimuth));
  const Eigen::Vector2d scaled(shape.half_x * normal.x(), shape.half_y * normal.y());
  const double reach = scaled.norm();  // of the ellipse along the normal
  const Eigen::Vector2d surface(shape.half_x * scaled.x() / reach,
                                shape.half_y * scaled.y() / reach);
  const Eigen::Vector2d place = shape.centre + surface + standoff_m * normal;
  const double wave = std::sin(kWavesPerLap * phase);
  OrbitPoint point;
  point.gaze_m = shape.gaze_m + shape.gaze_wave_m * wave;
  point.position << place, shape.gaze_m + shape.rise_m + shape.camera_wave_m * wave;
  point.depth_m = standoff_m + 0.5 * reach;
  return point;
}

/// Azimuths, from 0, at which the path has gone the given shares of its length.
std::vector<double> azimuthsAt(const std::vector<double>& places, const OrbitShape& shape,
                               double standoff_m, double first_azimuth, double laps) {
  const int samples = std::max(1, static_cast<int>(std::ceil(laps * 1440.0)));
  const double spacing = laps * 2.0 * kPi / samples;
  std::vector<double> lengths = {0.0};
  Eigen::Vector3d last = orbitPoint(shape, standoff_m, first_azimuth, 0.0).position;
  for (int i = 1; i <= samples; ++i) {
    const double phase = i * spacing;
    const Eigen::Vector3d next =
        orbitPoint(shape, standoff_m, first_azimuth + phase, phase).position;
    lengths.push_back(lengths.back() + (next - last).norm());
    last = next;
  }
  std::vector<double> azimuths;
  for (const double place : places) {
    const double wanted = place * lengths.back();
    const auto above = std::upper_bound(lengths.begin() + 1, lengths.end() - 1, wanted);
    const double before = *(above - 1);
    const double share = (wanted - before) / (*above - before);
    azimuths.push_back((static_cast<double>(above - lengths.begin()) - 1.0 + share) * spacing);
  }
  return azimuths;
}

std::vector<CameraKnot> orbitKnots(const OrbitShape& shape, const OrbitKnobs& knobs,
                                   const OrbitHand& hand, double share) {
  const std::vector<double> azimuths =
      azimuthsAt(placesAlongPath(hand.steps, knobs.spread), shape, knobs.standoff_m,
                 hand.first_azimuth, knobs.laps * share);
  std::vector<CameraKnot> knots;
  for (std::size_t i = 0; i < azimuths.size(); ++i) {
    const double azimuth = hand.first_azimuth + azimuths[i];
    const OrbitPoint point =
        orbitPoint(shape, knobs.standoff_m + kRadial_m * hand.radial[i], azimuth, azimuths[i]);
    CameraKnot knot;
    knot.position = point.position + kHeight_m * hand.height[i] * Eigen::Vector3d::UnitZ();
    knot.heading = azimuth + kPi + knobs.yaw * hand.yaw[i];
    knot.tilt =
        std::atan2(point.position.z() - point.gaze_m, point.depth_m) + knobs.tilt * hand.tilt[i];
    knot.roll = kRoll * hand.roll[i];
    knots.push_back(knot);
  }
  return knots;
}

OrbitHand drawHand(const PathRequest& request) {
  Random random(request.seed);
  const int knots = request.steps + 1;
  OrbitHand hand;
  hand.first_azimuth = random.uniform(-kPi, kPi);
  // Long and short steps take turns, as they do in the table.
  hand.steps = wander(request.steps, -0.5, 2.0, random);
  if (!hand.steps.empty()) hand.steps[0] = -2.0;  // and the first one is short
  // The gaze runs ahead in a long step and falls back in a short one.
  double lead = 0.0;
  hand.yaw.push_back(0.0);
  for (const double step : hand.steps) {
    lead = 0.5 * lead + 0.8 * step + 0.6 * random.normal();
    hand.yaw.push_back(std::clamp(lead, -2.2, 2.2));
  }
  if (knots > 1) hand.yaw[0] = hand.yaw[1];
  standardize(hand.yaw);
  hand.tilt = wander(knots, 0.0, 2.2, random);
  hand.roll = wander(knots, 0.0, 2.2, random);
  hand.radial = wander(knots, 0.7, 2.2, random);
  hand.height = wander(knots, 0.7, 2.2, random);
  return hand;
}

}  // namespace

std::vector<CameraKnot> orbitPath(const PathRequest& request) {
  const StepTargets target;
  const Eigen::AlignedBox3d& bounds = request.subject.bounds;
  const OrbitShape shape = shapeOf(bounds);
  const OrbitHand hand = drawHand(request);
  const double share = static_cast<double>(request.steps) / target.steps;

  constexpr double kNearest_m = 0.47;
  constexpr double kMaxLaps = 1.11;  // the 398 deg of the table's pitches
  // A small object is not left small in the picture for the sake of long steps.
  const double smallest = 2.0 * std::min({shape.half_x, shape.half_y, 0.5 * bounds.sizes().z()});
  const double farthest_m = std::clamp(1.4 * smallest, kNearest_m, 0.8);
  OrbitKnobs knobs;
  if (!request.uneven) {
    knobs.spread = 0.0;
    knobs.yaw = 0.5 * kRadians;
    knobs.tilt = 0.3 * kRadians;
  }
  std::vector<CameraKnot> knots = orbitKnots(shape, knobs, hand, share);
  constexpr int kMinSteps = 5;  // fewer have no statistics worth the name
  constexpr int kIterations = 40;
  for (int i = 0; i < kIterations && request.steps >= kMinSteps; ++i) {
    const evaluation::MotionSummary is = stepStatistics(knots, request.subject.T_base_camera);
    // The loop grows by 2 pi times the standoff; what that cannot give, its overlap must.
    const double missing_m = (target.rho_m - is.rho_m.mean) * target.steps / (2.0 * kPi);
    const double wanted_m = knobs.standoff_m + 0.8 * missing_m;
    knobs.standoff_m = std::clamp(wanted_m, kNearest_m, farthest_m);
    const bool too_short = wanted_m > farthest_m || knobs.laps > 1.0;
    if (too_short)
      knobs.laps = std::clamp(knobs.laps * target.rho_m / is.rho_m.mean, 1.0, kMaxLaps);
    if (request.uneven) {
      const double arc_missing = (target.arc_deg - is.arc_deg.mean) * kRadians;
      knobs.spread = std::clamp(knobs.spread * target.rho_sigma_m / is.rho_m.sigma, 0.05, 0.5);
      knobs.yaw = std::clamp(knobs.yaw * target.arc_sigma_deg / is.arc_deg.sigma, 0.5 * kRadians,
                             4.0 * kRadians);
      knobs.tilt = std::clamp(knobs.tilt + 0.4 * arc_missing, 0.2 * kRadians, 3.5 * kRadians);
    }
    knots = orbitKnots(shape, knobs, hand, share);
  }
  return knots;
}

}  // namespace scanner::simulation
