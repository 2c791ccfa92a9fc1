#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include "scanner/core/cloud.h"
#include "scanner/core/se3.h"
#include "scanner/registration/options.h"

/// Synthetic views with known poses: a bumpy body, given as an implicit surface and ray-cast.
namespace scanner::registration::synthetic {

constexpr double kPi = 3.14159265358979323846;
constexpr double kDegree = kPi / 180.0;

/// Reproducible on every platform, unlike the standard library's distributions.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double uniform() { return static_cast<double>(engine_() >> 11U) * 0x1.0p-53; }
  double gaussian() {
    const double u = std::max(1e-12, uniform());
    return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * kPi * uniform());
  }
  Eigen::Vector3d direction() {
    Eigen::Vector3d v(gaussian(), gaussian(), gaussian());
    return v.normalized();
  }
  Eigen::Isometry3d motion(double angle_rad, double distance_m) {
    const Eigen::Vector3d axis = direction();
    return makePose(distance_m * direction(), expSo3(Eigen::Vector3d(angle_rad * axis)));
  }

 private:
  std::mt19937_64 engine_;
};

/// Signed distance-like function of a body of about 0.2 m radius, without any symmetry.
inline double body(const Eigen::Vector3d& p) {
  const double r = p.norm();
  if (r < 1e-9) return -0.2;
  const Eigen::Vector3d d = p / r;
  double radius = 0.2 + 0.03 * std::sin(3.0 * d.x() + 1.0) + 0.025 * std::cos(4.0 * d.y() - d.z());
  radius +=
      0.012 * std::sin(9.0 * d.x() + 5.0 * d.z()) + 0.01 * std::sin(11.0 * d.y() - 3.0 * d.x());
  radius += 0.008 * std::cos(13.0 * d.z() + 2.0 * d.y());
  return r - radius;
}

inline Eigen::Vector3d bodyNormal(const Eigen::Vector3d& p) {
  const double h = 1e-5;
  Eigen::Vector3d g;
  for (int a = 0; a < 3; ++a) {
    Eigen::Vector3d e = Eigen::Vector3d::Zero();
    e[a] = h;
    g[a] = body(p + e) - body(p - e);
  }
  return g.normalized();
}

/// Sensor (x right, y down, z forward) at `position` looking at `target`, map z up.
inline Eigen::Isometry3d lookAt(const Eigen::Vector3d& position, const Eigen::Vector3d& target) {
  const Eigen::Vector3d z = (target - position).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() << x, z.cross(x), z;
  T.translation() = position;
  return T;
}

/// Ray-cast view of width x height pixels, `noise_m` along the ray, exact normals.
inline std::shared_ptr<const View> castView(int index, const Eigen::Isometry3d& T_map_base,
                                            int width, int height, double noise_m,
                                            std::uint64_t seed) {
  Random random(seed);
  auto view = std::make_shared<View>();
  view->index = index;
  view->stamp = Time(fromSeconds(0.5 * index));
  const double f = 1.2 * width;
  const Eigen::Isometry3d T_base_map = T_map_base.inverse();
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const Eigen::Vector3d ray =
          Eigen::Vector3d((u - 0.5 * width) / f, (v - 0.5 * height) / f, 1.0).normalized();
      const Eigen::Vector3d direction = T_map_base.linear() * ray;
      double t = 0.3;
      double value = 1.0;
      for (int i = 0; i < 100 && t < 1.4 && std::abs(value) > 1e-7; ++i) {
        value = body(T_map_base.translation() + t * direction);
        t += 0.6 * value;
      }
      if (std::abs(value) > 1e-5) continue;
      const Eigen::Vector3d p = T_map_base.translation() + t * direction;
      const Eigen::Vector3d n = bodyNormal(p);
      if (-n.dot(direction) < 0.25) continue;  // grazing: stereo would not match it
      const Eigen::Vector3d noisy = p + noise_m * random.gaussian() * direction;
      view->cloud.points.push_back((T_base_map * noisy).cast<float>());
      view->cloud.normals.push_back((T_base_map.linear() * n).cast<float>().normalized());
      view->cloud.sigmas.push_back(static_cast<float>(noise_m));
    }
  }
  return view;
}

struct Orbit {
  std::vector<Eigen::Isometry3d> truth;
  std::vector<Eigen::Isometry3d> priors;  ///< T_prev_cur
  std::vector<std::shared_ptr<const View>> views;
};

/// Closed orbit of `count` views, 0.75 m from the body's centre. Priors are off by 1 deg and 1 cm,
/// every tenth by 8 deg and 10 cm (table 5.3).
inline Orbit makeOrbit(int count, int width, int height, double noise_m) {
  Orbit orbit;
  Random random(7);
  for (int k = 0; k < count; ++k) {
    const double a = 2.0 * kPi * k / count;
    const Eigen::Vector3d position(0.75 * std::cos(a), 0.75 * std::sin(a),
                                   0.1 + 0.05 * std::sin(3.0 * a));
    orbit.truth.push_back(lookAt(position, Eigen::Vector3d(0.0, 0.0, 0.01 * std::cos(2.0 * a))));
    orbit.views.push_back(castView(k, orbit.truth.back(), width, height, noise_m,
                                   1000 + static_cast<std::uint64_t>(k)));
    Eigen::Isometry3d prior = Eigen::Isometry3d::Identity();
    if (k > 0) {
      const bool bad = k % 10 == 5;
      const auto i = static_cast<std::size_t>(k);
      prior = orbit.truth[i - 1].inverse() * orbit.truth[i] *
              random.motion((bad ? 8.0 : 1.0) * kDegree, bad ? 0.1 : 0.01);
    }
    orbit.priors.push_back(prior);
  }
  return orbit;
}

/// The settings for the field, for views of about 5000 points.
inline RegistrationOptions fieldOptions() {
  RegistrationOptions o;
  o.sampling.moving_factor = 8.0;
  o.sampling.reference_factor = 2.0;
  o.sampling.reference_method = SamplingMethod::kUniform;
  o.icp.metric = Metric::kPointToPlane;
  o.icp.stop = StopRule::kAtConvergence;
  o.icp.kernel = RobustKernel::kHuber;
  o.icp.max_iterations = 30;
  o.icp.accept_mean_m = 0.005;
  o.icp.min_overlap = 0.3;
  o.icp.max_rotation_deg = 20.0;
  o.icp.max_translation_m = 0.25;
  o.icp.converged_translation_m = 2e-5;
  o.trials.refine_translational = true;
  o.groups.warm_start = true;
  o.groups.max_members = 4;
  o.groups.match_shared_views = false;
  o.groups.inter_samples = 2000;
  return o;
}

}  // namespace scanner::registration::synthetic
