#include "bumblebee/juju_emulation.h"

#include <fcntl.h>
#include <linux/firewire-constants.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdlib>

#include "bumblebee/juju_bus.h"

namespace scanner::bumblebee {
namespace {

constexpr std::uint64_t kRomBase = 0xFFFFF0000400, kCommandBase = 0xFFFFF0F00000;
constexpr std::uint64_t kGuid = 0x00B09D01006C089B;
constexpr std::uint32_t kUnitDirectory = 12, kDependent = 17;

std::uint32_t bigEndian(std::uint32_t value) { return __builtin_bswap32(value); }

/// A textual leaf: length, two quadlets of language, text.
std::vector<std::uint32_t> leaf(const std::string& text) {
  std::vector<std::uint32_t> quadlets(3 + (text.size() + 3) / 4, 0);
  quadlets[0] = static_cast<std::uint32_t>(quadlets.size() - 1) << 16;
  for (std::size_t i = 0; i < text.size(); ++i)
    quadlets[3 + i / 4] |= static_cast<std::uint32_t>(static_cast<unsigned char>(text[i]))
                           << (24 - 8 * (i % 4));
  return quadlets;
}

std::vector<std::uint32_t> configurationRom() {
  std::vector<std::uint32_t> rom = {
      0x04040000, 0x31333934, 0xE000A002, static_cast<std::uint32_t>(kGuid >> 32),
      static_cast<std::uint32_t>(kGuid),
      // root directory: vendor, capabilities, unit directory
      0x00030000, 0x0300B09D, 0x0C0083C0, 0xD1000000 | (kUnitDirectory - 8), 0, 0, 0,
      // unit directory: IIDC 1.30 or later, dependent directory
      0x00030000, 0x1200A02D, 0x13000102, 0xD4000000 | (kDependent - 15), 0,
      // dependent directory: command registers, version 1.31, vendor, model
      0x00040000, 0x40000000 | 0xF00000 / 4, 0x38000010, 0, 0};
  const std::uint32_t vendor = static_cast<std::uint32_t>(rom.size());
  rom[20] = 0x81000000 | (vendor - 20);
  const auto vendor_leaf = leaf("Point Grey Research");
  rom.insert(rom.end(), vendor_leaf.begin(), vendor_leaf.end());
  rom[21] = 0x82000000 | (static_cast<std::uint32_t>(rom.size()) - 21);
  const auto model_leaf = leaf("Bumblebee2 BB2-03S2C");
  rom.insert(rom.end(), model_leaf.begin(), model_leaf.end());
  rom.resize(256, 0);
  return rom;
}

/// Cycle timer of the bus at a wall-clock time.
std::uint32_t busTime(std::int64_t us) {
  const auto seconds = static_cast<std::uint32_t>(us / 1000000 % 128);
  const auto rest = static_cast<std::uint32_t>(us % 1000000);
  return seconds << 25 | rest / 125 << 12 | rest % 125 * 3072 / 125;
}

std::int64_t now() {
  timeval time{};
  ::gettimeofday(&time, nullptr);
  return time.tv_sec * std::int64_t{1000000} + time.tv_usec;
}

}  // namespace

JujuEmulation::Impl* active = nullptr;

JujuEmulation::Impl::Impl() : rom(configurationRom()) {
  char name[] = "/tmp/scanner_juju_XXXXXX";
  folder = ::mkdtemp(name) == nullptr ? "" : name;
  touch("fw0", true);
  touch("fw1", true);
  active = this;
}

JujuEmulation::Impl::~Impl() {
  active = nullptr;
  for (auto& [fd, client] : clients)
    if (client.peer >= 0) real<int (*)(int)>("close")(client.peer);
  touch("fw0", false);
  touch("fw1", false);
  ::rmdir(folder.c_str());
}

void JujuEmulation::Impl::touch(const char* name, bool present) const {
  const std::string path = folder + "/" + name;
  if (!present) {
    ::unlink(path.c_str());
    return;
  }
  const int fd = real<int (*)(const char*, int, ...)>("open")(path.c_str(), O_CREAT | O_RDWR, 0600);
  if (fd >= 0) real<int (*)(int)>("close")(fd);
}

int JujuEmulation::Impl::open(const std::string& path) {
  const std::lock_guard<std::recursive_mutex> lock(mutex);
  if (::access((folder + path.substr(4)).c_str(), F_OK) != 0) return errno = ENOENT, -1;
  // As on real machines: the controller's node is for root only.
  if (denied || path == "/dev/fw0") return errno = EACCES, -1;
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET, 0, ends) != 0) return -1;
  clients[ends[0]].peer = ends[1];
  return ends[0];
}

int JujuEmulation::Impl::close(int fd) {
  const std::lock_guard<std::recursive_mutex> lock(mutex);
  if (clients[fd].peer >= 0) real<int (*)(int)>("close")(clients[fd].peer);
  clients.erase(fd);
  return real<int (*)(int)>("close")(fd);
}

void JujuEmulation::Impl::send(Client& client, const void* event, std::size_t bytes) const {
  if (!client.gone)
    static_cast<void>(::send(client.peer, event, bytes, MSG_DONTWAIT | MSG_NOSIGNAL));
}

void JujuEmulation::Impl::resetBus() {
  ++generation;
  if (!full_for_ever) full = false;
  fw_cdev_event_bus_reset event{};
  event.type = FW_CDEV_EVENT_BUS_RESET;
  event.node_id = 0xFFC1;
  event.generation = generation;
  for (auto& [fd, client] : clients) send(client, &event, sizeof event);
}

/// One quadlet; returns the response code.
std::uint32_t JujuEmulation::Impl::access(std::uint64_t address, bool write, std::uint32_t* value) {
  if (address >= kCommandBase) {
    if (write)
      return registers.write(address - kCommandBase, *value) ? RCODE_COMPLETE : RCODE_ADDRESS_ERROR;
    const auto read = registers.read(address - kCommandBase);
    *value = read.value_or(0);
    return read ? RCODE_COMPLETE : RCODE_ADDRESS_ERROR;
  }
  if (write || address < kRomBase || address >= kRomBase + 4 * rom.size())
    return RCODE_ADDRESS_ERROR;
  *value = rom[(address - kRomBase) / 4];
  return RCODE_COMPLETE;
}

int JujuEmulation::Impl::request(Client& client, const fw_cdev_send_request& request) {
  const bool write =
      request.tcode == TCODE_WRITE_QUADLET_REQUEST || request.tcode == TCODE_WRITE_BLOCK_REQUEST;
  const std::size_t quadlets = request.length / 4;
  std::vector<std::uint32_t> event(sizeof(fw_cdev_event_response) / 4 + quadlets);
  auto* response = reinterpret_cast<fw_cdev_event_response*>(event.data());
  response->closure = request.closure;
  response->type = FW_CDEV_EVENT_RESPONSE;
  if (request.generation != generation) {
    response->rcode = RCODE_GENERATION;
  } else {
    const auto* data = reinterpret_cast<const std::uint32_t*>(request.data);
    for (std::size_t i = 0; i < quadlets && response->rcode == RCODE_COMPLETE; ++i) {
      std::uint32_t value = write ? bigEndian(data[i]) : 0;
      response->rcode = access(request.offset + 4 * i, write, &value);
      response->data[i] = bigEndian(value);
    }
  }
  if (!write && response->rcode == RCODE_COMPLETE) response->length = request.length;
  send(client, event.data(), offsetof(fw_cdev_event_response, data) + response->length);
  return 0;
}

int JujuEmulation::Impl::allocate(Client& client, fw_cdev_allocate_iso_resource* request) {
  // The smallest free number, as the kernel gives it. libdc1394 2.2.6 depends on it: it passes the
  // handle at the wrong place of the structure when it releases, so that it always says 0.
  std::uint32_t handle = 0;
  while (client.resources.count(handle) != 0) ++handle;
  request->handle = handle;
  fw_cdev_event_iso_resource event{};
  event.closure = request->closure;
  event.type = FW_CDEV_EVENT_ISO_RESOURCE_ALLOCATED;
  event.handle = request->handle;
  event.channel = full ? -1 : 0;
  event.bandwidth = full ? 0 : static_cast<std::int32_t>(request->bandwidth);
  if (!full) client.resources[request->handle] = request->closure;
  send(client, &event, sizeof event);
  return 0;
}

int JujuEmulation::Impl::deallocate(Client& client, std::uint32_t handle) {
  const auto resource = client.resources.find(handle);
  if (resource == client.resources.end()) return errno = EINVAL, -1;
  fw_cdev_event_iso_resource event{};
  event.type = FW_CDEV_EVENT_ISO_RESOURCE_DEALLOCATED;
  event.handle = handle;
  event.closure = resource->second;
  client.resources.erase(resource);
  send(client, &event, sizeof event);
  return 0;
}

int JujuEmulation::Impl::queue(Client& client, const fw_cdev_queue_iso& request) {
  const auto* packets = reinterpret_cast<const fw_cdev_iso_packet*>(request.packets);
  const std::size_t count = request.size / sizeof *packets;
  QueuedBuffer buffer;
  buffer.data = reinterpret_cast<std::uint8_t*>(request.data);
  std::size_t payload = 0;
  for (std::size_t i = 0; i < count; ++i) {
    payload += packets[i].control & 0xFFFF;
    buffer.packets += (packets[i].control >> 24) / 8;  // 8 bytes of header each
  }
  if (buffer.packets == 0) return errno = EINVAL, -1;
  buffer.packet_bytes = payload / buffer.packets;
  client.queue.push_back(buffer);
  return 0;
}

int JujuEmulation::Impl::ioctl(int fd, unsigned long number, void* argument) {
  const std::lock_guard<std::recursive_mutex> lock(mutex);
  Client& client = clients[fd];
  if (client.gone) return errno = ENODEV, -1;
  switch (number) {
    case FW_CDEV_IOC_GET_INFO: {
      auto* info = static_cast<fw_cdev_get_info*>(argument);
      info->version = 5;
      if (info->rom != 0)
        std::copy_n(reinterpret_cast<const std::uint8_t*>(rom.data()),
                    std::min<std::size_t>(info->rom_length, 4 * rom.size()),
                    reinterpret_cast<std::uint8_t*>(info->rom));
      info->rom_length = static_cast<std::uint32_t>(4 * rom.size());
      if (info->bus_reset != 0) {
        auto* reset = reinterpret_cast<fw_cdev_event_bus_reset*>(info->bus_reset);
        *reset = {};
        reset->node_id = 0xFFC1;
        reset->generation = generation;
      }
      return 0;
    }
    case FW_CDEV_IOC_SEND_REQUEST:
      return request(client, *static_cast<fw_cdev_send_request*>(argument));
    case FW_CDEV_IOC_ALLOCATE_ISO_RESOURCE:
      return allocate(client, static_cast<fw_cdev_allocate_iso_resource*>(argument));
    case FW_CDEV_IOC_DEALLOCATE_ISO_RESOURCE:
      return deallocate(client, static_cast<fw_cdev_deallocate*>(argument)->handle);
    case FW_CDEV_IOC_CREATE_ISO_CONTEXT:
      static_cast<fw_cdev_create_iso_context*>(argument)->handle = 0;
      return 0;
    case FW_CDEV_IOC_QUEUE_ISO:
      return queue(client, *static_cast<fw_cdev_queue_iso*>(argument));
    case FW_CDEV_IOC_START_ISO:
      return client.started = true, 0;
    case FW_CDEV_IOC_STOP_ISO:
      return client.started = false, 0;
    case FW_CDEV_IOC_INITIATE_BUS_RESET:
      return ++bus_resets_asked, resetBus(), 0;
    case FW_CDEV_IOC_GET_CYCLE_TIMER: {
      auto* timer = static_cast<fw_cdev_get_cycle_timer*>(argument);
      timer->local_time = static_cast<std::uint64_t>(now());
      timer->cycle_timer = busTime(static_cast<std::int64_t>(timer->local_time));
      return 0;
    }
    default:
      return errno = EINVAL, -1;
  }
}

JujuEmulation::JujuEmulation() : impl_(std::make_unique<Impl>()) {}
JujuEmulation::~JujuEmulation() = default;
RegisterMap& JujuEmulation::registers() { return impl_->registers; }
std::uint64_t JujuEmulation::guid() const { return kGuid; }

void JujuEmulation::unplug() {
  const std::lock_guard<std::recursive_mutex> lock(impl_->mutex);
  impl_->touch("fw1", false);
  for (auto& [fd, client] : impl_->clients) {
    client.gone = true;
    client.resources.clear();
    if (client.peer >= 0) real<int (*)(int)>("close")(client.peer);
    client.peer = -1;
  }
}
void JujuEmulation::plug() { impl_->touch("fw1", true); }
void JujuEmulation::removeController() {
  unplug();
  impl_->touch("fw0", false);
}
void JujuEmulation::denyAccess(bool denied) { impl_->denied = denied; }
void JujuEmulation::resetBus() {
  const std::lock_guard<std::recursive_mutex> lock(impl_->mutex);
  impl_->resetBus();
}
void JujuEmulation::fillBus(bool permanent) {
  impl_->full = true;
  impl_->full_for_ever = permanent;
}

bool JujuEmulation::sendFrame(const std::vector<std::uint8_t>& bytes, std::int64_t age_us) {
  const std::lock_guard<std::recursive_mutex> lock(impl_->mutex);
  if ((impl_->registers.get(0x614) & 0x80000000) == 0) return false;
  for (auto& [fd, client] : impl_->clients) {
    if (!client.started || client.gone || client.queue.empty()) continue;
    const QueuedBuffer buffer = client.queue.front();
    client.queue.pop_front();
    std::copy_n(bytes.begin(), std::min(bytes.size(), buffer.packets * buffer.packet_bytes),
                buffer.data);
    std::vector<std::uint32_t> event(sizeof(fw_cdev_event_iso_interrupt) / 4 + 2 * buffer.packets);
    auto* interrupt = reinterpret_cast<fw_cdev_event_iso_interrupt*>(event.data());
    const std::int64_t start = now() - age_us;
    impl_->last_start = start;
    interrupt->type = FW_CDEV_EVENT_ISO_INTERRUPT;
    interrupt->cycle = busTime(now()) >> 12 & 0xFFFF;
    interrupt->header_length = static_cast<std::uint32_t>(8 * buffer.packets);
    for (std::size_t i = 0; i < buffer.packets; ++i) {
      interrupt->header[2 * i] = bigEndian(static_cast<std::uint32_t>(buffer.packet_bytes) << 16);
      interrupt->header[2 * i + 1] =
          bigEndian(busTime(start + 125 * static_cast<std::int64_t>(i)) >> 12 & 0xFFFF);
    }
    impl_->send(client, event.data(),
                offsetof(fw_cdev_event_iso_interrupt, header) + interrupt->header_length);
    return true;
  }
  return false;
}

std::int64_t JujuEmulation::lastStart() const { return impl_->last_start; }

std::size_t JujuEmulation::freeBuffers() const {
  const std::lock_guard<std::recursive_mutex> lock(impl_->mutex);
  std::size_t count = 0;
  for (const auto& [fd, client] : impl_->clients) count += client.queue.size();
  return count;
}
std::size_t JujuEmulation::openFiles() const { return impl_->clients.size(); }
std::size_t JujuEmulation::isoResources() const {
  std::size_t count = 0;
  for (const auto& [fd, client] : impl_->clients) count += client.resources.size();
  return count;
}
std::size_t JujuEmulation::mappedBytes() const {
  std::size_t bytes = 0;
  for (const auto& [address, size] : impl_->mappings) bytes += size;
  return bytes;
}
int JujuEmulation::busResetsAsked() const { return impl_->bus_resets_asked; }

}  // namespace scanner::bumblebee
