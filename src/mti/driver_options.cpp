#include "mti/driver_options.h"

#include <nlohmann/json.hpp>
#include <string>

#include "scanner/mti/settings.h"

namespace scanner::mti {

void describe(OptionVisitor& v, DriverOptions& o) {
  v.option("port", o.port,
           "serial port of the MTi; auto: the first USB adapter with one behind it");
  v.option("baud_rate", o.baud_rate, Bounds{9600, 921600}, "bit/s",
           "wanted; the device is found at any rate and moved to this one");
  v.option("two_stop_bits", o.two_stop_bits, "devices made before 2008 need them");
  v.option("low_latency", o.low_latency, "ask a USB adapter not to collect bytes");
  v.option("rate_hz", o.rate_hz, Bounds{2.0, 512.0}, "Hz",
           "samples a second; limited to what device and line can carry");
  v.choice(
      "orientation", o.orientation,
      {{"quaternion", OrientationFormat::kQuaternion},
       {"matrix", OrientationFormat::kMatrix},
       {"euler", OrientationFormat::kEuler}},
      "form in which the orientation is sent; a matrix shows damage best, Euler angles hide it");
  v.option("magnetic_field", o.magnetic_field, "the device sends it");
  v.option("temperature", o.temperature, "the device sends it");
  v.choice("start_reset", o.start_reset,
           {{"none", StartReset::kNone},
            {"heading", StartReset::kHeading},
            {"object", StartReset::kObject},
            {"align", StartReset::kAlign}},
           "reset of the orientation when measuring begins for the first time");
  v.option("filter_gain_hz", o.filter_gain_hz, Bounds{0.01, 50.0}, "Hz",
           "gain of the device's orientation filter, where it has one");
  v.option("filter_weighting", o.filter_weighting, Bounds{0.0, 10.0}, "",
           "weighting of the magnetometer in that filter");
  v.option("configure", o.configure, "false: take the stream as the device is set");
  v.option("answer_timeout_s", o.answer_timeout_s, Bounds{0.02, 10.0}, "s",
           "wait for an answer before the request is repeated");
  v.option("silence_timeout_s", o.silence_timeout_s, Bounds{0.1, 60.0}, "s",
           "without a sample for so long the device counts as gone");
  v.option("retry_min_s", o.retry_min_s, Bounds{0.01, 60.0}, "s",
           "between attempts to open the port, doubled up to retry_max_s");
  v.option("retry_max_s", o.retry_max_s, Bounds{0.01, 600.0}, "s",
           "longest time between attempts to open the port");
  v.option(
      "extra_latency_s", o.extra_latency_s, Bounds{0.0, 0.1}, "s",
      "latency of the adapter that protocol and baud rate do not explain; stamps are set back by "
      "it");
}

void validate(DriverOptions o) {
  // Loading the options into themselves checks every bound.
  loadOptions(dumpOptions(o), "mti", o);
  if (o.port.empty()) throw ConfigurationError("mti.port is empty; 'auto' searches");
  if (!baudRateIdentifier(o.baud_rate)) {
    std::string known;
    for (const int rate : baudRates()) known += " " + std::to_string(rate);
    throw ConfigurationError("mti.baud_rate = " + std::to_string(o.baud_rate) +
                             " is none of the device's rates:" + known);
  }
  if (o.retry_max_s < o.retry_min_s) {
    throw ConfigurationError("mti.retry_max_s = " + std::to_string(o.retry_max_s) +
                             " must not be below retry_min_s = " + std::to_string(o.retry_min_s));
  }
}

}  // namespace scanner::mti
