#include "scanner/bumblebee/driver.h"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <utility>

#include "bumblebee/driver_impl.h"
#include "bumblebee/file_transport.h"

namespace scanner::bumblebee {
namespace {

constexpr Duration kGrabTime = std::chrono::milliseconds(100);  ///< a stop waits no longer
constexpr std::chrono::seconds kLookInterval{1};  ///< temperature, counters of the transport
constexpr double kHopeless = 3.0;  ///< times the patience for silence: only damaged frames
constexpr double kSpareSteps = 50.0;

double secondsBetween(std::chrono::steady_clock::time_point a,
                      std::chrono::steady_clock::time_point b) {
  return std::chrono::duration<double>(b - a).count();
}

std::string inSeconds(double seconds) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f s", seconds);
  return text;
}

bool isEndOfRecording(const Status& status) {
  return status.code() == StatusCode::kIoError &&
         status.message().compare(0, sizeof(kEndOfRecording) - 1, kEndOfRecording) == 0;
}

}  // namespace

const char* toString(DriverState state) {
  switch (state) {
    case DriverState::kSearching:
      return "searching";
    case DriverState::kConfiguring:
      return "configuring";
    case DriverState::kStreaming:
      return "streaming";
    case DriverState::kStopped:
      return "stopped";
  }
  return "unknown";
}

DriverCore::DriverCore(const DriverOptions& options, Driver::Callback callback, CameraBus bus)
    : bus_(std::move(bus)), callback_(std::move(callback)), options_(options) {
  validate(options);
  if (!callback_) throw ConfigurationError("bumblebee: a callback for the pairs is needed");
  retry_s_ = options.retry_min_s;
  in_force_ = {options.exposure_s, options.gain_db};
  statistics_.state = DriverState::kSearching;
  thread_ = std::thread([this] { run(); });
}

DriverCore::~DriverCore() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

/// False when the driver is to stop.
bool DriverCore::wait(double seconds) {
  std::unique_lock<std::mutex> lock(mutex_);
  return !wake_.wait_for(lock, std::chrono::duration<double>(seconds),
                         [this] { return stopping_; });
}

void DriverCore::enter(DriverState state, const std::string& problem) {
  const std::lock_guard<std::mutex> lock(mutex_);
  statistics_.state = state;
  if (!problem.empty()) statistics_.problem = problem;
}

void DriverCore::run() {
  while (wait(0.0)) {
    enter(DriverState::kSearching, "");
    Status end;
    try {
      end = session();
    } catch (const std::exception& error) {  // of the callback or of a library
      end = Status(StatusCode::kIoError, error.what());
    }
    disconnect();
    if (end) break;  // told to stop
    if (isEndOfRecording(end)) {
      enter(DriverState::kStopped, end.message());
      return;
    }
    enter(DriverState::kSearching, end.message());
    const DriverOptions now = options();
    const double pause = std::clamp(retry_s_, now.retry_min_s, now.retry_max_s);
    retry_s_ = 2.0 * pause;
    if (!wait(pause)) break;
  }
  enter(DriverState::kStopped, "");
}

/// One camera from the search until it fails; ok when the driver is to stop.
Status DriverCore::session() {
  Result<std::unique_ptr<StereoCamera>> camera = search();
  if (!camera) return camera.status();
  enter(DriverState::kConfiguring, "");
  if (Status status = connect(std::move(*camera)); !status) return status;
  return stream();
}

Status DriverCore::stream() {
  streaming_ = false;
  damaged_since_ = 0;
  counter_.restart();
  last_frame_ = last_whole_ = Steady::now();
  last_look_ = last_frame_ - kLookInterval;
  Status last_damage;
  while (wait(0.0)) {
    const Result<RawFrame> frame = camera_->grab(kGrabTime);
    const Steady::time_point now = Steady::now();
    if (frame) {
      last_frame_ = now;
      const Status status = take(*frame);
      if (status) {
        last_whole_ = now;
      } else {
        last_damage = status;
        countDamaged();
      }
    } else if (frame.status().code() != StatusCode::kOutOfRange) {
      return frame.status();
    }
    if (Status status = silence(now, last_damage); !status) return status;
    if (now - last_look_ >= kLookInterval) lookAround(now);
  }
  return Status::ok();
}

/// Not ok when it is time to give the camera up.
Status DriverCore::silence(Steady::time_point now, const Status& last_damage) const {
  double patience = 0.0;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    patience = options_.frame_timeout_s + 2.0 / applied_rate_hz_;
  }
  const double silent = secondsBetween(last_frame_, now);
  if (silent > patience) {
    return {StatusCode::kIoError, "the camera is silent: no frame for " + inSeconds(silent)};
  }
  const double hopeless = secondsBetween(last_whole_, now);
  if (hopeless > kHopeless * patience) {
    return {StatusCode::kIoError,
            "only damaged frames for " + inSeconds(hopeless) + ": " + last_damage.message()};
  }
  return Status::ok();
}

void DriverCore::countDamaged() {
  ++damaged_since_;
  const std::lock_guard<std::mutex> lock(mutex_);
  ++statistics_.damaged;
  ++statistics_.dropped;
}

/// Not ok for a frame that is damaged.
Status DriverCore::take(const RawFrame& frame) {
  Result<DecodedPair> pair = decodeFrame(frame, format_);
  if (!pair) return pair.status();
  std::uint64_t advance = 1 + damaged_since_;
  if (frame.counter) {
    double rate = 0.0;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      rate = applied_rate_hz_;
    }
    // More frames than the camera can have taken are no gap but a counter that was reset.
    const double elapsed = secondsBetween(last_whole_, Steady::now());
    const auto largest = static_cast<std::uint64_t>(kSpareSteps + 2.0 * rate * elapsed);
    const std::optional<std::uint64_t> step =
        counter_.step(*frame.counter, frame.counter_first, frame.counter_max, largest);
    if (!step) {
      return {StatusCode::kInvalidInput,
              "frame number " + std::to_string(*frame.counter) + " came twice"};
    }
    advance = *step;
  }
  if (!streaming_) streamingBegins();
  publish(std::move(*pair), frame, advance);
  return Status::ok();
}

void DriverCore::streamingBegins() {
  streaming_ = true;
  const std::lock_guard<std::mutex> lock(mutex_);
  retry_s_ = options_.retry_min_s;
  ++statistics_.connections;
  statistics_.state = DriverState::kStreaming;
  statistics_.problem.clear();
  meter_.clear();
}

void DriverCore::publish(DecodedPair pair, const RawFrame& frame, std::uint64_t advance) {
  number_ += advance;
  CapturedPair captured;
  captured.arrival = frame.arrival;
  captured.number = number_;
  FrameClock::Input input;
  input.advance = advance;
  input.counted = frame.counter.has_value();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    captured.exposure_s = in_force_.exposure_s;
    captured.gain_db = in_force_.gain_db;
    input.period_s = 1.0 / applied_rate_hz_;
  }
  input.exposure_s = captured.exposure_s;
  captured.frame.stamp = clock_.stamp(frame, input);
  captured.frame.left = pair.left;
  captured.frame.right = pair.right;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    DriverStatistics& s = statistics_;
    ++s.pairs;
    s.dropped += advance - 1 > damaged_since_ ? advance - 1 - damaged_since_ : 0;
    for (std::size_t eye = 0; eye < 2; ++eye) {
      s.saturated_share[eye] = pair.statistics[eye].saturated_share;
      s.mean_level[eye] = pair.statistics[eye].mean_level;
    }
    s.stamps = clock_.source();
    s.drift_ppm = clock_.driftPpm();
    s.arrival_jitter_s = clock_.arrivalJitter();
    meter_.add(Steady::now(), frame.bytes->size());
  }
  damaged_since_ = 0;
  callback_(captured);
  meter(pair);
}

/// What need not be asked for every frame.
void DriverCore::lookAround(Steady::time_point now) {
  last_look_ = now;
  const std::lock_guard<std::mutex> access(access_);
  const TransportStatistics transport = camera_->statistics();
  const std::optional<double> temperature = camera_->temperatureC();
  const std::lock_guard<std::mutex> lock(mutex_);
  statistics_.lost_packets = lost_packets_before_ + transport.lost_packets;
  statistics_.temperature_c = temperature;
}

DriverStatistics DriverCore::statistics() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  DriverStatistics s = statistics_;
  const RateMeter::Rates rates = meter_.rates(Steady::now());
  s.rate_hz = rates.frames_hz;
  s.bandwidth_Bps = rates.bytes_hz;
  s.exposure_s = in_force_.exposure_s;
  s.gain_db = in_force_.gain_db;
  if (s.problem.empty() && s.state == DriverState::kStreaming) s.problem = refused_;
  return s;
}

Driver::Driver(const DriverOptions& options, Callback callback)
    : impl_(std::make_unique<Impl>(options, std::move(callback), CameraBus::system())) {}
Driver::~Driver() = default;
Status Driver::reconfigure(const DriverOptions& options) { return impl_->reconfigure(options); }
Result<std::uint32_t> Driver::readRegister(std::uint64_t offset) {
  return impl_->readRegister(offset);
}
Status Driver::writeRegister(std::uint64_t offset, std::uint32_t value) {
  return impl_->writeRegister(offset, value);
}
DriverStatistics Driver::statistics() const { return impl_->statistics(); }

}  // namespace scanner::bumblebee
