#pragma once

#include "scanner/core/options.h"

namespace scanner::inertial {

/// Settings of the inertial stage. The defaults are the published ones (thesis 4.4, table 4.1);
/// what goes past the thesis is off, or is a threshold that the published method does not have.
struct InertialOptions {
  /// Magnitude of gravity, m/s^2 (thesis 4.4: G = [0 0 -9.82]).
  double gravity_mps2 = 9.82;
  /// Edges of the first-order Butterworth band-pass, as fractions of the Nyquist rate of the actual
  /// sample rate (thesis 4.4: 0.01 and 0.9).
  double band_low = 0.01;
  double band_high = 0.9;

  /// Every interval between two views is integrated from rest (thesis 4.4: the sample buffer is
  /// emptied at each frame). When false the velocity of the stream counts.
  bool start_from_rest = true;
  /// Past the thesis: poses given to correct() determine the velocity, and unfiltered accelerations
  /// carry it forward. Takes precedence over start_from_rest.
  bool use_registration_velocity = false;
  /// How many of the latest poses the velocity is solved from.
  int velocity_window_views = 6;
  /// Standard deviation of a registered position, metres.
  double registration_sigma_m = 0.002;
  /// Noise density of the accelerometer, m/s^2/sqrt(Hz) (method.md, rig table).
  double acceleration_noise = 0.02;
  /// How large the constant part of the acceleration error (tilt of the map, bias, gravity) may
  /// be, m/s^2, one standard deviation.
  double acceleration_bias_sigma_mps2 = 0.1;

  /// 0: the orientation that came with a sample is used as it is (thesis). Above: the gyro carries
  /// the attitude and the sensor's orientation pulls it with this time constant, so that relative
  /// rotations over a second have the precision of the gyro, without its drift.
  double orientation_time_constant_s = 0.0;
  /// Time constant with which gravity levels the attitude of a sensor without orientation.
  double levelling_time_constant_s = 10.0;

  /// Samples gathered before a stretch of data starts to give states: they initialise the filter,
  /// the attitude and the gyro bias.
  double init_s = 1.0;
  /// Stamps further apart than this are a gap: integration restarts behind it.
  double max_gap_s = 0.1;
  /// How far back predict() can look.
  double history_s = 60.0;

  /// The sensor stands still when, over the window, the standard deviations stay below these, the
  /// mean rate (without bias) is below `still_rate_radps`, and the mean acceleration is gravity
  /// within `still_gravity_error_mps2`.
  double still_window_s = 0.5;
  double still_gyro_std_radps = 0.02;
  double still_acceleration_std_mps2 = 0.12;
  double still_rate_radps = 0.015;
  double still_gravity_error_mps2 = 0.5;
  /// Looser limits under which the gyro bias is estimated: a vehicle that vibrates on the spot.
  double bias_gyro_std_radps = 0.06;
  double bias_acceleration_std_mps2 = 0.6;
  /// A first estimate of the gyro bias beyond this is motion, not bias.
  double max_gyro_bias_radps = 0.12;
};

void describe(OptionVisitor& v, InertialOptions& o);

/// Relations between fields that bounds cannot say. Throws ConfigurationError naming the option.
void validate(const InertialOptions& options);

}  // namespace scanner::inertial
