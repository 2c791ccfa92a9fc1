#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

#include "scanner/core/time.h"
#include "scanner/mti/driver.h"
#include "scanner/simulation/emulated_mti.h"

/// A motion for the emulated MTi of which every value tells the time at which it was sampled: all
/// are linear in time, the orientation turns about the vertical. So each sample that a driver gives
/// can be compared with what the device measured, and its stamp with the true time.
namespace scanner::test {

inline constexpr double kTruthEndS = 2000.0;
/// A value in single precision tells the time to this.
inline constexpr double kTruthTimeToleranceS = 0.3e-3;

inline simulation::MtiSample truthAt(double time_s) {
  simulation::MtiSample sample;
  sample.time_s = time_s;
  sample.imu.linear_acceleration = {5e-3 * time_s - 5.0, 1.0 - 2e-3 * time_s, 9.81 + 5e-4 * time_s};
  sample.imu.angular_velocity = {1e-3 * time_s - 1.0, 0.5 - 3e-4 * time_s, 0.1 + 1e-4 * time_s};
  sample.magnetic_field = {0.3 + 1e-4 * time_s, -0.2, 0.9 - 2e-4 * time_s};
  sample.imu.orientation =
      Eigen::Quaterniond(Eigen::AngleAxisd(1e-3 * time_s, Eigen::Vector3d::UnitZ()));
  sample.temperature_c = 20.0 + 5e-3 * time_s;
  return sample;
}

/// Two samples: the device interpolates.
inline std::vector<simulation::MtiSample> truthTrack() {
  return {truthAt(0.0), truthAt(kTruthEndS)};
}

/// Seconds on the track, as the sample's acceleration tells.
inline double trackTime(const mti::Sample& sample) {
  return (sample.acceleration->x() + 5.0) / 5e-3;
}

/// Largest difference of the sample from what the device measured at that time.
inline double differenceFromTruth(const mti::Sample& sample, double time_s) {
  const simulation::MtiSample truth = truthAt(time_s);
  double off = 0.0;
  const auto compare = [&off](const std::optional<Eigen::Vector3d>& value,
                              const Eigen::Vector3d& expected) {
    if (value) off = std::max(off, (*value - expected).cwiseAbs().maxCoeff());
  };
  compare(sample.acceleration, truth.imu.linear_acceleration);
  compare(sample.angular_velocity, truth.imu.angular_velocity);
  compare(sample.magnetic_field, truth.magnetic_field);
  if (sample.orientation) {
    off = std::max(off, sample.orientation->angularDistance(*truth.imu.orientation));
  }
  if (sample.temperature_c)
    off = std::max(off, std::abs(*sample.temperature_c - truth.temperature_c));
  return off;
}

/// Rounding to single precision leaves this much; a damaged value may be anything.
inline constexpr double kTruthTolerance = 5e-6;

/// Time of sample `number` on the track: linear in the number; the offset is the median of what the
/// samples tell themselves.
class TruthLine {
 public:
  TruthLine(const std::vector<mti::Sample>& samples, double period_s) : period_s_(period_s) {
    std::vector<double> offsets;
    for (const mti::Sample& s : samples) offsets.push_back(trackTime(s) - at(s));
    std::sort(offsets.begin(), offsets.end());
    if (offsets.empty()) return;
    const std::size_t quarter = offsets.size() / 4;
    double sum = 0.0;
    for (std::size_t i = quarter; i < offsets.size() - quarter; ++i) sum += offsets[i];
    offset_ = sum / static_cast<double>(offsets.size() - 2 * quarter);
  }
  double at(const mti::Sample& sample) const {
    return offset_ + static_cast<double>(sample.number) * period_s_;
  }

 private:
  double period_s_;
  double offset_ = 0.0;
};

inline bool isWrong(const mti::Sample& sample, const TruthLine& line) {
  return !(differenceFromTruth(sample, line.at(sample)) < kTruthTolerance);
}

}  // namespace scanner::test
