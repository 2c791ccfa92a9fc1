#include "scanner/simulation/imu_model.h"
#include "scanner/simulation/motion.h"

namespace scanner::simulation {

void describe(OptionVisitor& v, MotionOptions& o) {
  v.option("views", o.views, Bounds{1, 10000}, "", "pictures the motion is made for");
  v.option("view_rate_hz", o.view_rate_hz, Bounds{0.05, 100.0}, "Hz",
           "rate of these pictures; above 1.82 Hz the hand is no faster");
  v.option("still_s", o.still_s, Bounds{0.0, 60.0}, "s", "standing still before the first picture");
  v.option("tremor_m", o.tremor_m, Bounds{0.0, 0.02}, "m", "RMS of the hand's tremor, position");
  v.option("tremor_deg", o.tremor_deg, Bounds{0.0, 5.0}, "deg",
           "RMS of the hand's tremor, rotation");
  v.option("pauses", o.pauses, "the hand rests and hurries: steps of unequal length");
}

void describe(OptionVisitor& v, ImuOptions& o) {
  v.option("rate_hz", o.rate_hz, Bounds{1.0, 1000.0}, "Hz", "samples per second");
  v.option("gravity", o.gravity, Bounds{9.7, 9.9}, "m/s^2", "magnitude of gravity");
  v.option("gyro_noise_deg_s_sqrthz", o.gyro_noise_deg_s_sqrthz, Bounds{0.0, 10.0},
           "deg/s/sqrt(Hz)", "noise density of the gyro");
  v.option("accel_noise_m_s2_sqrthz", o.accel_noise_m_s2_sqrthz, Bounds{0.0, 10.0},
           "m/s^2/sqrt(Hz)", "noise density of the accelerometer");
  v.option("mag_noise_mgauss_sqrthz", o.mag_noise_mgauss_sqrthz, Bounds{0.0, 100.0},
           "mGauss/sqrt(Hz)", "noise density of the magnetometer");
  v.option("gyro_bias_deg_s", o.gyro_bias_deg_s, Bounds{0.0, 50.0}, "deg/s",
           "standard deviation of the turn-on bias, gyro");
  v.option("accel_bias_m_s2", o.accel_bias_m_s2, Bounds{0.0, 5.0}, "m/s^2",
           "standard deviation of the turn-on bias, accelerometer");
  v.option("gyro_drift_deg_s", o.gyro_drift_deg_s, Bounds{0.0, 10.0}, "deg/s",
           "standard deviation of the bias' drift, gyro");
  v.option("accel_drift_m_s2", o.accel_drift_m_s2, Bounds{0.0, 1.0}, "m/s^2",
           "standard deviation of the bias' drift, accelerometer");
  v.option("drift_time_s", o.drift_time_s, Bounds{0.1, 10000.0}, "s",
           "correlation time of the drift");
  v.option("scale_percent", o.scale_percent, Bounds{0.0, 10.0}, "%",
           "standard deviation of the scale errors");
  v.option("misalignment_deg", o.misalignment_deg, Bounds{0.0, 5.0}, "deg",
           "standard deviation of the axes' directions");
  v.option("bandwidth_hz", o.bandwidth_hz, Bounds{0.0, 1000.0}, "Hz",
           "low-pass of gyro and accelerometer; 0: none");
  v.option("attitude_static_deg", o.attitude_static_deg, Bounds{0.0, 20.0}, "deg",
           "standard deviation of roll and pitch at rest");
  v.option("heading_static_deg", o.heading_static_deg, Bounds{0.0, 20.0}, "deg",
           "standard deviation of the heading at rest");
  v.option("attitude_dynamic_deg", o.attitude_dynamic_deg, Bounds{0.0, 20.0}, "deg",
           "what quick motion adds to each of them");
  v.option("attitude_time_s", o.attitude_time_s, Bounds{0.1, 1000.0}, "s",
           "correlation time of the attitude errors");
  v.option("temperature_c", o.temperature_c, Bounds{-40.0, 85.0}, "degC", "of the sensor");
  v.option("magnetic_dip_deg", o.magnetic_dip_deg, Bounds{-90.0, 90.0}, "deg",
           "of the earth's field below the horizon");
}

ImuOptions noiseFree(ImuOptions options) {
  options.gyro_noise_deg_s_sqrthz = 0.0;
  options.accel_noise_m_s2_sqrthz = 0.0;
  options.mag_noise_mgauss_sqrthz = 0.0;
  options.gyro_bias_deg_s = 0.0;
  options.accel_bias_m_s2 = 0.0;
  options.gyro_drift_deg_s = 0.0;
  options.accel_drift_m_s2 = 0.0;
  options.scale_percent = 0.0;
  options.misalignment_deg = 0.0;
  options.bandwidth_hz = 0.0;
  options.attitude_static_deg = 0.0;
  options.heading_static_deg = 0.0;
  options.attitude_dynamic_deg = 0.0;
  return options;
}

}  // namespace scanner::simulation
