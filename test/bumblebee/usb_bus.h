#pragma once

#include <dlfcn.h>
#include <linux/ioctl.h>
#include <linux/usbdevice_fs.h>

#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "bumblebee/usb_emulation.h"

/// Shared by usb_emulation.cpp (what the kernel does) and usb_interposition.cpp (how programs get
/// there).
namespace scanner::bumblebee {

/// A library's own function of a name that the test program defines itself.
template <typename Function>
Function realUsb(const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

/// One opening of the camera's node: the writing end of a pipe, because a pipe's POLLOUT can be
/// given (empty) and taken (full), and POLLERR comes with the loss of its other end.
struct UsbFile {
  int peer = -1;
  bool gone = false;
  std::deque<usbdevfs_urb*> queued, done;
};

class UsbEmulation::Impl {
 public:
  Impl();
  ~Impl();
  bool owns(int fd) const;
  int open(const std::string& node);
  int close(int fd);
  int ioctl(int fd, unsigned long request, void* argument);
  bool present() const;
  std::string node() const;
  void describe() const;  ///< writes the files of sysfs
  bool complete(int status, const std::vector<std::uint8_t>& bytes);
  static void signal(int fd, const UsbFile& file);

  mutable std::mutex mutex;
  RegisterMap registers;
  std::vector<std::uint32_t> rom;
  std::map<std::uint64_t, std::uint32_t> second_space;  ///< 0xD000........
  std::map<int, UsbFile> files;
  std::string folder;
  int device_number = 2, claimant = -1, cleared = 0, cleared_early = 0;
  bool plugged = true, denied = false, elsewhere = false, halted = false;
  std::size_t limit = 1000;

 private:
  int submit(int fd, UsbFile& file, usbdevfs_urb* urb);
  int claim(int fd);
  void control(usbdevfs_urb* urb);
  bool access(std::uint64_t address, bool write, std::uint32_t* value);
};

extern UsbEmulation::Impl* active_usb;

}  // namespace scanner::bumblebee
