#include "simulation/step_curve.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace scanner::simulation {
namespace {

/// Share of a step that is 2 intervals wide within the interval it belongs to, and within each of
/// the neighbours.
double ownShare() { return smoothStep(0.5).value - smoothStep(-0.5).value; }
double neighbourShare() { return 0.5 * (1.0 - ownShare()); }

/// Heights of the smooth steps for which the curve rises by `rises` from picture to picture: a
/// tridiagonal system with a dominant diagonal, solved by elimination. The first step keeps to its
/// own interval, so that the curve starts from rest at the first value.
std::vector<StepCurve::Vector6> solveSteps(std::vector<StepCurve::Vector6> rises) {
  const double side = neighbourShare();
  std::vector<double> diagonal(rises.size(), ownShare());
  if (!rises.empty()) diagonal[0] = 1.0;
  for (std::size_t i = 1; i < rises.size(); ++i) {
    const double below = i == 1 ? 0.0 : side;  // nothing of the first step reaches the second rise
    const double factor = below / diagonal[i - 1];
    diagonal[i] -= factor * side;
    rises[i] -= factor * rises[i - 1];
  }
  for (std::size_t i = rises.size(); i-- > 0;) {
    if (i + 1 < rises.size()) rises[i] -= side * rises[i + 1];
    rises[i] /= diagonal[i];
  }
  return rises;
}

}  // namespace

SmoothStep smoothStep(double x) {
  if (x <= -1.0) return {0.0, 0.0, 0.0};
  if (x >= 1.0) return {1.0, 0.0, 0.0};
  constexpr double kScale = 35.0 / 32.0;
  const double s = x * x;
  const double bell = 1.0 - s;
  return {0.5 + kScale * x * (1.0 - s + 0.6 * s * s - s * s * s / 7.0), kScale * bell * bell * bell,
          kScale * -6.0 * x * bell * bell};
}

StepCurve::StepCurve(double start_s, double interval_s, const std::vector<Vector6>& values)
    : start_s_(start_s), interval_s_(interval_s) {
  std::vector<Vector6> rises;
  for (std::size_t i = 1; i < values.size(); ++i) rises.push_back(values[i] - values[i - 1]);
  steps_ = solveSteps(std::move(rises));
  sums_.push_back(values.front());
  for (const Vector6& step : steps_) sums_.push_back(sums_.back() + step);
}

Signals StepCurve::at(double time_s) const {
  const double position = (time_s - start_s_) / interval_s_;
  const int count = static_cast<int>(steps_.size());
  const int here = static_cast<int>(std::floor(std::clamp(position, -1.0, count + 1.0)));
  // Steps before `first` are complete, those from `last` on have not begun.
  const int first = std::clamp(here - 1, 0, count);
  const int last = std::clamp(here + 2, 0, count);
  Signals signals = Signals::Zero();
  signals.col(0) = sums_[static_cast<std::size_t>(first)];
  for (int i = first; i < last; ++i) {
    const double per_interval = i == 0 ? 2.0 : 1.0;
    const double per_second = per_interval / interval_s_;
    const SmoothStep step = smoothStep((position - i - 0.5) * per_interval);
    const Vector6& height = steps_[static_cast<std::size_t>(i)];
    signals.col(0) += step.value * height;
    signals.col(1) += step.first * per_second * height;
    signals.col(2) += step.second * per_second * per_second * height;
  }
  return signals;
}

double StepCurve::restTime() const {
  const auto intervals = static_cast<double>(steps_.size());
  return start_s_ + interval_s_ * (steps_.size() > 1 ? intervals + 0.5 : intervals);
}

}  // namespace scanner::simulation
