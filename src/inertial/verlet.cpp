#include "scanner/inertial/verlet.h"

#include <cstddef>
#include <string>

#include "scanner/core/status.h"

namespace scanner::inertial {

std::vector<Eigen::Vector3d> integrateVerlet(const std::vector<Eigen::Vector3d>& a, double h,
                                             const Eigen::Vector3d& v0) {
  if (!(h > 0.0)) {
    throw ConfigurationError("integrateVerlet: step must be positive, got " + std::to_string(h));
  }
  std::vector<Eigen::Vector3d> x(a.size(), Eigen::Vector3d::Zero());
  if (a.size() > 1) x[1] = v0 * h + 0.5 * h * h * a[0];
  for (std::size_t i = 1; i + 1 < a.size(); ++i) {
    x[i + 1] = x[i] + (x[i] - x[i - 1]) + h * h * a[i];
  }
  return x;
}

std::vector<Eigen::Vector3d> integrateVerletTimeCorrected(const std::vector<double>& t,
                                                          const std::vector<Eigen::Vector3d>& a,
                                                          const Eigen::Vector3d& v0) {
  if (t.size() != a.size()) {
    throw ConfigurationError("integrateVerletTimeCorrected: " + std::to_string(t.size()) +
                             " times for " + std::to_string(a.size()) + " accelerations");
  }
  std::vector<Eigen::Vector3d> x(a.size(), Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i + 1 < a.size(); ++i) {
    const double next = t[i + 1] - t[i];
    if (!(next > 0.0)) {
      throw ConfigurationError("integrateVerletTimeCorrected: times must increase, step " +
                               std::to_string(i) + " is " + std::to_string(next));
    }
    if (i == 0) {
      x[1] = v0 * next + 0.5 * next * next * a[0];
    } else {
      const double last = t[i] - t[i - 1];
      x[i + 1] = x[i] + (x[i] - x[i - 1]) * (next / last) + a[i] * (0.5 * next * (last + next));
    }
  }
  return x;
}

VerletIntegrator::VerletIntegrator(const Eigen::Vector3d& position, const Eigen::Vector3d& velocity,
                                   const Eigen::Vector3d& acceleration)
    : x_(position), x_previous_(position), v_(velocity), a_(acceleration) {}

void VerletIntegrator::advance(double h, const Eigen::Vector3d& acceleration) {
  Eigen::Vector3d next;
  if (h_previous_ > 0.0) {
    next = x_ + (x_ - x_previous_) * (h / h_previous_) + a_ * (0.5 * h * (h_previous_ + h));
  } else {
    next = x_ + v_ * h + 0.5 * h * h * a_;
  }
  v_ = (next - x_) / h + 0.5 * h * acceleration;
  x_previous_ = x_;
  x_ = next;
  a_ = acceleration;
  h_previous_ = h;
}

}  // namespace scanner::inertial
