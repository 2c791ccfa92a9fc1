#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <vector>

#include "scanner/mti/message.h"
#include "scanner/mti/mt_data.h"
#include "simulation/mti_track.h"

namespace scanner::simulation {

/// Everything a host can set. The factory settings are those of MT0100P: orientation as quaternion
/// with the sample counter, 100 Hz, 115200 baud.
struct MtiSettings {
  std::uint16_t period = 1152;  ///< 1/115200 s
  std::uint16_t skip_factor = 0;
  std::uint16_t mode = mti::output_mode::kOrientation;
  std::uint32_t settings = mti::output_settings::kSampleCounter;
  std::uint8_t baud_rate = 0x02;  ///< identifier, see mtiBaudRate()
  std::uint16_t error_mode = 1;
  double heading = 0.0;  ///< rad, as SetHeading gave it or a heading reset chose it
  Eigen::Quaterniond earth = Eigen::Quaterniond::Identity();   ///< R_G'G, redefined earth frame
  Eigen::Quaterniond object = Eigen::Quaterniond::Identity();  ///< R_OS, object alignment
};

/// Bits per second of SetBaudrate's identifier; 0 when there is no such identifier.
int mtiBaudRate(std::uint8_t identifier);

/// The protocol of a legacy MTi without threads, clocks and terminals: bytes in, messages with the
/// time at which they are ready out. All times are seconds on the caller's clock, which must not
/// go back.
///
/// States: wake-up (after power-on: WakeUp is sent, and a WakeUpAck within half a second leads to
/// config, else measurement follows), config, measurement. Settings are refused outside of config
/// (Error 4), but for GoToConfig, Reset, ReqData and the resets of the orientation. Set requests
/// without data ask for the value. What is set in config is kept without power; the effect of a
/// reset of the orientation is kept when it was stored (code 0). A new baud rate holds from the
/// next power-on or Reset; public drivers disagree about that, so a driver must be ready for both.
///
/// Frames: S sensor, O object (object = R_OS), G earth of the device: north-west-up; samples are in
/// ENU, so R_GS = Rz(-90 deg) R_ENU_S. The orientation that is sent is R_G'G R_GS R_OS^T and the
/// calibrated data are R_OS s (MT0100P 4.6.2). Resets, from the orientation at that moment:
///   heading  R_G'G is the rotation about the vertical that brings the x axis of O over the x axis
///            of the earth;
///   global   R_G'G makes the current orientation the identity;
///   object   R_OS levels O: z up, x the horizontal direction of the sensor's x axis;
///   align    object, then heading.
class MtiState {
 public:
  struct Outgoing {
    mti::Message message;
    double ready_s = 0.0;
    int baud = 0;  ///< in force when it was made
  };

  /// `clock_ppm`: the device's clock runs that much faster than the caller's.
  MtiState(std::uint32_t device_id, double clock_ppm, MtiTrack track);

  void powerOn(double now_s);
  /// Time 0 of the track; before it the device stands at the first sample.
  void start(double zero_s) { zero_s_ = zero_s; }
  void receive(const std::vector<std::uint8_t>& bytes, double now_s);
  /// Does what is due by now: end of the wake-up, samples.
  void advance(double now_s);
  /// When advance() is needed next; infinity when nothing will happen by itself.
  double nextEvent() const;
  /// What was made since the last call, in order.
  std::vector<Outgoing> takeOutgoing();

  /// Every request is answered with an Error.
  void setAnswerErrors(bool on) { answer_errors_ = on; }
  int baudRate() const { return mtiBaudRate(active_baud_rate_); }
  /// Interval of samples on the caller's clock.
  double samplePeriod() const;
  std::uint64_t requests() const { return requests_; }
  std::uint64_t badRequests() const { return bad_requests_ + parser_.statistics().checksum_errors; }

 private:
  enum class State { kWakeUp, kConfig, kMeasurement };

  void handle(const mti::Message& message, double now_s);
  bool handleAnywhere(const mti::Message& message, double now_s);
  void handleInConfig(const mti::Message& message, double now_s);
  void setHeading(const mti::Message& message, double now_s);
  void setObjectAlignment(const mti::Message& message, double now_s);
  void resetOrientation(const mti::Message& message, double now_s);
  void sendLatest(const mti::Message& message, double now_s);
  void sendConfiguration(double now_s);
  template <typename T, typename Accept>
  void setNumber(const mti::Message& message, T MtiSettings::*field, Accept accept, double now_s,
                 mti::ErrorCode refusal = mti::ErrorCode::kParameter);
  template <typename T>
  void keep(T MtiSettings::*field, const T& value);

  void goToMeasurement(double now_s);
  void sendSample(std::uint64_t index);
  mti::MtData measure(double time_s);
  MtiReading readingAt(double time_s) const;
  Eigen::Quaterniond sensorInEarth(double time_s) const;
  double sampleTime(std::uint64_t index) const;
  void send(mti::MessageId id, std::vector<std::uint8_t> data, double ready_s);
  void acknowledge(const mti::Message& message, std::vector<std::uint8_t> data, double now_s);
  void refuse(mti::ErrorCode code, double now_s);

  std::uint32_t device_id_;
  double clock_ppm_;
  MtiTrack track_;
  double zero_s_;  ///< infinity until start()
  State state_ = State::kWakeUp;
  MtiSettings stored_, active_;
  std::uint8_t active_baud_rate_ = MtiSettings().baud_rate;
  double wake_up_end_s_ = 0.0;
  double measurement_start_s_ = 0.0;
  std::uint64_t next_sample_ = 0;
  std::uint16_t counter_ = 0;
  bool answer_errors_ = false;
  mti::MessageParser parser_;
  std::vector<Outgoing> outgoing_;
  std::uint64_t requests_ = 0;
  std::uint64_t bad_requests_ = 0;
};

}  // namespace scanner::simulation
