#include "scanner/mti/serial_port.h"

#include <fcntl.h>
#include <grp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <system_error>
#include <utility>

#include "mti/serial_settings.h"

namespace scanner::mti {
namespace {

using Clock = std::chrono::steady_clock;

std::string errorText(int error) { return std::generic_category().message(error); }

Time hostNow() { return Time(std::chrono::system_clock::now().time_since_epoch()); }

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

int milliseconds(double seconds) {
  return static_cast<int>(std::ceil(1e3 * std::min(std::max(seconds, 0.0), 1e6)));
}

std::string groupOf(const std::string& path) {
  struct stat status {};
  std::array<char, 4096> buffer{};
  group entry{};
  group* found = nullptr;
  if (::stat(path.c_str(), &status) == 0 && (status.st_mode & S_IWGRP) != 0 &&
      ::getgrgid_r(status.st_gid, &entry, buffer.data(), buffer.size(), &found) == 0 && found) {
    return found->gr_name;
  }
  return "dialout";
}

Status cannotOpen(const std::string& path, int error) {
  std::string why = path + ": ";
  if (error == EACCES || error == EPERM) {
    why += "no permission; join the group " + groupOf(path) + " (sudo usermod -a -G " +
           groupOf(path) + " $USER) and log in again";
  } else if (error == EBUSY || error == EWOULDBLOCK) {
    why += "in use by another program";
  } else if (error == ENOENT || error == ENODEV || error == ENXIO) {
    why += "no such port; is the device plugged in?";
  } else {
    why += "cannot be opened: " + errorText(error);
  }
  return Status(StatusCode::kIoError, why);
}

Status gone(const std::string& path) {
  return Status(StatusCode::kIoError, path + ": the port is gone (cable pulled?)");
}

}  // namespace

WakeUpCall::WakeUpCall() : descriptor_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (descriptor_ < 0) throw ConfigurationError("no event descriptor can be made");
}
WakeUpCall::~WakeUpCall() { ::close(descriptor_); }
void WakeUpCall::ring() const { ::eventfd_write(descriptor_, 1); }
void WakeUpCall::answer() const {
  eventfd_t rings = 0;
  ::eventfd_read(descriptor_, &rings);
}
bool WakeUpCall::wait(double seconds) const {
  pollfd watched{descriptor_, POLLIN, 0};
  const Clock::time_point start = Clock::now();
  int ready = ::poll(&watched, 1, milliseconds(seconds));
  while (ready < 0 && errno == EINTR) {
    ready = ::poll(&watched, 1, milliseconds(seconds - since(start)));
  }
  return ready > 0;
}

SerialPort::SerialPort(int descriptor, std::string path, const Options& options,
                       const WakeUpCall* wake_up)
    : descriptor_(descriptor), path_(std::move(path)), options_(options), wake_up_(wake_up) {}

SerialPort::SerialPort(SerialPort&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      path_(std::move(other.path_)),
      options_(other.options_),
      wake_up_(other.wake_up_),
      low_latency_(other.low_latency_) {}

SerialPort::~SerialPort() {
  if (descriptor_ < 0) return;
  if (!isPseudoTerminal(descriptor_)) allowOthers(descriptor_);
  ::close(descriptor_);
}

Result<SerialPort> SerialPort::open(const std::string& path, const Options& options,
                                    const WakeUpCall* wake_up) {
  // Without waiting for a carrier, which three wires do not have.
  const int descriptor = ::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0) return cannotOpen(path, errno);
  if (::isatty(descriptor) == 0) {
    ::close(descriptor);
    return Status(StatusCode::kIoError, path + ": no serial port");
  }
  if (!refuseOthers(descriptor)) {
    const int error = errno;
    ::close(descriptor);
    return cannotOpen(path, error);
  }
  SerialPort port(descriptor, path, options, wake_up);
  if (const Status status = port.configure(options.baud_rate); !status) return status;
  if (options.low_latency) port.low_latency_ = requestLowLatency(descriptor, path);
  port.discardInput();
  return port;
}

Status SerialPort::configure(int baud_rate) {
  if (setRaw(descriptor_, baud_rate, options_.two_stop_bits)) {
    options_.baud_rate = baud_rate;
    return Status::ok();
  }
  const int error = errno;
  if (error == EIO || error == ENODEV || error == ENXIO) return gone(path_);
  return Status(
      StatusCode::kUnsupported,
      path_ + ": the port cannot do " + std::to_string(baud_rate) + " baud: " + errorText(error));
}

Status SerialPort::setBaudRate(int baud_rate) {
  const int before = options_.baud_rate;
  const Status status = configure(baud_rate);
  if (status.code() == StatusCode::kUnsupported)
    setRaw(descriptor_, before, options_.two_stop_bits);
  return status;
}

double SerialPort::secondsPerByte() const {
  return (options_.two_stop_bits ? 11.0 : 10.0) / options_.baud_rate;
}

Result<SerialPort::Chunk> SerialPort::read(double seconds) {
  const Clock::time_point start = Clock::now();
  Chunk chunk;
  while (true) {
    std::array<pollfd, 2> watched = {pollfd{descriptor_, POLLIN, 0},
                                     pollfd{wake_up_ ? wake_up_->descriptor() : -1, POLLIN, 0}};
    const int ready = ::poll(watched.data(), 2, milliseconds(seconds - since(start)));
    chunk.before = chunk.after = hostNow();
    if (ready < 0 && errno != EINTR) return gone(path_);
    if (watched[0].revents == 0) {
      const bool rung = ready > 0;
      if (rung || since(start) >= seconds) return chunk;
      continue;
    }
    std::array<std::uint8_t, 4096> buffer{};
    const ssize_t count = ::read(descriptor_, buffer.data(), buffer.size());
    chunk.after = hostNow();
    if (count > 0) {
      chunk.bytes.assign(buffer.begin(), buffer.begin() + count);
      return chunk;
    }
    if (count == 0 || (errno != EAGAIN && errno != EINTR)) return gone(path_);
    if ((watched[0].revents & (POLLHUP | POLLERR | POLLNVAL)) != 0) return gone(path_);
    if (since(start) >= seconds) return chunk;
  }
}

Status SerialPort::write(const std::vector<std::uint8_t>& bytes, double seconds) {
  const Clock::time_point start = Clock::now();
  std::size_t written = 0;
  while (written < bytes.size()) {
    const ssize_t count = ::write(descriptor_, bytes.data() + written, bytes.size() - written);
    if (count > 0) {
      written += static_cast<std::size_t>(count);
      continue;
    }
    if (count < 0 && errno != EAGAIN && errno != EINTR) return gone(path_);
    const double left = seconds - since(start);
    if (left <= 0.0) {
      return Status(StatusCode::kIoError, path_ + ": does not take what is sent");
    }
    pollfd watched{descriptor_, POLLOUT, 0};
    if (::poll(&watched, 1, milliseconds(left)) > 0 && (watched.revents & POLLOUT) == 0) {
      return gone(path_);
    }
  }
  return Status::ok();
}

void SerialPort::discardInput() { discardReceived(descriptor_); }

}  // namespace scanner::mti
