#include "simulation/mti_track.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "scanner/core/status.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector3d;

/// Catmull-Rom through the two middle ones of four equidistant values.
Vector3d cubic(const std::array<Vector3d, 4>& p, double s) {
  const Vector3d linear = p[2] - p[0];
  const Vector3d square = 2.0 * p[0] - 5.0 * p[1] + 4.0 * p[2] - p[3];
  const Vector3d cube = 3.0 * (p[1] - p[2]) + p[3] - p[0];
  return p[1] + 0.5 * s * (linear + s * (square + s * cube));
}

Vector3d linear(const Vector3d& a, const Vector3d& b, double s) { return a + s * (b - a); }

MtiReading reading(const MtiSample& sample) {
  return {sample.imu.angular_velocity, sample.imu.linear_acceleration, sample.magnetic_field,
          *sample.imu.orientation, sample.temperature_c};
}

/// Replaces the linear interpolation by truth and error, see the class.
void interpolateTruth(const std::array<const MtiSample*, 4>& around, double s, MtiReading* out) {
  const auto curve = [&around, s](Vector3d ImuSample::*field) {
    std::array<Vector3d, 4> values;
    for (std::size_t i = 0; i < 4; ++i) values[i] = around[i]->truth.*field;
    return cubic(values, s);
  };
  const MtiSample& nearest = *around[s < 0.5 ? 1 : 2];
  const auto error = [&nearest](Vector3d ImuSample::*field) -> Vector3d {
    return nearest.imu.*field - nearest.truth.*field;
  };
  out->angular_velocity = curve(&ImuSample::angular_velocity) + error(&ImuSample::angular_velocity);
  out->linear_acceleration =
      curve(&ImuSample::linear_acceleration) + error(&ImuSample::linear_acceleration);
  const Eigen::Quaterniond truth =
      around[1]->truth.orientation->slerp(s, *around[2]->truth.orientation);
  out->orientation = truth * (nearest.truth.orientation->conjugate() * *nearest.imu.orientation);
}

}  // namespace

MtiTrack::MtiTrack(std::vector<MtiSample> samples, double still_end_s)
    : samples_(std::move(samples)), still_end_s_(still_end_s) {
  if (samples_.empty()) throw ConfigurationError("an emulated MTi needs at least one sample");
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    if (!samples_[i].imu.orientation) {
      throw ConfigurationError("sample " + std::to_string(i) + " of the MTi has no orientation");
    }
    if (i > 0 && samples_[i].time_s <= samples_[i - 1].time_s) {
      throw ConfigurationError("time of the MTi's samples goes back at " + std::to_string(i));
    }
  }
}

double MtiTrack::folded(double time_s) const {
  const double past_s = time_s - samples_.back().time_s;
  if (past_s > 0.0 && still_end_s_ > 0.0) {
    const double phase = std::fmod(past_s, 2.0 * still_end_s_);
    return samples_.back().time_s - std::min(phase, 2.0 * still_end_s_ - phase);
  }
  const double lead_s = -samples_.front().time_s;
  if (time_s >= 0.0 || lead_s <= 0.0) return time_s;
  const double phase = std::fmod(-time_s, 2.0 * lead_s);
  return -std::min(phase, 2.0 * lead_s - phase);
}

MtiReading MtiTrack::at(double unfolded_s) const {
  const double time_s = folded(unfolded_s);
  if (time_s <= samples_.front().time_s) return reading(samples_.front());
  if (time_s >= samples_.back().time_s) return reading(samples_.back());
  const auto after =
      std::upper_bound(samples_.begin(), samples_.end(), time_s,
                       [](double time, const MtiSample& sample) { return time < sample.time_s; });
  const auto next = static_cast<std::size_t>(after - samples_.begin());
  const MtiSample& a = samples_[next - 1];
  const MtiSample& b = samples_[next];
  const double s = (time_s - a.time_s) / (b.time_s - a.time_s);
  MtiReading out;
  out.angular_velocity = linear(a.imu.angular_velocity, b.imu.angular_velocity, s);
  out.linear_acceleration = linear(a.imu.linear_acceleration, b.imu.linear_acceleration, s);
  out.magnetic_field = linear(a.magnetic_field, b.magnetic_field, s);
  out.orientation = a.imu.orientation->slerp(s, *b.imu.orientation);
  out.temperature_c = a.temperature_c + s * (b.temperature_c - a.temperature_c);
  if (a.truth.orientation && b.truth.orientation) {
    const MtiSample& before = samples_[next > 1 ? next - 2 : 0];
    const MtiSample& beyond = samples_[std::min(next + 1, samples_.size() - 1)];
    interpolateTruth({&before, &a, &b, &beyond}, s, &out);
  }
  return out;
}

}  // namespace scanner::simulation
