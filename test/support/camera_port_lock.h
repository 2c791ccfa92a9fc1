#pragma once

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <filesystem>
#include <string>

namespace scanner::test {

/// The control port of an emulated camera is one for a machine (Aravis' fake camera serves no other
/// loopback address than 127.0.0.1), and tests run side by side. Whoever holds this is alone;
/// others wait. The kernel gives it back when the process ends, however it does.
class CameraPortLock {
 public:
  CameraPortLock() {
    const std::string path =
        (std::filesystem::temp_directory_path() / "scanner_camera_port.lock").string();
    descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    // In a sticky folder, O_CREAT is refused for somebody else's file.
    if (descriptor_ < 0) descriptor_ = ::open(path.c_str(), O_RDONLY | O_CREAT | O_CLOEXEC, 0644);
    while (descriptor_ >= 0 && ::flock(descriptor_, LOCK_EX) != 0) {
    }
  }
  ~CameraPortLock() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  CameraPortLock(const CameraPortLock&) = delete;
  CameraPortLock& operator=(const CameraPortLock&) = delete;

 private:
  int descriptor_ = -1;
};

}  // namespace scanner::test
