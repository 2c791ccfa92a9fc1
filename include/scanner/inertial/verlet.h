#pragma once

#include <Eigen/Core>
#include <vector>

namespace scanner::inertial {

/// Positions at the times of the accelerations `a` (m/s^2), `h` seconds apart, by Verlet's method
/// (thesis eq. 4.8): x[i+1] = x[i] + (x[i] - x[i-1]) + h^2 a[i], x[0] = 0. The printed start does
/// not follow from a Taylor step; used is x[1] = v0 h + 1/2 a[0] h^2. Second order in h; exact for
/// a constant acceleration. h > 0 (ConfigurationError).
std::vector<Eigen::Vector3d> integrateVerlet(const std::vector<Eigen::Vector3d>& a, double h,
                                             const Eigen::Vector3d& v0 = Eigen::Vector3d::Zero());

/// The time-corrected form, for samples at uneven times t (seconds, strictly increasing, as many as
/// accelerations; ConfigurationError otherwise):
///     x[i+1] = x[i] + (x[i] - x[i-1]) h1 / h0 + a[i] h1 (h0 + h1) / 2,   h0, h1: last, next step.
/// Equal to the plain form for even steps, exact for a constant acceleration, second order.
std::vector<Eigen::Vector3d> integrateVerletTimeCorrected(
    const std::vector<double>& t, const std::vector<Eigen::Vector3d>& a,
    const Eigen::Vector3d& v0 = Eigen::Vector3d::Zero());

/// The time-corrected form one step at a time. Besides the two positions that Verlet's method keeps
/// it gives the velocity belonging to it, (x[i] - x[i-1]) / h + 1/2 a[i] h: with it
/// x[i+1] = x[i] + v[i] h1 + 1/2 a[i] h1^2 holds exactly, so a stretch of the stream can be started
/// again from rest by subtracting v times the time.
class VerletIntegrator {
 public:
  /// At rest at the origin.
  VerletIntegrator() = default;
  VerletIntegrator(const Eigen::Vector3d& position, const Eigen::Vector3d& velocity,
                   const Eigen::Vector3d& acceleration);

  /// The next sample, `h` > 0 seconds after the last.
  void advance(double h, const Eigen::Vector3d& acceleration);

  const Eigen::Vector3d& position() const { return x_; }
  const Eigen::Vector3d& velocity() const { return v_; }
  const Eigen::Vector3d& acceleration() const { return a_; }

 private:
  Eigen::Vector3d x_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d x_previous_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d v_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d a_ = Eigen::Vector3d::Zero();
  double h_previous_ = 0.0;  // 0: no step taken yet
};

}  // namespace scanner::inertial
