#pragma once

#include <Eigen/Core>
#include <vector>

namespace scanner::simulation {

/// Values of several signals at one time with their first and second derivatives, one per column.
using Signals = Eigen::Matrix<double, 6, 3>;

/// A smooth step from 0 to 1 over [-1, 1], three times continuously differentiable: the integral of
/// (1 - x^2)^3. Constant outside.
struct SmoothStep {
  double value;
  double first;
  double second;
};
SmoothStep smoothStep(double x);

/// Six signals through given values at equal intervals, three times continuously differentiable,
/// and at rest, with all derivatives zero, up to the first value and from half an interval behind
/// the last one on. Between them it is a sum of smooth steps that reach half an interval into their
/// neighbours: an ordinary interpolating spline would swing on into the time of standing still.
class StepCurve {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  /// At least one value; `interval_s` > 0.
  StepCurve(double start_s, double interval_s, const std::vector<Vector6>& values);

  Signals at(double time_s) const;
  /// From here on the curve is at rest.
  double restTime() const;

 private:
  double start_s_;
  double interval_s_;
  std::vector<Vector6> steps_;  ///< height of each smooth step
  std::vector<Vector6> sums_;   ///< first value and all steps before
};

}  // namespace scanner::simulation
