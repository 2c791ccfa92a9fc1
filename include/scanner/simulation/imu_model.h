#pragma once

#include <cstdint>
#include <vector>

#include "scanner/core/imu.h"
#include "scanner/core/options.h"
#include "scanner/simulation/motion.h"

namespace scanner::simulation {

/// Block `simulation.imu`: an Xsens MTi (method.md section 1). Each effect is off at 0.
struct ImuOptions {
  double rate_hz = 100.0;
  double gravity = 9.82;  ///< m/s^2
  double gyro_noise_deg_s_sqrthz = 0.1;
  double accel_noise_m_s2_sqrthz = 0.02;
  double mag_noise_mgauss_sqrthz = 0.5;
  double gyro_bias_deg_s = 0.3;  ///< standard deviation of the turn-on bias
  double accel_bias_m_s2 = 0.02;
  double gyro_drift_deg_s = 0.02;  ///< bias instability, first-order Gauss-Markov
  double accel_drift_m_s2 = 0.004;
  double drift_time_s = 60.0;         ///< correlation time of the drift
  double scale_percent = 0.1;         ///< standard deviation of the scale errors
  double misalignment_deg = 0.1;      ///< of the axes
  double bandwidth_hz = 40.0;         ///< low-pass of gyro and accelerometer; 0: none
  double attitude_static_deg = 0.25;  ///< roll, pitch: standard deviation, correlated
  double heading_static_deg = 0.5;
  double attitude_dynamic_deg = 1.0;  ///< besides, in motion
  double attitude_time_s = 8.0;       ///< correlation time of the attitude errors
  double temperature_c = 24.0;
  double magnetic_dip_deg = 70.0;  ///< downwards, Ottawa
};
void describe(OptionVisitor& v, ImuOptions& o);
/// All errors and the bandwidth switched off.
ImuOptions noiseFree(ImuOptions options);

/// One sample with everything the device knows.
struct MtiSample {
  double time_s = 0.0;        ///< true time on the motion's clock
  std::uint16_t counter = 0;  ///< wraps
  ImuSample imu;              ///< stamp = start + time; orientation in ENU (map)
  Eigen::Vector3d magnetic_field = Eigen::Vector3d::Zero();  ///< base_link; 1 = the earth's field
  double temperature_c = 0.0;
  ImuSample truth;  ///< without any error, at the same stamp
};

/// Samples at i / rate for the whole motion, in order. Same seed, same bytes.
std::vector<MtiSample> simulateImu(const Motion& motion, const ImuOptions& options, Time start,
                                   int seed);

}  // namespace scanner::simulation
