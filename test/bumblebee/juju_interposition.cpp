// The fortified inline versions of the C library would collide with the ones defined here.
#undef _FORTIFY_SOURCE
#include <dirent.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <string>

#include "bumblebee/juju_bus.h"

// Defined in the program, these stand before the C library's for every shared library in it.

using scanner::bumblebee::active;
using scanner::bumblebee::real;

extern "C" int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const auto mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : mode_t{0};
  va_end(arguments);
  if (active != nullptr && std::string(path).compare(0, 7, "/dev/fw") == 0)
    return active->open(path);
  static const auto next = real<int (*)(const char*, int, ...)>("open");
  return next(path, flags, mode);
}

extern "C" int close(int fd) {
  if (active != nullptr && active->owns(fd)) return active->close(fd);
  static const auto next = real<int (*)(int)>("close");
  return next(fd);
}

extern "C" ssize_t read(int fd, void* data, size_t bytes) {
  if (active != nullptr && active->isGone(fd)) return errno = ENODEV, -1;
  static const auto next = real<ssize_t (*)(int, void*, size_t)>("read");
  return next(fd, data, bytes);
}

extern "C" int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  if (active != nullptr && active->owns(fd)) return active->ioctl(fd, request, argument);
  static const auto next = real<int (*)(int, unsigned long, ...)>("ioctl");
  return next(fd, request, argument);
}

extern "C" void* mmap(void* address, size_t bytes, int protection, int flags, int fd,
                      off_t offset) noexcept {
  static const auto next = real<void* (*)(void*, size_t, int, int, int, off_t)>("mmap");
  if (active == nullptr || !active->owns(fd))
    return next(address, bytes, protection, flags, fd, offset);
  void* buffers = next(nullptr, bytes, protection, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (buffers != MAP_FAILED) active->mappings[buffers] = bytes;
  return buffers;
}

extern "C" int munmap(void* address, size_t bytes) noexcept {
  static const auto next = real<int (*)(void*, size_t)>("munmap");
  if (active != nullptr) active->mappings.erase(address);
  return next(address, bytes);
}

extern "C" DIR* opendir(const char* path) {
  static const auto next = real<DIR* (*)(const char*)>("opendir");
  if (active != nullptr && std::string(path) == "/dev") return next(active->nodeFolder().c_str());
  return next(path);
}
