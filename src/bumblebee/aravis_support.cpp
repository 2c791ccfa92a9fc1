#include "bumblebee/aravis_support.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <mutex>
#include <thread>

namespace scanner::bumblebee::aravis {
namespace {

constexpr std::uint16_t kControlPort = 3956;
constexpr std::uint8_t kReadRegister = 0x80, kReadRegisterAnswer = 0x81;

class Descriptor {
 public:
  explicit Descriptor(int value) : value_(value) {}
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int value() const { return value_; }

 private:
  const int value_;
};

/// sockaddr_in in the clothes of sockaddr, without a cast.
sockaddr generic(const sockaddr_in& address) {
  sockaddr result{};
  static_assert(sizeof(result) == sizeof(address));
  std::memcpy(&result, &address, sizeof(address));
  return result;
}

std::string localAddress(int descriptor) {
  sockaddr any{};
  socklen_t size = sizeof(any);
  if (::getsockname(descriptor, &any, &size) != 0) return {};
  sockaddr_in local{};
  std::memcpy(&local, &any, sizeof(local));
  std::array<char, INET_ADDRSTRLEN> text{};
  const char* name = ::inet_ntop(AF_INET, &local.sin_addr, text.data(), text.size());
  return name != nullptr ? name : "";
}

enum class Answer { kYes, kNobody, kSilence };

/// Waits for the answer to request `id`; answers to earlier ones are as good.
Answer awaitAnswer(int descriptor, Duration patience) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point deadline = Clock::now() + patience;
  for (;;) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now());
    pollfd readable{descriptor, POLLIN, 0};
    if (left.count() <= 0 || ::poll(&readable, 1, static_cast<int>(left.count())) <= 0) {
      if (Clock::now() >= deadline) return Answer::kSilence;
      continue;  // a signal
    }
    std::array<std::uint8_t, 64> packet{};
    const ssize_t size = ::recv(descriptor, packet.data(), packet.size(), MSG_DONTWAIT);
    if (size < 0 && (errno == EAGAIN || errno == EINTR)) continue;
    if (size < 0) return Answer::kNobody;  // the host, or a router, says so
    if (size >= 8 && packet[2] == 0 && packet[3] == kReadRegisterAnswer) return Answer::kYes;
  }
}

class Undertaker {
 public:
  Undertaker() : thread_([this] { run(); }) {}
  ~Undertaker() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      ends_ = true;
    }
    wake_.notify_all();
    thread_.join();
  }
  Undertaker(const Undertaker&) = delete;
  Undertaker& operator=(const Undertaker&) = delete;

  void add(std::function<void()> job) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      jobs_.push_back(std::move(job));
    }
    wake_.notify_all();
  }

 private:
  void run() {
    std::unique_lock<std::mutex> lock(mutex_);
    for (;;) {
      wake_.wait(lock, [this] { return ends_ || !jobs_.empty(); });
      if (jobs_.empty()) return;
      const std::function<void()> job = std::move(jobs_.front());
      jobs_.pop_front();
      lock.unlock();
      job();
      lock.lock();
    }
  }

  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> jobs_;
  bool ends_ = false;
  std::thread thread_;  // last: it uses the others
};

}  // namespace

Status Error::status(const std::string& doing) const {
  if (error_ == nullptr) return Status::ok();
  const std::string line = doing + ": " + error_->message;
  if (error_->domain != arv_device_error_quark()) return {StatusCode::kIoError, line};
  switch (error_->code) {
    case ARV_DEVICE_ERROR_PROTOCOL_ERROR_ACCESS_DENIED:
    case ARV_DEVICE_ERROR_NOT_CONTROLLER:
      return {StatusCode::kIoError, "camera is busy, another program controls it: " + line};
    case ARV_DEVICE_ERROR_TIMEOUT:
    case ARV_DEVICE_ERROR_NOT_CONNECTED:
      return {StatusCode::kIoError, "camera does not answer: " + line};
    case ARV_DEVICE_ERROR_FEATURE_NOT_FOUND:
    case ARV_DEVICE_ERROR_PROTOCOL_ERROR_NOT_IMPLEMENTED:
      return {StatusCode::kUnsupported, line};
    case ARV_DEVICE_ERROR_INVALID_PARAMETER:
    case ARV_DEVICE_ERROR_WRONG_FEATURE:
    case ARV_DEVICE_ERROR_PROTOCOL_ERROR_INVALID_PARAMETER:
    case ARV_DEVICE_ERROR_PROTOCOL_ERROR_WRITE_PROTECT:
      return {StatusCode::kInvalidInput, line};
    default:
      return {StatusCode::kIoError, line};
  }
}

ProbeResult probeGigE(const std::string& address, int tries, Duration patience) {
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_port = htons(kControlPort);
  if (::inet_pton(AF_INET, address.c_str(), &place.sin_addr) != 1) return {};
  const Descriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const sockaddr target = generic(place);
  if (socket.value() < 0 || ::connect(socket.value(), &target, sizeof(target)) != 0) return {};
  ProbeResult result{false, localAddress(socket.value())};
  for (int i = 1; i <= tries; ++i) {
    // Key, flag "acknowledge", command, length 4, number of the request, register 0 (the version).
    const std::array<std::uint8_t, 12> request{
        0x42, 0x01, 0, kReadRegister, 0, 4, 0x5c, static_cast<std::uint8_t>(i), 0, 0, 0, 0};
    if (::send(socket.value(), request.data(), request.size(), 0) < 0) {
      if (errno == ECONNREFUSED) return result;
      continue;
    }
    const Answer answer = awaitAnswer(socket.value(), patience);
    if (answer == Answer::kSilence) continue;
    result.answers = answer == Answer::kYes;
    return result;
  }
  return result;
}

void freeLater(std::function<void()> job) {
  static Undertaker undertaker;
  undertaker.add(std::move(job));
}

Time wallClock() {
  return Time(
      std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch()));
}

}  // namespace scanner::bumblebee::aravis
