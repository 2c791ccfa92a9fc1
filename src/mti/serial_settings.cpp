#include "mti/serial_settings.h"

#include <asm/termbits.h>
#include <linux/major.h>
#include <linux/serial.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace scanner::mti {
namespace {

namespace fs = std::filesystem;

/// The constant of a rate; BOTHER for rates without one. (Pseudo-terminals show the other end only
/// the former.)
tcflag_t speedFlag(int baud_rate) {
  switch (baud_rate) {
    case 9600:
      return B9600;
    case 19200:
      return B19200;
    case 38400:
      return B38400;
    case 57600:
      return B57600;
    case 115200:
      return B115200;
    case 230400:
      return B230400;
    case 460800:
      return B460800;
    case 921600:
      return B921600;
    default:
      return BOTHER;
  }
}

/// The FTDI driver's timer, in milliseconds: how long it waits for a packet to fill.
bool shortenLatencyTimer(const std::string& path) {
  std::error_code error;
  const fs::path name = fs::canonical(path, error).filename();
  if (error) return false;
  const fs::path timer = fs::path("/sys/bus/usb-serial/devices") / name / "latency_timer";
  int milliseconds = 0;
  if (!(std::ifstream(timer) >> milliseconds)) return false;
  if (milliseconds > 1) {
    std::ofstream(timer) << 1;
    std::ifstream(timer) >> milliseconds;
  }
  return milliseconds == 1;
}

}  // namespace

bool setRaw(int descriptor, int baud_rate, bool two_stop_bits) {
  termios2 settings{};
  if (::ioctl(descriptor, TCGETS2, &settings) != 0) return false;
  settings.c_iflag = IGNBRK;
  settings.c_oflag = 0;
  settings.c_lflag = 0;
  settings.c_cflag = CS8 | CREAD | CLOCAL | speedFlag(baud_rate);
  if (two_stop_bits) settings.c_cflag |= CSTOPB;
  settings.c_ispeed = settings.c_ospeed = static_cast<speed_t>(baud_rate);
  settings.c_cc[VMIN] = 1;  // with 0, "nothing there" and "hung up" would read the same
  settings.c_cc[VTIME] = 0;
  if (::ioctl(descriptor, TCSETSW2, &settings) != 0) return false;
  if (::ioctl(descriptor, TCGETS2, &settings) != 0) return false;
  // A receiver follows a rate that is off by two percent.
  const int taken = static_cast<int>(settings.c_ospeed);
  if (std::abs(taken - baud_rate) * 50 <= baud_rate) return true;
  errno = EINVAL;
  return false;
}

bool discardReceived(int descriptor) { return ::ioctl(descriptor, TCFLSH, TCIFLUSH) == 0; }

bool isPseudoTerminal(int descriptor) {
  struct stat status {};
  if (::fstat(descriptor, &status) != 0) return false;
  const unsigned kind = major(status.st_rdev);
  return kind >= UNIX98_PTY_SLAVE_MAJOR && kind < UNIX98_PTY_SLAVE_MAJOR + UNIX98_PTY_MAJOR_COUNT;
}

/// The lock holds against ourselves and against root, which TIOCEXCL does not. A pseudo-terminal
/// would stay exclusive for ever if we crashed, as long as its other end is there.
bool refuseOthers(int descriptor) {
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) return false;
  return isPseudoTerminal(descriptor) || ::ioctl(descriptor, TIOCEXCL) == 0;
}

void allowOthers(int descriptor) { ::ioctl(descriptor, TIOCNXCL); }

bool requestLowLatency(int descriptor, const std::string& path) {
  bool promised = shortenLatencyTimer(path);
  serial_struct serial{};
  if (::ioctl(descriptor, TIOCGSERIAL, &serial) == 0) {
    serial.flags |= static_cast<int>(ASYNC_LOW_LATENCY);
    promised = ::ioctl(descriptor, TIOCSSERIAL, &serial) == 0 || promised;
  }
  return promised;
}

}  // namespace scanner::mti
