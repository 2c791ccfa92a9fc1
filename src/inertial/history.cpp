#include "inertial/history.h"

#include <algorithm>

#include "scanner/core/se3.h"

namespace scanner::inertial {

std::size_t History::indexAt(Time stamp) const {
  const auto after =
      std::upper_bound(entries_.begin(), entries_.end(), stamp,
                       [](Time t, const HistoryEntry& entry) { return t < entry.stamp; });
  const auto distance = after - entries_.begin();
  return distance > 0 ? static_cast<std::size_t>(distance - 1) : 0;
}

bool History::inGap(Time stamp) const {
  const std::size_t i = indexAt(stamp);
  return i + 1 < entries_.size() && entries_[i].stamp < stamp &&
         entries_[i].segment != entries_[i + 1].segment;
}

Eigen::Vector3d History::forceAt(std::size_t index, Time stamp) const {
  const HistoryEntry& a = entries_[index];
  if (index + 1 >= entries_.size() || entries_[index + 1].segment != a.segment) return a.force;
  const HistoryEntry& b = entries_[index + 1];
  const double s = toSeconds(stamp - a.stamp) / toSeconds(b.stamp - a.stamp);
  return a.force + s * (b.force - a.force);
}

HistoryEntry History::at(Time stamp) const {
  const std::size_t i = indexAt(stamp);
  HistoryEntry out = entries_[i];
  const double t = toSeconds(stamp - out.stamp);
  out.stamp = stamp;
  out.force = forceAt(i, stamp);
  if (t == 0.0) return out;
  // Inside a step Verlet's positions belong to the acceleration at its start.
  out.position += out.velocity * t + 0.5 * t * t * out.acceleration;
  out.velocity += out.acceleration * t;
  if (i + 1 < entries_.size() && entries_[i + 1].segment == out.segment) {
    const HistoryEntry& next = entries_[i + 1];
    const double h = toSeconds(next.stamp - entries_[i].stamp);
    const double s = t / h;
    out.velocity += 0.5 * t * s * (next.acceleration - out.acceleration);
    out.acceleration += s * (next.acceleration - out.acceleration);
    out.rate += s * (next.rate - out.rate);
    out.R_odom_base = out.R_odom_base.slerp(s, next.R_odom_base);
    out.still = out.still && next.still;
  } else {
    out.R_odom_base = (out.R_odom_base * expSo3(out.rate * t)).normalized();
  }
  return out;
}

Motion History::integrate(Time t0, Time t1, const Eigen::Vector3d& velocity,
                          const Eigen::Matrix3d& R, const Eigen::Vector3d& constant,
                          bool hold) const {
  Motion m;
  m.velocity = velocity;
  std::size_t i = indexAt(t0);
  Time t = t0;
  Eigen::Vector3d a0 = R * forceAt(i, t) + constant;
  while (t < t1) {
    const bool last = i + 1 >= entries_.size();
    const Time next = last ? t1 : std::min(t1, entries_[i + 1].stamp);
    const Eigen::Vector3d a1 = R * forceAt(i, next) + constant;
    const double h = toSeconds(next - t);
    if (hold && entries_[i].still && (last || entries_[i + 1].still)) {
      m.velocity.setZero();
    } else {
      m.displacement += m.velocity * h + (2.0 * a0 + a1) * (h * h / 6.0);
      m.velocity += (a0 + a1) * (0.5 * h);
    }
    a0 = a1;
    t = next;
    if (!last && entries_[i + 1].stamp <= t) ++i;
  }
  return m;
}

}  // namespace scanner::inertial
