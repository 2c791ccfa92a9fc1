#pragma once

#include <vector>

/// The line of the clock model: below every upper bound, above the lower ones.
namespace scanner {

struct EnvelopePoint {
  double x = 0.0;
  double y = 0.0;
};

struct EnvelopeLine {
  double x = 0.0;  ///< where `y` is
  double y = 0.0;
  double slope = 0.0;

  double at(double where) const { return y + slope * (where - x); }
};

struct EnvelopeProblem {
  std::vector<EnvelopePoint> upper;  ///< at least one
  std::vector<EnvelopePoint> lower;  ///< fewer than half as many: not used
  double x = 0.0;                    ///< where the line is wanted: the present
  double prior_slope = 0.0;          ///< the slope as long as little is known
  double max_slope = 0.0;

  bool usesLower() const { return 2 * lower.size() >= upper.size(); }
};

struct EnvelopeFit {
  EnvelopeLine line;  ///< the highest one of its slope that stays below all upper points
  /// How far the line can be lowered until it meets a lower point; negative when it already is
  /// below one, infinite when lower points are not used.
  double room = 0.0;
  double slope_uncertainty = 0.0;  ///< half the range of slopes that the bounds allow
  std::size_t binding_lower = 0;   ///< index of the lower point that limits the room
};

/// With lower points: the line of the largest distance to both kinds. Without: the line that is
/// highest at the mean x. The slope is the middle of those that are as good as the best.
EnvelopeFit fitEnvelope(const EnvelopeProblem& problem);

}  // namespace scanner
