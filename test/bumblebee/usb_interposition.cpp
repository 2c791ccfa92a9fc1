// The fortified inline versions of the C library would collide with the ones defined here.
#undef _FORTIFY_SOURCE
#include <dirent.h>
#include <fcntl.h>
#include <sys/eventfd.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <cstdarg>
#include <string>

#include "bumblebee/usb_bus.h"

// Defined in the program, these stand before the libraries' own for every shared library in it.

using scanner::bumblebee::active_usb;
using scanner::bumblebee::realUsb;

namespace {

bool startsWith(const std::string& text, const std::string& head) {
  return text.compare(0, head.size(), head) == 0;
}

int openAny(const char* path, int flags, mode_t mode) {
  static const auto next = realUsb<int (*)(const char*, int, ...)>("open");
  const std::string sys = "/sys/bus/usb/devices/";
  if (active_usb != nullptr && startsWith(path, "/dev/bus/usb/")) return active_usb->open(path);
  if (active_usb != nullptr && startsWith(path, sys))
    return next((active_usb->folder + "/sys/" + (path + sys.size())).c_str(), flags, mode);
  return next(path, flags, mode);
}

}  // namespace

extern "C" int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const auto mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : mode_t{0};
  va_end(arguments);
  return openAny(path, flags, mode);
}

extern "C" int __open_2(const char* path, int flags) {  // NOLINT: the C library's name
  return openAny(path, flags, 0);
}

extern "C" int close(int fd) {
  static const auto next = realUsb<int (*)(int)>("close");
  return active_usb != nullptr && active_usb->owns(fd) ? active_usb->close(fd) : next(fd);
}

extern "C" int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  if (active_usb != nullptr && active_usb->owns(fd))
    return active_usb->ioctl(fd, request, argument);
  static const auto next = realUsb<int (*)(int, unsigned long, ...)>("ioctl");
  return next(fd, request, argument);
}

extern "C" DIR* opendir(const char* path) {
  static const auto next = realUsb<DIR* (*)(const char*)>("opendir");
  if (active_usb != nullptr && startsWith(path, "/dev/bus/usb"))
    return next((active_usb->folder + "/dev").c_str());
  return next(path);
}

extern "C" int statfs(const char* path, struct statfs* result) noexcept {
  static const auto next = realUsb<int (*)(const char*, struct statfs*)>("statfs");
  const int answer = next(path, result);
  if (active_usb == nullptr || std::string(path) != "/sys") return answer;
  result->f_type = 0x62656572;  // sysfs, also in a container without it
  return 0;
}

// libudev: one list with one device, and a monitor that never says anything. Its objects are opaque
// to programs, so any address will do.
extern "C" {
struct Opaque {
  int fd;
};
static Opaque some_object;

void* udev_new() { return &some_object; }
void* udev_unref(void*) { return nullptr; }
void* udev_enumerate_new(void*) { return &some_object; }
int udev_enumerate_add_match_subsystem(void*, const char*) { return 0; }
int udev_enumerate_add_match_property(void*, const char*, const char*) { return 0; }
int udev_enumerate_scan_devices(void*) { return 0; }
void* udev_enumerate_unref(void*) { return nullptr; }
void* udev_enumerate_get_list_entry(void*) {
  return active_usb != nullptr && active_usb->present() ? &some_object : nullptr;
}
void* udev_list_entry_get_next(void*) { return nullptr; }
const char* udev_list_entry_get_name(void*) { return "/sys/bus/usb/devices/1-1"; }
void* udev_device_new_from_syspath(void*, const char*) { return &some_object; }
const char* udev_device_get_devnode(void*) {
  static thread_local std::string node;
  node = active_usb->node();
  return node.c_str();
}
const char* udev_device_get_sysname(void*) { return "1-1"; }
const char* udev_device_get_action(void*) { return nullptr; }
void* udev_device_unref(void*) { return nullptr; }
void* udev_monitor_new_from_netlink(void*, const char*) {
  return new Opaque{::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
}
int udev_monitor_filter_add_match_subsystem_devtype(void*, const char*, const char*) { return 0; }
int udev_monitor_enable_receiving(void*) { return 0; }
int udev_monitor_get_fd(void* monitor) { return static_cast<Opaque*>(monitor)->fd; }
void* udev_monitor_receive_device(void*) { return nullptr; }
void* udev_monitor_unref(void* monitor) {
  ::close(static_cast<Opaque*>(monitor)->fd);
  delete static_cast<Opaque*>(monitor);
  return nullptr;
}
}
