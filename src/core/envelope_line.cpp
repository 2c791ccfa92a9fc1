#include "core/envelope_line.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace scanner {
namespace {

/// The prior counts as much as a lever of this length: nothing once seconds were seen.
constexpr double kPriorLeverS = 0.5;
/// Slopes whose value is this close to the best are equally good: seconds, and share of the room.
constexpr double kIndifferentS = 20e-6;
constexpr double kIndifferentShare = 0.05;
constexpr int kSearchSteps = 40;
constexpr int kBisectionSteps = 20;

double lowest(const std::vector<EnvelopePoint>& points, double x, double slope) {
  double best = std::numeric_limits<double>::infinity();
  for (const EnvelopePoint& p : points) best = std::min(best, p.y - slope * (p.x - x));
  return best;
}

std::size_t highest(const std::vector<EnvelopePoint>& points, double x, double slope) {
  std::size_t best = 0;
  double best_y = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double y = points[i].y - slope * (points[i].x - x);
    if (y > best_y) {
      best_y = y;
      best = i;
    }
  }
  return best;
}

/// What is maximised over the slope; concave, so that a search by thirds finds the maximum.
class Objective {
 public:
  explicit Objective(const EnvelopeProblem& problem) : problem_(problem) {
    for (const EnvelopePoint& p : problem.upper) mean_x_ += p.x;
    mean_x_ /= static_cast<double>(problem.upper.size());
  }

  double operator()(double slope) const {
    const double top = lowest(problem_.upper, problem_.x, slope);
    const double prior = kPriorLeverS * std::abs(slope - problem_.prior_slope);
    if (!problem_.usesLower()) return top + slope * (mean_x_ - problem_.x) - prior;
    const EnvelopePoint& p = problem_.lower[highest(problem_.lower, problem_.x, slope)];
    return top - (p.y - slope * (p.x - problem_.x)) - prior;
  }

 private:
  const EnvelopeProblem& problem_;
  double mean_x_ = 0.0;
};

/// The slope furthest from `good` towards `limit` whose value is at least `value`.
double edge(const Objective& objective, double good, double limit, double value) {
  if (objective(limit) >= value) return limit;
  double bad = limit;
  for (int i = 0; i < kBisectionSteps; ++i) {
    const double middle = 0.5 * (good + bad);
    (objective(middle) >= value ? good : bad) = middle;
  }
  return good;
}

}  // namespace

EnvelopeFit fitEnvelope(const EnvelopeProblem& problem) {
  const Objective objective(problem);
  double low = -problem.max_slope;
  double high = problem.max_slope;
  for (int i = 0; i < kSearchSteps; ++i) {
    const double third = (high - low) / 3.0;
    (objective(low + third) < objective(high - third) ? low : high) +=
        objective(low + third) < objective(high - third) ? third : -third;
  }
  const double best = 0.5 * (low + high);
  const double best_value = objective(best);
  const bool two_sided = problem.usesLower();
  const double indifferent =
      kIndifferentS + (two_sided ? kIndifferentShare * std::max(best_value, 0.0) : 0.0);
  const auto middle = [&](double value, double* half_range) {
    const double from = edge(objective, best, -problem.max_slope, value);
    const double to = edge(objective, best, problem.max_slope, value);
    *half_range = 0.5 * (to - from);
    return 0.5 * (from + to);
  };
  EnvelopeFit fit;
  fit.line.x = problem.x;
  fit.line.slope = middle(best_value - indifferent, &fit.slope_uncertainty);
  fit.line.y = lowest(problem.upper, problem.x, fit.line.slope);
  fit.room = std::numeric_limits<double>::infinity();
  if (two_sided) {
    fit.binding_lower = highest(problem.lower, problem.x, fit.line.slope);
    const EnvelopePoint& p = problem.lower[fit.binding_lower];
    fit.room = fit.line.at(p.x) - p.y;
    middle(std::min(0.0, best_value - indifferent), &fit.slope_uncertainty);
  }
  return fit;
}

}  // namespace scanner
