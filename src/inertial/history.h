#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <deque>

#include "scanner/core/time.h"

namespace scanner::inertial {

/// What is kept of every sample.
struct HistoryEntry {
  Time stamp;
  int segment = 0;
  Eigen::Quaterniond R_odom_base = Eigen::Quaterniond::Identity();
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();   ///< rad/s, base frame, without bias
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< specific force in odom, m/s^2, unfiltered
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< of the band-passed stream, odom
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();      ///< likewise
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  ///< likewise
  bool still = false;
};

/// Displacement and velocity after a stretch of time, in the frame the forces were turned to.
struct Motion {
  Eigen::Vector3d displacement = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
};

/// Samples of the past by time. Stamps handed in are not before the first entry.
class History {
 public:
  std::deque<HistoryEntry>& entries() { return entries_; }
  const std::deque<HistoryEntry>& entries() const { return entries_; }
  bool empty() const { return entries_.empty(); }

  /// Index of the last entry at or before `stamp`.
  std::size_t indexAt(Time stamp) const;
  /// True when `stamp` lies between two entries of different segments.
  bool inGap(Time stamp) const;
  /// Entry interpolated at `stamp`; past the last one at constant rate and acceleration.
  HistoryEntry at(Time stamp) const;

  /// Integrates a(t) = R force(t) + constant from t0 to t1, accelerations being linear between
  /// samples. `hold`: while standing still, velocity and displacement per step are zero.
  Motion integrate(Time t0, Time t1, const Eigen::Vector3d& velocity, const Eigen::Matrix3d& R,
                   const Eigen::Vector3d& constant, bool hold) const;

 private:
  Eigen::Vector3d forceAt(std::size_t index, Time stamp) const;
  std::deque<HistoryEntry> entries_;
};

}  // namespace scanner::inertial
