#pragma once

#include <chrono>

namespace scanner::pipeline {

/// Wall-clock seconds spent in each stage so far. NaN for a stage that runs elsewhere, where its
/// time is not taken.
struct StageTimes {
  double stereo = 0.0;
  double inertial = 0.0;
  double registration = 0.0;
  double global = 0.0;
  double surface = 0.0;
};

/// Adds the time until its end of life to a stage's account.
class StageTimer {
 public:
  explicit StageTimer(double& account) : account_(account), start_(Clock::now()) {}
  ~StageTimer() { account_ += std::chrono::duration<double>(Clock::now() - start_).count(); }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  using Clock = std::chrono::steady_clock;

  double& account_;
  Clock::time_point start_;
};

}  // namespace scanner::pipeline
