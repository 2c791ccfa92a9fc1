#include "simulation/pseudo_terminal.h"

#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "scanner/core/status.h"

namespace scanner::simulation {
namespace {

[[noreturn]] void fail(const std::string& what, int error) {
  throw ConfigurationError(what + ": " + std::generic_category().message(error));
}

int openHostEnd(const std::string& name) {
  return ::open(name.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
}

}  // namespace

PseudoTerminal::PseudoTerminal(const std::string& link) : link_(link) {
  try {
    open();
    setRaw();
    makeLink();
  } catch (...) {
    if (master_ >= 0) ::close(master_);
    throw;
  }
}

PseudoTerminal::~PseudoTerminal() {
  std::error_code ignored;
  // Another emulator may have taken the link over.
  if (!link_.empty() && std::filesystem::read_symlink(link_, ignored) == name_) {
    std::filesystem::remove(link_, ignored);
  }
  ::close(master_);
}

void PseudoTerminal::open() {
  master_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  if (master_ < 0) fail("no pseudo-terminal can be made", errno);
  std::array<char, 128> name{};
  if (::grantpt(master_) != 0 || ::unlockpt(master_) != 0 ||
      ::ptsname_r(master_, name.data(), name.size()) != 0) {
    fail("the pseudo-terminal cannot be unlocked", errno);
  }
  name_ = name.data();
}

void PseudoTerminal::makeLink() {
  if (link_.empty()) return;
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::file_status there = fs::symlink_status(link_, error);
  if (fs::exists(there) && !fs::is_symlink(there)) {
    throw ConfigurationError("link of the terminal '" + link_ + "': a file of this name exists");
  }
  // Made aside and renamed, so that the link never points nowhere.
  const std::string aside = link_ + "." + std::to_string(::getpid());
  fs::remove(aside, error);
  fs::create_symlink(name_, aside, error);
  if (!error) fs::rename(aside, link_, error);
  if (!error) return;
  std::error_code ignored;
  fs::remove(aside, ignored);
  fail("link of the terminal '" + link_ + "'", error.value());
}

bool PseudoTerminal::isOpen() const {
  pollfd state{master_, POLLIN, 0};
  return ::poll(&state, 1, 0) >= 0 && (state.revents & POLLHUP) == 0;
}

/// Opens the host's end for a moment. That is also what makes the kernel tell from now on that
/// nobody has it open: it does not before the first close.
void PseudoTerminal::setRaw() {
  const int host = openHostEnd(name_);
  termios settings{};
  bool ok = host >= 0 && ::tcgetattr(host, &settings) == 0;
  ::cfmakeraw(&settings);
  ok = ok && ::cfsetspeed(&settings, B115200) == 0 && ::tcsetattr(host, TCSANOW, &settings) == 0;
  const int error = errno;
  if (host >= 0) ::close(host);
  if (!ok) fail("terminal '" + name_ + "'", error);
}

/// Leaves the settings and what goes to the device alone: a new host may be there already.
void PseudoTerminal::discardUnread() {
  const int host = openHostEnd(name_);
  if (host < 0) return;
  ::tcflush(host, TCIFLUSH);
  ::close(host);
}

std::vector<std::uint8_t> PseudoTerminal::read() {
  std::vector<std::uint8_t> bytes;
  std::array<std::uint8_t, 512> buffer{};
  while (true) {
    const ssize_t count = ::read(master_, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return bytes;  // nothing there, or nobody at the other end
    bytes.insert(bytes.end(), buffer.begin(), buffer.begin() + count);
  }
}

std::size_t PseudoTerminal::write(const std::vector<std::uint8_t>& bytes) {
  std::size_t written = 0;
  while (written < bytes.size()) {
    const ssize_t count = ::write(master_, bytes.data() + written, bytes.size() - written);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    written += static_cast<std::size_t>(count);
  }
  return written;
}

int PseudoTerminal::baudRate() const {
  termios settings{};
  if (::tcgetattr(master_, &settings) != 0) return 0;
  switch (::cfgetospeed(&settings)) {
    case B9600:
      return 9600;
    case B19200:
      return 19200;
    case B38400:
      return 38400;
    case B57600:
      return 57600;
    case B115200:
      return 115200;
    case B230400:
      return 230400;
    case B460800:
      return 460800;
    case B921600:
      return 921600;
    default:
      return 0;
  }
}

}  // namespace scanner::simulation
