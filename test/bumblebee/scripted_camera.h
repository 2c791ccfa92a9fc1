#pragma once

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "bumblebee/driver_impl.h"

namespace scanner::test {

/// What a test says about a camera, and what the driver did to it. Thread-safe.
class CameraScript {
 public:
  using Frame = bumblebee::RawFrame;

  /// Both eyes 8 x 4 pixels, mono, of these grey values.
  static Frame frame(std::uint64_t counter, int left = 90, int right = 90) {
    auto bytes = std::make_shared<std::vector<std::uint8_t>>(64);
    for (std::size_t i = 0; i < bytes->size(); ++i) {
      (*bytes)[i] = static_cast<std::uint8_t>(i % 2 == 0 ? left : right);
    }
    Frame frame;
    frame.bytes = std::move(bytes);
    frame.counter = counter;
    frame.counter_max = 65535;
    frame.counter_first = 1;
    frame.arrival = Time(
        std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch()));
    return frame;
  }

  /// The next answer of grab(): a frame, or why there is none. Given whatever camera is open.
  void give(Result<Frame> answer) {
    edit([&] { answers_.push_back(std::move(answer)); });
  }
  template <typename Edit>
  void edit(const Edit& change) {
    {
      const std::lock_guard<std::mutex> lock(mutex);
      change();
    }
    wake.notify_all();
  }
  template <typename Read>
  auto read(const Read& value) {
    const std::lock_guard<std::mutex> lock(mutex);
    return value();
  }

  std::mutex mutex;
  std::condition_variable wake;
  // What the test wants; guarded by mutex.
  Status open, configure, start, set;
  std::vector<bumblebee::CameraIdentity> listed;
  bumblebee::Capabilities capabilities;
  // What happened; guarded by mutex.
  bumblebee::Controls controls;
  std::vector<std::pair<bumblebee::Transport, std::string>> opened;
  int alive = 0;
  int set_calls = 0;

  bumblebee::CameraBus bus();

 private:
  friend class ScriptedCamera;
  std::deque<Result<Frame>> answers_;
};

class ScriptedCamera : public bumblebee::StereoCamera {
 public:
  explicit ScriptedCamera(CameraScript& script) : script_(script) {
    script_.edit([this] { ++script_.alive; });
  }
  ~ScriptedCamera() override {
    script_.edit([this] { --script_.alive; });
  }
  ScriptedCamera(const ScriptedCamera&) = delete;
  ScriptedCamera& operator=(const ScriptedCamera&) = delete;

  bumblebee::CameraIdentity identity() const override {
    bumblebee::CameraIdentity identity;
    identity.serial = "12345";
    identity.vendor = "Aravis";  // no wire, no latency
    return identity;
  }
  bumblebee::Capabilities capabilities() const override {
    return script_.read([this] { return script_.capabilities; });
  }
  Result<bumblebee::FrameFormat> configure(int, int, const bumblebee::Controls& controls) override {
    const Status status = script_.read([this] { return script_.configure; });
    if (!status) return status;
    script_.edit([&] { merge(controls); });
    bumblebee::FrameFormat format;
    format.width_px = 8;
    format.height_px = 4;
    format.pixels = PixelFormat::kMono8;
    return format;
  }
  Status start() override {
    return script_.read([this] { return script_.start; });
  }
  Result<bumblebee::RawFrame> grab(Duration timeout) override {
    std::unique_lock<std::mutex> lock(script_.mutex);
    if (!script_.wake.wait_for(lock, timeout, [this] { return !script_.answers_.empty(); })) {
      return Status(StatusCode::kOutOfRange, "no frame in time");
    }
    Result<bumblebee::RawFrame> answer = std::move(script_.answers_.front());
    script_.answers_.pop_front();
    return answer;
  }
  void stop() override {}
  Status setControls(const bumblebee::Controls& controls) override {
    script_.edit([&] {
      ++script_.set_calls;
      if (script_.set) merge(controls);
    });
    return script_.read([this] { return script_.set; });
  }
  Result<bumblebee::Controls> controls() const override {
    return script_.read([this] { return script_.controls; });
  }
  Result<std::uint32_t> readRegister(std::uint64_t offset) const override {
    return static_cast<std::uint32_t>(offset);
  }
  Status writeRegister(std::uint64_t, std::uint32_t) override { return Status::ok(); }
  bumblebee::TransportStatistics statistics() const override { return {}; }

 private:
  /// Takes settings as a camera does: exposures in steps of 10 us, gains in whole dB.
  void merge(const bumblebee::Controls& c) {
    if (c.exposure_s) script_.controls.exposure_s = std::round(*c.exposure_s * 1e5) * 1e-5;
    if (c.gain_db) script_.controls.gain_db = std::round(*c.gain_db);
    if (c.rate_hz) script_.controls.rate_hz = c.rate_hz;
  }

  CameraScript& script_;
};

inline bumblebee::CameraBus CameraScript::bus() {
  return {
      [this](bumblebee::Transport transport) {
        std::vector<bumblebee::CameraIdentity> found;
        read([&] {
          for (const auto& camera : listed) {
            if (camera.transport == transport) found.push_back(camera);
          }
        });
        return found;
      },
      [this](
          bumblebee::Transport transport, const std::string& address,
          const bumblebee::TransportOptions&) -> Result<std::unique_ptr<bumblebee::StereoCamera>> {
        Status status;
        edit([&] {
          opened.emplace_back(transport, address);
          status = open;
        });
        if (!status) return status;
        return std::unique_ptr<bumblebee::StereoCamera>(std::make_unique<ScriptedCamera>(*this));
      }};
}

}  // namespace scanner::test
