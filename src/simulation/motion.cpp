#include "scanner/simulation/motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "scanner/core/status.h"
#include "simulation/hand_path.h"
#include "simulation/step_curve.h"
#include "simulation/tremor.h"

namespace scanner::simulation {
namespace {

constexpr double kRadians = 3.14159265358979323846 / 180.0;
constexpr double kStillAfter_s = 1.0;

/// An orientation made by turning about one axis after the other, with its derivatives.
struct Turning {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();          ///< in the turned frame, rad/s
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  ///< likewise, rad/s^2

  void turn(const Eigen::Matrix3d& fixed) {
    R = R * fixed;
    rate = fixed.transpose() * rate;
    acceleration = fixed.transpose() * acceleration;
  }

  /// About an axis of the frame reached so far, by an angle with its two derivatives.
  void turn(const Eigen::Vector3d& axis, const Eigen::Vector3d& angle) {
    turn(Eigen::AngleAxisd(angle[0], axis).toRotationMatrix());
    const Eigen::Vector3d own = axis * angle[1];
    acceleration += rate.cross(own) + axis * angle[2];
    rate += own;
  }
};

/// A camera carried through knots, with tremor; gives the state of base_link.
class HandHeldMotion : public Motion {
 public:
  HandHeldMotion(StepCurve curve, const Tremor& tremor, const Eigen::Isometry3d& T_base_camera,
                 double duration_s)
      : curve_(std::move(curve)),
        tremor_(tremor),
        T_base_camera_(T_base_camera),
        T_camera_base_(T_base_camera.inverse(Eigen::Isometry)),
        duration_s_(duration_s) {}

  double duration() const override { return duration_s_; }

  MotionState at(double time_s) const override {
    const Signals s = curve_.at(time_s) + tremor_.at(time_s);
    Turning turning;
    turning.turn(Eigen::Vector3d::UnitZ(), s.row(3));
    turning.turn(cameraOrientation(0.0, 0.0, 0.0));
    turning.turn(Eigen::Vector3d::UnitX(), -s.row(4));
    turning.turn(Eigen::Vector3d::UnitZ(), s.row(5));

    // base_link is at the end of a lever that starts at the camera.
    const Eigen::Vector3d lever = T_camera_base_.translation();
    const Eigen::Vector3d& rate = turning.rate;
    const Eigen::Vector3d along = rate.cross(lever);
    MotionState state;
    state.T_map_base.linear() = turning.R * T_camera_base_.linear();
    state.T_map_base.translation() = s.block<3, 1>(0, 0) + turning.R * lever;
    state.velocity = s.block<3, 1>(0, 1) + turning.R * along;
    state.acceleration =
        s.block<3, 1>(0, 2) + turning.R * (turning.acceleration.cross(lever) + rate.cross(along));
    state.angular_velocity = T_base_camera_.linear() * rate;
    state.angular_acceleration = T_base_camera_.linear() * turning.acceleration;
    return state;
  }

 private:
  StepCurve curve_;
  Tremor tremor_;
  Eigen::Isometry3d T_base_camera_;
  Eigen::Isometry3d T_camera_base_;
  double duration_s_;
};

void checkArguments(const MotionSubject& subject, const MotionOptions& options) {
  if (subject.bounds.isEmpty() || subject.bounds.sizes().minCoeff() <= 0.0) {
    throw ConfigurationError("makeMotion: the subject has no extent");
  }
  if (options.views < 1 || !(options.view_rate_hz > 0.0)) {
    throw ConfigurationError("makeMotion: views and view_rate_hz must be positive");
  }
}

std::vector<CameraKnot> makePath(const MotionSubject& subject, int steps, bool uneven,
                                 std::uint64_t seed) {
  if (subject.path == "orbit") return orbitPath({subject, steps, uneven, seed});
  if (subject.path == "passes") return passesPath({subject, steps, uneven, seed});
  throw ConfigurationError("makeMotion: path '" + subject.path + "' is neither orbit nor passes");
}

}  // namespace

double firstViewTime(const MotionOptions& options) { return options.still_s; }

std::shared_ptr<const Motion> makeMotion(const MotionSubject& subject, const MotionOptions& options,
                                         int seed) {
  checkArguments(subject, options);
  // One knot per picture. A higher rate takes more pictures on the way: the hand is no faster.
  const double knot_rate_hz = std::min(options.view_rate_hz, StepTargets().rate_hz);
  const double views_s = (options.views - 1) / options.view_rate_hz;
  constexpr double kRounding = 1e-9;
  const int steps = static_cast<int>(std::ceil(views_s * knot_rate_hz - kRounding));

  const auto stream = [&](std::uint64_t n) { return mixSeed(static_cast<std::uint64_t>(seed), n); };
  std::vector<StepCurve::Vector6> values;
  for (const CameraKnot& knot : makePath(subject, steps, options.pauses, stream(1))) {
    StepCurve::Vector6 value;
    value << knot.position, knot.heading, knot.tilt, knot.roll;
    values.push_back(value);
  }
  StepCurve curve(firstViewTime(options), 1.0 / knot_rate_hz, values);

  const double axis_m = options.tremor_m / std::sqrt(3.0);
  const double axis_rad = options.tremor_deg * kRadians / std::sqrt(3.0);
  const double rest_s = curve.restTime();
  const Tremor tremor({axis_m, axis_m, axis_m, axis_rad, axis_rad, axis_rad},
                      firstViewTime(options), rest_s, stream(2));
  return std::make_shared<HandHeldMotion>(std::move(curve), tremor, subject.T_base_camera,
                                          rest_s + kStillAfter_s);
}

}  // namespace scanner::simulation
