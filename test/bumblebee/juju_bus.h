#pragma once

#include <dlfcn.h>
#include <linux/firewire-cdev.h>

#include <deque>
#include <map>
#include <mutex>
#include <string>

#include "bumblebee/juju_emulation.h"

/// Shared by juju_emulation.cpp (what the kernel does) and juju_interposition.cpp (how programs get
/// there).
namespace scanner::bumblebee {

/// The C library's own function of a name that the test program defines itself.
template <typename Function>
Function real(const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

struct QueuedBuffer {
  std::uint8_t* data = nullptr;
  std::size_t packets = 0, packet_bytes = 0;
};

/// One opening of /dev/fw1.
struct Client {
  int peer = -1;  ///< other end of the socket that the program holds
  bool gone = false, started = false;
  std::deque<QueuedBuffer> queue;
  std::map<std::uint32_t, std::uint64_t> resources;  ///< closure of the allocation by handle
};

class JujuEmulation::Impl {
 public:
  Impl();
  ~Impl();
  int open(const std::string& path);
  int close(int fd);
  int ioctl(int fd, unsigned long request, void* argument);
  bool owns(int fd) const {
    const std::lock_guard<std::recursive_mutex> lock(mutex);
    return clients.count(fd) != 0;
  }
  bool isGone(int fd) const {
    const std::lock_guard<std::recursive_mutex> lock(mutex);
    const auto client = clients.find(fd);
    return client != clients.end() && client->second.gone;
  }
  std::string nodeFolder() const { return folder; }

  mutable std::recursive_mutex mutex;
  RegisterMap registers;
  std::vector<std::uint32_t> rom;  ///< configuration ROM from its first quadlet
  std::map<int, Client> clients;
  std::map<void*, std::size_t> mappings;
  bool denied = false, full = false, full_for_ever = false;
  std::uint32_t generation = 1;
  int bus_resets_asked = 0;
  std::int64_t last_start = 0;
  std::string folder;

  void send(Client& client, const void* event, std::size_t bytes) const;
  void resetBus();
  void touch(const char* name, bool present) const;

 private:
  int request(Client& client, const fw_cdev_send_request& request);
  std::uint32_t access(std::uint64_t address, bool write, std::uint32_t* value);
  int allocate(Client& client, fw_cdev_allocate_iso_resource* request);
  int deallocate(Client& client, std::uint32_t handle);
  static int queue(Client& client, const fw_cdev_queue_iso& request);
};

extern JujuEmulation::Impl* active;

}  // namespace scanner::bumblebee
