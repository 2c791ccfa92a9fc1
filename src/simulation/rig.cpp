#include "scanner/simulation/rig.h"

#include "scanner/core/se3.h"
#include "scanner/simulation/random.h"

namespace scanner::simulation {
namespace {

constexpr double kRadians = 3.14159265358979323846 / 180.0;
constexpr double kReferenceWidth_px = 1024.0;

CameraModel makeCamera(const RigOptions& options, Random& random) {
  const double scale = options.width_px / kReferenceWidth_px;
  CameraModel camera;
  camera.width = options.width_px;
  camera.height = options.height_px;
  // Pixels are counted from their centres: the middle of the picture lies at (width - 1) / 2.
  Eigen::Vector2d centre(0.5 * (options.width_px - 1), 0.5 * (options.height_px - 1));
  double focal = options.focal_px * scale;
  if (options.misalignment) {
    centre += 4.0 * scale * Eigen::Vector2d(random.normal(), random.normal());
    focal *= 1.0 + 0.002 * random.normal();
  }
  camera.K << focal, 0.0, centre.x(), 0.0, focal, centre.y(), 0.0, 0.0, 1.0;
  camera.D.assign(5, 0.0);
  if (options.distortion) {
    camera.D = {-0.075 + 0.005 * random.normal(), 0.04 + 0.003 * random.normal(),
                3e-4 * random.normal(), 3e-4 * random.normal(), 0.0};
  }
  return camera;
}

/// Thesis eq. 5.1, the rotation from the camera to the inertial sensor.
Eigen::Matrix3d publishedRotation() {
  Eigen::Matrix3d R;
  R << -0.0407, -0.0330, 0.9986, -0.0120, 0.9994, 0.0326, -0.9991, -0.0107, -0.0411;
  return nearestRotation(R);
}

}  // namespace

Rig SimulatedRig::rig() const {
  Rig rig;
  rig.T_base_camera = T_base_camera;
  rig.cameras = calibration;
  return rig;
}

SimulatedRig makeRig(const RigOptions& options, int seed) {
  Random random(static_cast<std::uint64_t>(seed));
  SimulatedRig rig;
  CameraModel& left = rig.calibration.left;
  CameraModel& right = rig.calibration.right;
  left = makeCamera(options, random);
  right = makeCamera(options, random);

  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  if (options.misalignment) {
    turn = 0.1 * kRadians * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
  }
  // The right eye lies on the left one's x axis, so that only the right picture has to be turned.
  rig.T_left_right = makePose({options.baseline_m, 0.0, 0.0}, expSo3(turn));
  right.R = rig.T_left_right.linear();

  const double focal = options.focal_px * options.width_px / kReferenceWidth_px;
  const Eigen::Vector2d centre = 0.5 * (left.K.block<2, 1>(0, 2) + right.K.block<2, 1>(0, 2));
  left.P << focal, 0.0, centre.x(), 0.0, 0.0, focal, centre.y(), 0.0, 0.0, 0.0, 1.0, 0.0;
  right.P = left.P;
  right.P(0, 3) = -focal * options.baseline_m;

  // The published rotation is camera to sensor, with the camera's x axis where ours has it.
  const Eigen::Vector3d lever(0.05, 0.06, -0.06);
  rig.T_base_camera = makePose(lever, Eigen::Quaterniond(publishedRotation()));
  return rig;
}

}  // namespace scanner::simulation
