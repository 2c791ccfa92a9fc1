#include "bumblebee/driver_impl.h"
#include "scanner/bumblebee/driver.h"

#include <nlohmann/json.hpp>
#include <string>

namespace scanner::bumblebee {

void describe(OptionVisitor& v, TransportOptions& o) {
  v.option("buffers", o.buffers, {2, 256}, "", "frames that the transport keeps queued");
  v.option("packet_bytes", o.packet_bytes, {0, 65536}, "B",
           "packets of GigE Vision; 0: the largest that gets through");
  v.option("iso_speed_mbps", o.iso_speed_mbps, {100, 800}, "Mbit/s",
           "speed of the IEEE 1394 bus: 100, 200, 400 or 800");
  v.choice<EyeOrder>("eye_order", o.eye_order,
                     {{"auto", EyeOrder::kAuto},
                      {"left_first", EyeOrder::kLeftFirst},
                      {"right_first", EyeOrder::kRightFirst}},
                     "IIDC cameras: which byte of a sample is the left eye's (docs/drivers.md)");
  v.option("file_rate_hz", o.file_rate_hz, {0.01, 1000.0}, "Hz",
           "transport file: pairs per second that a folder of pictures is played at");
  v.option("file_repeat", o.file_repeat, "transport file: begin anew at the end of the folder");
}

void describe(OptionVisitor& v, DriverOptions& o) {
  v.choice<TransportChoice>("transport", o.transport,
                            {{"auto", TransportChoice::kAuto},
                             {"aravis", TransportChoice::kAravis},
                             {"usb", TransportChoice::kUsb},
                             {"dc1394", TransportChoice::kDc1394},
                             {"file", TransportChoice::kFile}},
                            "bus of the camera; auto: the first of aravis, usb and dc1394 that has "
                            "one; file: a folder of pictures");
  v.option("address", o.address,
           "serial number, or the address that --list prints; of transport file: the folder; "
           "empty: the first camera that is found");
  v.option("width_px", o.width_px, {0, 16384}, "px", "of one eye; 0: the largest");
  v.option("height_px", o.height_px, {0, 16384}, "px", "of one eye; 0: the largest");
  v.option("rate_hz", o.rate_hz, {0.01, 1000.0}, "Hz", "pairs per second");
  v.option("auto_exposure", o.auto_exposure,
           "one exposure and gain for both eyes, from the pictures of both");
  v.option("exposure_s", o.exposure_s, {1e-6, 10.0}, "s",
           "when not automatic; automatic exposure begins with it");
  v.option("gain_db", o.gain_db, {-20.0, 60.0}, "dB",
           "when not automatic; automatic exposure begins with it");
  v.option("auto_exposure_max_s", o.auto_exposure_max_s, {1e-6, 10.0}, "s",
           "automatic exposure raises the gain instead of exposing longer: motion blur");
  v.option("auto_target", o.auto_target, {0.02, 0.9}, "",
           "automatic exposure: mean of both eyes, share of full scale, linear");
  v.option("white_balance_blue", o.white_balance_blue, {0.0, 1e6}, "",
           "in the unit of the camera; 0: left as it is");
  v.option("white_balance_red", o.white_balance_red, {0.0, 1e6}, "",
           "in the unit of the camera; 0: left as it is");
  v.group("bus", o.bus, "transport");
  v.option("latency_s", o.latency_s, {-1.0, 1.0}, "s",
           "from the end of the exposure to the arrival of a frame that nothing delays: subtracted "
           "from stamps; negative: computed from the speed of the bus");
  v.option("frame_timeout_s", o.frame_timeout_s, {0.1, 60.0}, "s",
           "without a frame for this and two periods the camera counts as gone");
  v.option("retry_min_s", o.retry_min_s, {0.01, 60.0}, "s",
           "first wait before a camera is searched for again; doubles every time");
  v.option("retry_max_s", o.retry_max_s, {0.01, 600.0}, "s", "longest such wait");
}

void validate(const DriverOptions& options) {
  DriverOptions checked;
  loadOptions(dumpOptions(options), "bumblebee", checked);
  const int speed = options.bus.iso_speed_mbps;
  if (speed != 100 && speed != 200 && speed != 400 && speed != 800) {
    throw ConfigurationError("bumblebee.bus.iso_speed_mbps = " + std::to_string(speed) +
                             " is not 100, 200, 400 or 800");
  }
  if (options.retry_max_s < options.retry_min_s) {
    throw ConfigurationError("bumblebee.retry_max_s is less than bumblebee.retry_min_s");
  }
  if (options.transport == TransportChoice::kFile && options.address.empty()) {
    throw ConfigurationError("bumblebee.address: transport file needs the folder of the pictures");
  }
}

}  // namespace scanner::bumblebee
