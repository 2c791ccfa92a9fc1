#include "scanner/inertial/options.h"

#include <string>

namespace scanner::inertial {

namespace {

void describeVelocity(OptionVisitor& v, InertialOptions& o) {
  v.option("start_from_rest", o.start_from_rest,
           "integrate the interval between two views from rest (thesis)");
  v.option("use_registration_velocity", o.use_registration_velocity,
           "solve the velocity from the registered poses; overrides start_from_rest");
  v.option("velocity_window_views", o.velocity_window_views, Bounds{2, 100}, "",
           "registered poses the velocity is solved from");
  v.option("registration_sigma_m", o.registration_sigma_m, Bounds{1e-6, 1.0}, "m",
           "standard deviation of a registered position");
  v.option("acceleration_noise", o.acceleration_noise, Bounds{1e-6, 10.0}, "m/s^2/sqrt(Hz)",
           "noise density of the accelerometer");
  v.option("acceleration_bias_sigma_mps2", o.acceleration_bias_sigma_mps2, Bounds{1e-6, 10.0},
           "m/s^2", "size of the constant acceleration error (tilt, bias, gravity)");
}

void describeDetection(OptionVisitor& v, InertialOptions& o) {
  v.option("still_window_s", o.still_window_s, Bounds{0.05, 10.0}, "s",
           "window of the stationary detection");
  v.option("still_gyro_std_radps", o.still_gyro_std_radps, Bounds{0.0, 10.0}, "rad/s",
           "largest standard deviation of the rate, per axis, while still");
  v.option("still_acceleration_std_mps2", o.still_acceleration_std_mps2, Bounds{0.0, 100.0},
           "m/s^2", "largest standard deviation of the acceleration, per axis, while still");
  v.option("still_rate_radps", o.still_rate_radps, Bounds{0.0, 10.0}, "rad/s",
           "largest mean rate without bias while still");
  v.option("still_gravity_error_mps2", o.still_gravity_error_mps2, Bounds{0.0, 10.0}, "m/s^2",
           "largest difference of the mean acceleration from gravity while still");
  v.option("bias_gyro_std_radps", o.bias_gyro_std_radps, Bounds{0.0, 10.0}, "rad/s",
           "largest standard deviation of the rate while the gyro bias is estimated");
  v.option("bias_acceleration_std_mps2", o.bias_acceleration_std_mps2, Bounds{0.0, 100.0}, "m/s^2",
           "largest standard deviation of the acceleration while the gyro bias is estimated");
  v.option("max_gyro_bias_radps", o.max_gyro_bias_radps, Bounds{0.0, 10.0}, "rad/s",
           "largest first estimate of the gyro bias");
}

}  // namespace

void describe(OptionVisitor& v, InertialOptions& o) {
  v.option("gravity_mps2", o.gravity_mps2, Bounds{9.7, 9.9}, "m/s^2", "magnitude of gravity");
  v.option("band_low", o.band_low, Bounds{1e-6, 0.999}, "",
           "lower edge of the band-pass, fraction of the Nyquist rate");
  v.option("band_high", o.band_high, Bounds{1e-6, 0.999}, "",
           "upper edge of the band-pass, fraction of the Nyquist rate");
  describeVelocity(v, o);
  v.option("orientation_time_constant_s", o.orientation_time_constant_s, Bounds{0.0, 1000.0}, "s",
           "0: orientation of the sensor as it is; above: gyro, pulled by it with this constant");
  v.option("levelling_time_constant_s", o.levelling_time_constant_s, Bounds{0.1, 1000.0}, "s",
           "time constant of levelling by gravity for a sensor without orientation");
  v.option("init_s", o.init_s, Bounds{0.02, 60.0}, "s", "samples gathered before states are given");
  v.option("max_gap_s", o.max_gap_s, Bounds{0.001, 10.0}, "s",
           "longer intervals between samples are gaps");
  v.option("history_s", o.history_s, Bounds{1.0, 86400.0}, "s", "how far back states are kept");
  describeDetection(v, o);
}

void validate(const InertialOptions& o) {
  if (!(o.band_low < o.band_high)) {
    throw ConfigurationError("inertial.band_low = " + std::to_string(o.band_low) +
                             " must be below band_high = " + std::to_string(o.band_high));
  }
  if (!(o.history_s > o.init_s)) {
    throw ConfigurationError("inertial.history_s = " + std::to_string(o.history_s) +
                             " must exceed init_s = " + std::to_string(o.init_s));
  }
  if (!(o.max_gap_s < o.init_s)) {
    throw ConfigurationError("inertial.max_gap_s = " + std::to_string(o.max_gap_s) +
                             " must be below init_s = " + std::to_string(o.init_s));
  }
}

}  // namespace scanner::inertial
