#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "bumblebee/frame_clock.h"
#include "bumblebee/frame_counter.h"
#include "bumblebee/rate_meter.h"
#include "scanner/bumblebee/decode.h"
#include "scanner/bumblebee/driver.h"
#include "scanner/bumblebee/exposure.h"

namespace scanner::bumblebee {

/// How a driver reaches cameras; another one takes its place where the state machine is tested.
struct CameraBus {
  std::function<std::vector<CameraIdentity>(Transport)> list;
  std::function<Result<std::unique_ptr<StereoCamera>>(Transport, const std::string& address,
                                                      const TransportOptions&)>
      open;
  static CameraBus system();
};

/// Throws ConfigurationError naming the option, its value and its bounds.
void validate(const DriverOptions& options);

/// What Driver is made of.
class DriverCore {
 public:
  DriverCore(const DriverOptions& options, Driver::Callback callback, CameraBus bus);
  ~DriverCore();
  DriverCore(const DriverCore&) = delete;
  DriverCore& operator=(const DriverCore&) = delete;

  Status reconfigure(const DriverOptions& options);
  Result<std::uint32_t> readRegister(std::uint64_t offset);
  Status writeRegister(std::uint64_t offset, std::uint32_t value);
  DriverStatistics statistics() const;

 private:
  using Steady = std::chrono::steady_clock;

  // The state machine, in driver.cpp. All of these run in the driver's thread.
  void run();
  Status session();
  bool wait(double seconds);
  void enter(DriverState state, const std::string& problem);
  Status stream();
  Status silence(Steady::time_point now, const Status& last_damage) const;
  Status take(const RawFrame& frame);
  void streamingBegins();
  void countDamaged();
  void publish(DecodedPair pair, const RawFrame& frame, std::uint64_t advance);
  void lookAround(Steady::time_point now);

  // Finding a camera and setting it up, in driver_connect.cpp.
  Result<std::unique_ptr<StereoCamera>> search();
  Result<std::unique_ptr<StereoCamera>> openOn(Transport transport);
  Status connect(std::unique_ptr<StereoCamera> camera);
  void readFactoryCalibration(const StereoCamera& camera, const CameraIdentity& identity);
  void disconnect();

  // Controls, in driver_controls.cpp. Those with `camera` hold access_.
  DriverOptions options() const;
  Controls wantedControls(const DriverOptions& options, const Capabilities& capabilities,
                          std::string& refused);
  Status applyOptions(StereoCamera& camera);
  void readBack(StereoCamera& camera);
  void meter(const DecodedPair& pair);
  void setUpMetering(const DriverOptions& options, const Capabilities& capabilities);

  const CameraBus bus_;
  const Driver::Callback callback_;

  /// Held by whoever asks the camera anything but frames, and while it comes and goes; taken
  /// before mutex_.
  std::mutex access_;
  std::unique_ptr<StereoCamera> camera_;
  std::optional<AutoExposure> metering_;  ///< guarded by access_; nothing: manual

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;
  DriverOptions options_;
  DriverStatistics statistics_;
  std::string refused_;       ///< settings that the camera did not take as asked
  ExposureSetting in_force_;  ///< as read back from the camera
  double applied_rate_hz_ = 0.0;
  RateMeter meter_;
  std::uint64_t lost_packets_before_ = 0;  ///< of earlier connections

  // Of the driver's thread only.
  FrameFormat format_;
  FrameCounter counter_;
  FrameClock clock_;
  bool streaming_ = false;
  std::uint64_t number_ = 0;
  std::uint64_t damaged_since_ = 0;  ///< frames since the last whole one
  Steady::time_point last_frame_, last_whole_, last_look_;
  double retry_s_ = 0.0;
  std::string calibration_serial_;  ///< of the camera that factory_calibration was read from

  std::thread thread_;  ///< last: everything else exists when it starts
};

class Driver::Impl : public DriverCore {
 public:
  using DriverCore::DriverCore;
};

}  // namespace scanner::bumblebee
