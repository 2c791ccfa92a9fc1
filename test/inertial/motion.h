#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <functional>
#include <random>
#include <vector>

#include "scanner/core/imu.h"
#include "scanner/core/se3.h"

namespace scanner::inertial::testing {

inline Time at(double t) { return fromNanoseconds(1'000'000'000'000) + fromSeconds(t); }

/// A motion as T_world_base over seconds, at least three times differentiable.
using Path = std::function<Eigen::Isometry3d(double)>;

struct Noise {
  double gyro_radps = 0.0;
  double acceleration_mps2 = 0.0;
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();
  std::uint64_t seed = 1;
};

/// What an inertial sensor on `path` reports, from central differences of the path.
inline std::vector<ImuSample> sense(const Path& path, double rate_hz, double duration_s,
                                    double gravity, bool orientation, const Noise& noise = {}) {
  std::mt19937_64 generator(noise.seed);
  std::normal_distribution<double> normal;
  const auto random = [&](double sigma) {
    return Eigen::Vector3d(
        Eigen::Vector3d(normal(generator), normal(generator), normal(generator)) * sigma);
  };
  std::vector<ImuSample> samples;
  const int n = static_cast<int>(duration_s * rate_hz);
  for (int i = 0; i <= n; ++i) {
    const double t = i / rate_hz;
    const double h = 1e-3;
    const Eigen::Isometry3d a = path(t - h), b = path(t), c = path(t + h);
    ImuSample s;
    s.stamp = at(t);
    const Eigen::Vector3d acceleration =
        (a.translation() - 2.0 * b.translation() + c.translation()) / (h * h);
    s.linear_acceleration =
        b.linear().transpose() * (acceleration + gravity * Eigen::Vector3d::UnitZ()) +
        random(noise.acceleration_mps2);
    s.angular_velocity =
        logSo3(Eigen::Quaterniond(a.linear()).conjugate() * Eigen::Quaterniond(c.linear())) /
            (2.0 * h) +
        noise.gyro_bias + random(noise.gyro_radps);
    if (orientation) s.orientation = Eigen::Quaterniond(b.linear());
    samples.push_back(s);
  }
  return samples;
}

/// 0 until `begin`, then smoothly into t - const: a start from rest.
inline double smoothStart(double t, double begin) {
  const double u = t - begin;
  return u <= 0.0 ? 0.0 : u * u * u * u / (u * u * u + 0.2);
}

/// Round a circle of 0.7 m in the x-y plane, facing its centre, bobbing, at 0.25 rad/s, after
/// standing still for `still_s`.
inline Path orbit(double still_s) {
  return [still_s](double t) {
    const double s = smoothStart(t, still_s);
    const double angle = 0.25 * s;
    const Eigen::Vector3d p(0.7 * std::cos(angle), 0.7 * std::sin(angle),
                            0.05 * std::sin(1.3 * s) * std::tanh(s));
    const Eigen::Quaterniond q = expSo3(Eigen::Vector3d(0.0, 0.0, angle)) *
                                 expSo3(Eigen::Vector3d(0.1 * std::sin(0.9 * s), 0.2, 0.0));
    return makePose(p, q);
  };
}

}  // namespace scanner::inertial::testing
