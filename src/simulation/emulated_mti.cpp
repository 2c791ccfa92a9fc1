#include "scanner/simulation/emulated_mti.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <ctime>
#include <mutex>
#include <thread>

#include "scanner/simulation/random.h"
#include "simulation/mti_state.h"
#include "simulation/pseudo_terminal.h"
#include "simulation/serial_line.h"

namespace scanner::simulation {
namespace {

/// How often a terminal that nobody has open is looked at: the kernel cannot be asked to wake us
/// when it is opened.
constexpr double kOpenCheckS = 0.02;

bool isShare(double value) { return value >= 0.0 && value <= 1.0; }

/// Lets the thread out of its poll().
class WakeUpCall {
 public:
  WakeUpCall() : descriptor_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (descriptor_ < 0) throw ConfigurationError("no event descriptor can be made");
  }
  ~WakeUpCall() { ::close(descriptor_); }
  WakeUpCall(const WakeUpCall&) = delete;
  WakeUpCall& operator=(const WakeUpCall&) = delete;

  int descriptor() const { return descriptor_; }
  void ring() { ::eventfd_write(descriptor_, 1); }
  void answer() {
    eventfd_t rings = 0;
    ::eventfd_read(descriptor_, &rings);
  }

 private:
  int descriptor_;
};

}  // namespace

class EmulatedMti::Impl {
 public:
  Impl(const Options& options, std::vector<MtiSample> samples)
      : link_(options.link),
        epoch_(Clock::now()),
        state_(options.device_id, options.clock_ppm,
               MtiTrack(std::move(samples), options.still_end_s)),
        line_(options.burst_s),
        random_(static_cast<std::uint64_t>(options.seed)) {
    if (!(options.burst_s >= 0.0)) throw ConfigurationError("bursts of the MTi: a negative period");
    plug();
  }
  ~Impl() { unplug(); }

  std::string path() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return terminal_ ? terminal_->path() : link_;
  }

  void start(double delay_s) {
    const std::lock_guard<std::mutex> lock(mutex_);
    state_.start(now() + delay_s);
  }

  void setFaults(const MtiFaults& faults) {
    if (!isShare(faults.corrupt_bytes) || !isShare(faults.drop_bytes)) {
      throw ConfigurationError("faults of the MTi: shares lie within 0 .. 1");
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    faults_ = faults;
    state_.setAnswerErrors(faults.answer_errors);
  }

  void plug() {
    const std::lock_guard<std::mutex> cable(cable_mutex_);
    if (thread_.joinable()) return;
    auto terminal = std::make_unique<PseudoTerminal>(link_);
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      terminal_ = std::move(terminal);
      line_.clear();
      stop_ = false;
      open_ = false;
      state_.powerOn(now());
    }
    thread_ = std::thread([this] { run(); });
  }

  void unplug() {
    const std::lock_guard<std::mutex> cable(cable_mutex_);
    if (!thread_.joinable()) return;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stop_ = true;
    }
    wake_up_.ring();
    thread_.join();
    wake_up_.answer();
    const std::lock_guard<std::mutex> lock(mutex_);
    terminal_.reset();
  }

  Statistics statistics() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    Statistics all = statistics_;
    all.requests = state_.requests();
    all.bad_requests = state_.badRequests();
    return all;
  }

 private:
  using Clock = std::chrono::steady_clock;

  double now() const { return std::chrono::duration<double>(Clock::now() - epoch_).count(); }

  void run();
  void serve();
  void noticeHost();
  void collect();
  void deliver();
  bool garbledAt(int baud) const;
  void garble(std::vector<std::uint8_t>* bytes);
  std::vector<std::uint8_t> damage(const std::vector<std::uint8_t>& bytes);
  double deadline() const;
  void waitUntil(double time_s, bool watch_terminal);

  const std::string link_;
  const Clock::time_point epoch_;
  WakeUpCall wake_up_;
  std::mutex cable_mutex_;  ///< of thread_: one plugs or unplugs at a time; locked before mutex_
  std::thread thread_;

  mutable std::mutex mutex_;  ///< of all that follows
  bool stop_ = false;
  bool open_ = false;  ///< a host has the terminal open
  std::unique_ptr<PseudoTerminal> terminal_;
  MtiState state_;
  SerialLine line_;
  MtiFaults faults_;
  Random random_;
  Statistics statistics_;
};

void EmulatedMti::Impl::run() {
  while (true) {
    double next = 0.0;
    bool watch = false;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (stop_) return;
      serve();
      next = deadline();
      watch = open_;
    }
    waitUntil(next, watch);
  }
}

void EmulatedMti::Impl::serve() {
  noticeHost();
  std::vector<std::uint8_t> request = terminal_->read();
  if (garbledAt(state_.baudRate())) garble(&request);
  if (!request.empty() && !faults_.mute) state_.receive(request, now());
  state_.advance(now());
  collect();
  deliver();
}

void EmulatedMti::Impl::noticeHost() {
  const bool open = terminal_->isOpen();
  if (open_ && !open) {
    terminal_->discardUnread();
    line_.clear();
  }
  open_ = open;
}

/// Puts what the device has to say on the line.
void EmulatedMti::Impl::collect() {
  for (const MtiState::Outgoing& outgoing : state_.takeOutgoing()) {
    if (!open_ || faults_.mute) continue;
    const bool data = outgoing.message.is(mti::MessageId::kMtData);
    if (data && line_.freeAt() > outgoing.ready_s + state_.samplePeriod()) {
      ++statistics_.messages_skipped;
      continue;
    }
    line_.send(encode(outgoing.message), outgoing.ready_s, outgoing.baud);
    if (data) ++statistics_.messages_sent;
  }
}

void EmulatedMti::Impl::deliver() {
  std::vector<std::uint8_t> bytes;
  for (SerialLine::Portion& portion : line_.arrived(now())) {
    if (garbledAt(portion.baud)) garble(&portion.bytes);
    bytes.insert(bytes.end(), portion.bytes.begin(), portion.bytes.end());
  }
  if (bytes.empty() || !open_ || faults_.mute) return;
  bytes = damage(bytes);
  statistics_.bytes_overrun += bytes.size() - terminal_->write(bytes);
}

/// Whether host and device disagree about the length of a bit.
bool EmulatedMti::Impl::garbledAt(int baud) const {
  const int host = terminal_->baudRate();
  return host != 0 && host != baud;
}

void EmulatedMti::Impl::garble(std::vector<std::uint8_t>* bytes) {
  for (std::uint8_t& byte : *bytes) byte = static_cast<std::uint8_t>(random_.bits() >> 56U);
}

std::vector<std::uint8_t> EmulatedMti::Impl::damage(const std::vector<std::uint8_t>& bytes) {
  std::vector<std::uint8_t> left;
  left.reserve(bytes.size());
  for (const std::uint8_t byte : bytes) {
    if (random_.uniform() < faults_.drop_bytes) {
      ++statistics_.bytes_dropped;
    } else if (random_.uniform() < faults_.corrupt_bytes) {
      ++statistics_.bytes_corrupted;
      left.push_back(static_cast<std::uint8_t>(byte ^ (1U << (random_.bits() >> 61U))));
    } else {
      left.push_back(byte);
    }
  }
  return left;
}

double EmulatedMti::Impl::deadline() const {
  const double next = std::min(state_.nextEvent(), line_.nextArrival());
  return open_ ? next : std::min(next, now() + kOpenCheckS);
}

void EmulatedMti::Impl::waitUntil(double time_s, bool watch_terminal) {
  std::array<pollfd, 2> watched = {pollfd{wake_up_.descriptor(), POLLIN, 0},
                                   pollfd{terminal_->descriptor(), POLLIN, 0}};
  const double wait_s = std::max(0.0, time_s - now());
  timespec wait{};
  if (std::isfinite(wait_s)) {
    wait.tv_sec = static_cast<time_t>(wait_s);
    wait.tv_nsec = static_cast<long>((wait_s - std::floor(wait_s)) * 1e9);
  }
  // Without a terminal to watch it is left out: it would report its hang-up over and over.
  ::ppoll(watched.data(), watch_terminal ? 2 : 1, std::isfinite(wait_s) ? &wait : nullptr, nullptr);
}

EmulatedMti::EmulatedMti(const Options& options, std::vector<MtiSample> samples)
    : impl_(std::make_unique<Impl>(options, std::move(samples))) {}
EmulatedMti::~EmulatedMti() = default;
std::string EmulatedMti::path() const { return impl_->path(); }
void EmulatedMti::start(double delay_s) { impl_->start(delay_s); }
void EmulatedMti::setFaults(const MtiFaults& faults) { impl_->setFaults(faults); }
void EmulatedMti::unplug() { impl_->unplug(); }
void EmulatedMti::plug() { impl_->plug(); }
EmulatedMti::Statistics EmulatedMti::statistics() const { return impl_->statistics(); }

}  // namespace scanner::simulation
