#pragma once

#include <atomic>
#include <chrono>

#include "bumblebee/aravis_receiver.h"
#include "scanner/bumblebee/stereo_camera.h"

namespace scanner::bumblebee::aravis {

/// A GenICam camera that we control, over GigE Vision or USB3 Vision.
class Camera final : public StereoCamera {
 public:
  /// `gige_address` is empty for a camera on USB.
  Camera(Object<ArvCamera> camera, CameraIdentity identity, std::string gige_address,
         const TransportOptions& options);
  ~Camera() override;
  Camera(const Camera&) = delete;
  Camera& operator=(const Camera&) = delete;

  CameraIdentity identity() const override { return identity_; }
  Capabilities capabilities() const override { return capabilities_; }
  Result<FrameFormat> configure(int width_px, int height_px, const Controls& controls) override;
  Status start() override;
  Result<RawFrame> grab(Duration timeout) override;
  void stop() override;
  Status setControls(const Controls& controls) override;
  Result<Controls> controls() const override;
  Result<std::uint32_t> readRegister(std::uint64_t offset) const override;
  Status writeRegister(std::uint64_t offset, std::uint32_t value) override;
  std::optional<double> temperatureC() const override;
  TransportStatistics statistics() const override;

 private:
  using Clock = std::chrono::steady_clock;

  Status goneStatus() const { return {StatusCode::kIoError, receiver_->reason()}; }
  /// Notes a camera that is gone.
  Status judge(Status status) const;
  Status openStream(std::size_t payload);
  void tuneStream(std::size_t payload);
  bool stillThere() const;
  RawFrame makeFrame(Receiver::Arrival arrival);
  Status checkBuffer(const Receiver::Arrival& arrival, const std::string& name) const;
  void numberFrame(ArvBuffer* buffer, bool usable, RawFrame& frame);
  std::optional<Duration> deviceTime(ArvBuffer* buffer);

  const CameraIdentity identity_;
  const std::string gige_address_;
  const TransportOptions options_;
  const std::shared_ptr<Receiver> receiver_;
  mutable std::mutex control_mutex_;  ///< of camera_, its features, and the format
  Object<ArvCamera> camera_;
  gulong lost_handler_ = 0;
  Capabilities capabilities_;
  FrameFormat format_;  ///< 0 x 0: not configured
  Object<ArvStream> stream_;
  bool short_of_memory_ = false;  ///< what receives may lose packets while this process waits

  // Of the thread that grabs.
  Clock::time_point next_probe_;
  Clock::duration probe_interval_{};
  std::uint64_t last_id_ = Receiver::kUnknownId;
  bool extended_ids_ = false;
  bool clock_sound_ = true;
  std::uint64_t last_device_ns_ = 0;
  std::atomic<std::uint64_t> frames_{0}, incomplete_{0}, bytes_{0};
};

}  // namespace scanner::bumblebee::aravis
