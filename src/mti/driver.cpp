#include "scanner/mti/driver.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <utility>

#include "mti/device.h"
#include "mti/discovery.h"
#include "mti/driver_options.h"
#include "mti/measurement.h"

namespace scanner::mti {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kLookAroundS = 0.05;  ///< between looks at requests while no messages come
constexpr int kResetAttempts = 4;
constexpr const char* kAutomatic = "auto";

std::chrono::nanoseconds inNanoseconds(double seconds) {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * seconds));
}

std::string joined(const std::vector<std::string>& lines) {
  std::string all;
  for (const std::string& line : lines) all += (all.empty() ? "" : "; ") + line;
  return all;
}

std::optional<OrientationReset> resetOf(StartReset reset) {
  switch (reset) {
    case StartReset::kNone:
      return std::nullopt;
    case StartReset::kHeading:
      return OrientationReset::kHeading;
    case StartReset::kObject:
      return OrientationReset::kObject;
    case StartReset::kAlign:
      return OrientationReset::kAlign;
  }
  return std::nullopt;
}

/// One call of resetOrientation(), from one thread to the other.
struct ResetRequest {
  OrientationReset reset = OrientationReset::kHeading;
  bool done = false;
  Status outcome;
  int attempts = 0;
  Clock::time_point deadline;  ///< of the attempt under way
};

}  // namespace

const char* toString(DriverState state) {
  switch (state) {
    case DriverState::kSearching:
      return "searching";
    case DriverState::kConfiguring:
      return "configuring";
    case DriverState::kMeasuring:
      return "measuring";
    case DriverState::kStopped:
      return "stopped";
  }
  return "unknown";
}

class Driver::Impl {
 public:
  Impl(const DriverOptions& options, Callback callback)
      : options_(options),
        callback_(std::move(callback)),
        measurement_(options.extra_latency_s),
        start_reset_(resetOf(options.start_reset)) {
    validate(options);
    statistics_.state = DriverState::kSearching;
    thread_ = std::thread([this] { run(); });
  }
  ~Impl() {
    stop_.ring();
    thread_.join();
  }

  Status resetOrientation(OrientationReset reset);
  DriverStatistics statistics() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return statistics_;
  }

 private:
  using Request = std::shared_ptr<ResetRequest>;

  void run();
  Status search();
  Status session(const std::string& path);
  Status prepare(Device& device);
  Status measure(Device& device);
  void publish(Device& device);
  Status serveResets(Device& device);
  Status store(Device& device);
  bool takesAnswer(Device& device, const Message& message);
  void finishReset(const Status& outcome);
  void abandonResets(const std::string& why);
  void enter(DriverState state, const std::string& problem);
  void keepLineCounts(Device& device);

  const DriverOptions options_;
  const Callback callback_;
  WakeUpCall stop_;

  // The thread's own.
  Measurement measurement_;
  std::optional<OrientationReset> start_reset_;
  int last_baud_rate_ = 0;
  std::string stubborn_device_;  ///< does not go to the wanted baud rate
  bool measured_ = false;        ///< samples came within the present session
  bool port_missing_ = false;
  std::uint64_t checksum_errors_ = 0;  ///< of connections that ended
  std::uint64_t skipped_bytes_ = 0;
  Request reset_under_way_;

  mutable std::mutex mutex_;
  std::condition_variable reset_done_;
  std::deque<Request> resets_;
  DriverStatistics statistics_;

  std::thread thread_;
};

void Driver::Impl::run() {
  double pause_s = options_.retry_min_s;
  while (!stop_.wait(0.0)) {
    measured_ = false;
    const Status why = search();
    enter(DriverState::kSearching, why.message());
    abandonResets(why.message());
    // A port that is not there costs nothing to look for.
    if (measured_ || port_missing_) pause_s = options_.retry_min_s;
    if (stop_.wait(pause_s)) break;
    pause_s = std::min(2.0 * pause_s, options_.retry_max_s);
  }
  enter(DriverState::kStopped, "");
  abandonResets("the driver has stopped");
}

/// One round over the ports; returns why measuring ended or did not begin.
Status Driver::Impl::search() {
  port_missing_ = false;
  if (options_.port != kAutomatic) {
    std::error_code error;
    port_missing_ = !std::filesystem::exists(options_.port, error);
    return session(options_.port);
  }
  Status status(StatusCode::kIoError, "no USB serial adapter is plugged in");
  port_missing_ = true;
  for (const Port& port : findPorts()) {
    if (port.kind == Port::Kind::kBuiltIn) break;
    port_missing_ = false;
    status = session(port.path);
    if (measured_ || stop_.wait(0.0)) break;
  }
  return status;
}

Status Driver::Impl::session(const std::string& path) {
  SerialPort::Options line;
  line.baud_rate = last_baud_rate_ > 0 ? last_baud_rate_ : line.baud_rate;
  line.two_stop_bits = options_.two_stop_bits;
  line.low_latency = options_.low_latency;
  Result<SerialPort> port = SerialPort::open(path, line, &stop_);
  if (!port) return port.status();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    statistics_.port = path;
  }
  Device device(std::move(*port), options_, stop_);
  Status status = device.find(last_baud_rate_);
  if (!status) {
    keepLineCounts(device);
    return {status.code(), path + ": " + status.message()};
  }
  last_baud_rate_ = device.baudRate();
  enter(DriverState::kConfiguring, statistics().problem);
  status = prepare(device);
  if (status) status = measure(device);
  keepLineCounts(device);
  return {status.code(), path + ": " + status.message()};
}

Status Driver::Impl::prepare(Device& device) {
  if (const Status status = device.identify(); !status) return status;
  if (options_.configure && device.deviceId() != stubborn_device_) {
    const Status status = device.negotiateBaudRate();
    if (device.baudRateRefused()) stubborn_device_ = device.deviceId();
    if (!status) return status;
    last_baud_rate_ = device.baudRate();
  }
  if (const Status status = device.configure(); !status) return status;
  std::vector<std::string> notes = device.notes();
  if (!device.output().counter) {
    notes.emplace_back("the device sends no sample counter: stamps are those of arrival");
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  statistics_.device_id = device.deviceId();
  statistics_.firmware = device.firmware();
  statistics_.protocol = device.isMtData2() ? "MTData2" : "MTData";
  statistics_.baud_rate = device.baudRate();
  statistics_.notes = joined(notes);
  return Status::ok();
}

Status Driver::Impl::measure(Device& device) {
  if (const Status status = device.goToMeasurement(); !status) return status;
  measurement_.begin(device.output());
  Clock::time_point last_good = Clock::now();
  std::optional<Time> last_arrival;
  while (!stop_.wait(0.0)) {
    const auto incoming = device.stream().next(kLookAroundS);
    if (!incoming) {
      measurement_.flush();
      publish(device);
      return incoming.status();
    }
    if (*incoming) {
      const Message& message = (**incoming).message;
      if (message.is(MessageId::kWakeUp)) {
        device.stream().send(request(MessageId::kWakeUpAck));
        return {StatusCode::kIoError, "the device has started anew"};
      }
      if (!takesAnswer(device, message)) measurement_.push(**incoming);
      publish(device);
    }
    if (measurement_.lastArrival() != last_arrival) {
      last_arrival = measurement_.lastArrival();
      last_good = Clock::now();
    } else if (Clock::now() - last_good > inNanoseconds(options_.silence_timeout_s)) {
      measurement_.flush();
      publish(device);
      return {StatusCode::kIoError, "no data any more"};
    }
    if (const Status status = serveResets(device); !status) return status;
    if (!measurement_.lastArrival()) last_arrival.reset();
  }
  return {StatusCode::kIoError, "stopped"};
}

void Driver::Impl::publish(Device& device) {
  bool any = false;
  while (const std::optional<Sample> sample = measurement_.next()) {
    any = true;
    callback_(*sample);
  }
  const Measurement::Statistics measured = measurement_.statistics();
  const MessageParser::Statistics& line = device.stream().statistics();
  const std::lock_guard<std::mutex> lock(mutex_);
  statistics_.samples = measured.samples;
  statistics_.lost = measured.lost;
  statistics_.rejected = measured.rejected;
  statistics_.rate_hz = measured.rate_hz;
  statistics_.drift_ppm = measured.drift_ppm;
  statistics_.arrival_jitter_s = measured.arrival_jitter_s;
  statistics_.checksum_errors = checksum_errors_ + line.checksum_errors;
  statistics_.skipped_bytes = skipped_bytes_ + line.skipped_bytes;
  if (any && !measured_) {
    measured_ = true;
    ++statistics_.connections;
    statistics_.state = DriverState::kMeasuring;
    statistics_.problem.clear();
    if (start_reset_) {
      resets_.push_back(std::make_shared<ResetRequest>());
      resets_.back()->reset = *start_reset_;
      start_reset_.reset();
    }
  }
}

void Driver::Impl::keepLineCounts(Device& device) {
  checksum_errors_ += device.stream().statistics().checksum_errors;
  skipped_bytes_ += device.stream().statistics().skipped_bytes;
}

void Driver::Impl::enter(DriverState state, const std::string& problem) {
  const std::lock_guard<std::mutex> lock(mutex_);
  statistics_.state = state;
  statistics_.problem = problem;
  statistics_.rate_hz = 0.0;
}

// ---- resets of the orientation ---------------------------------------------------------------

Status Driver::Impl::resetOrientation(OrientationReset reset) {
  if (std::this_thread::get_id() == thread_.get_id()) {
    return {StatusCode::kInvalidInput, "resetOrientation() cannot wait within the callback"};
  }
  const auto request = std::make_shared<ResetRequest>();
  request->reset = reset;
  std::unique_lock<std::mutex> lock(mutex_);
  if (statistics_.state != DriverState::kMeasuring) {
    return {StatusCode::kOutOfRange,
            "no MTi is measuring: " +
                (statistics_.problem.empty() ? toString(statistics_.state) : statistics_.problem)};
  }
  resets_.push_back(request);
  // The thread always gives an outcome: each attempt ends in time, and so does the session.
  reset_done_.wait(lock, [&request] { return request->done; });
  return request->outcome;
}

/// Sends what was asked for, and again when no answer came.
Status Driver::Impl::serveResets(Device& device) {
  if (!reset_under_way_) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (resets_.empty()) return Status::ok();
    reset_under_way_ = resets_.front();
    resets_.pop_front();
  } else if (Clock::now() < reset_under_way_->deadline) {
    return Status::ok();
  }
  ResetRequest& request = *reset_under_way_;
  if (request.reset == OrientationReset::kStore) return store(device);
  if (request.attempts++ == kResetAttempts) {
    finishReset({StatusCode::kIoError, "the device does not answer the reset"});
    return Status::ok();
  }
  request.deadline = Clock::now() + inNanoseconds(options_.answer_timeout_s);
  return device.stream().send(mti::resetOrientation(request.reset));
}

/// Storing is allowed in configuration only.
Status Driver::Impl::store(Device& device) {
  measurement_.flush();
  publish(device);
  Status status = device.goToConfig();
  if (status) {
    const Status stored = device.reset(OrientationReset::kStore);
    const bool refused = stored.code() == StatusCode::kUnsupported;
    finishReset(refused ? Status(StatusCode::kInvalidInput, stored.message()) : stored);
    status = device.goToMeasurement();
  }
  measurement_.begin(device.output());
  return status;
}

/// Whether the message is the outcome of the reset under way.
bool Driver::Impl::takesAnswer(Device& device, const Message& message) {
  if (!reset_under_way_) return false;
  switch (answerKind(message, MessageId::kResetOrientation)) {
    case AnswerKind::kAcknowledgement:
      measurement_.flush();
      publish(device);
      measurement_.expectJump();
      finishReset(Status::ok());
      return true;
    case AnswerKind::kError: {
      const Result<ErrorCode> code = parseError(message);
      finishReset({StatusCode::kInvalidInput,
                   "the MTi refuses the reset: " + (code ? describe(*code) : "unknown error")});
      return true;
    }
    case AnswerKind::kOther:
      return false;
  }
  return false;
}

void Driver::Impl::finishReset(const Status& outcome) {
  const std::lock_guard<std::mutex> lock(mutex_);
  reset_under_way_->outcome = outcome;
  reset_under_way_->done = true;
  reset_under_way_.reset();
  reset_done_.notify_all();
}

void Driver::Impl::abandonResets(const std::string& why) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (reset_under_way_) resets_.push_back(std::move(reset_under_way_));
  reset_under_way_.reset();
  for (const Request& request : resets_) {
    request->outcome = Status(StatusCode::kIoError, "the reset was interrupted: " + why);
    request->done = true;
  }
  resets_.clear();
  reset_done_.notify_all();
}

Driver::Driver(const DriverOptions& options, Callback callback)
    : impl_(std::make_unique<Impl>(options, std::move(callback))) {}
Driver::~Driver() = default;
Status Driver::resetOrientation(OrientationReset reset) { return impl_->resetOrientation(reset); }
DriverStatistics Driver::statistics() const { return impl_->statistics(); }

}  // namespace scanner::mti
