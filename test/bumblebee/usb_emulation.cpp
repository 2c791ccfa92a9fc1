#include "bumblebee/usb_emulation.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "bumblebee/usb_bus.h"

namespace scanner::bumblebee {
namespace {

constexpr std::uint64_t kRom = 0xFFFFF0000400, kCommand = 0xFFFFF0F00000;
constexpr std::size_t kPipe = 4096;

/// Device, configuration, interface (vendor specific), bulk endpoint 0x81.
constexpr std::array<unsigned char, 43> kDescriptors = {
    18, 1, 0,    2, 0, 0,    0, 64,   0x10, 0x1E, 0x00, 0x20, 0, 1, 0, 0, 0, 1,  //
    9,  2, 25,   0, 1, 1,    0, 0x80, 250,                                       //
    9,  4, 0,    0, 1, 0xFF, 0, 0,    0,                                         //
    7,  5, 0x81, 2, 0, 2,    0};

int failWith(int error) {
  errno = error;
  return -1;
}

}  // namespace

UsbEmulation::Impl* active_usb = nullptr;

UsbEmulation::Impl::Impl() {
  rom.assign(64, 0);
  const std::uint32_t words[] = {
      0x04040000, 0x31333934, 0,          0x00B09D01, 0x006C093B,  // bus information, GUID
      0x00020000, 0x0300B09D, 0xD1000001,                          // root: vendor, unit
      0x00030000, 0x1200A02D, 0x13000102, 0xD4000001,              // unit: IIDC 1.31
      0x00030000, 0x403C0000, 0x81000002, 0x82000006,              // registers, vendor, model
      0x00040000, 0,          0,          0x506F696E, 0x74000000,  // "Point"
      0x00050000, 0,          0,          0x42756D62, 0x6C656265, 0x65320000};  // "Bumblebee2"
  std::copy(std::begin(words), std::end(words), rom.begin());
  registers.set(0x1F28, 0xC);
  registers.set(RegisterMap::kFormat7, 1024U << 16 | 768);
  char name[] = "/tmp/usb_emulation_XXXXXX";
  folder = ::mkdtemp(name);
  describe();
  active_usb = this;
}

UsbEmulation::Impl::~Impl() {
  active_usb = nullptr;
  std::filesystem::remove_all(folder);
}

void UsbEmulation::Impl::describe() const {
  std::filesystem::create_directories(folder + "/sys/1-1");
  std::filesystem::create_directories(folder + "/dev");
  const auto put = [this](const std::string& name, const std::string& text) {
    std::ofstream(folder + "/sys/1-1/" + name) << text;
  };
  put("descriptors", std::string(kDescriptors.begin(), kDescriptors.end()));
  put("busnum", "1\n");
  put("devnum", std::to_string(device_number) + "\n");
  put("bConfigurationValue", "1\n");
  put("speed", "480\n");
}

bool UsbEmulation::Impl::owns(int fd) const {
  const std::lock_guard<std::mutex> lock(mutex);
  return files.count(fd) != 0;
}

bool UsbEmulation::Impl::present() const {
  const std::lock_guard<std::mutex> lock(mutex);
  return plugged;
}

std::string UsbEmulation::Impl::node() const {
  const std::lock_guard<std::mutex> lock(mutex);
  return "/dev/bus/usb/001/00" + std::to_string(device_number);
}

int UsbEmulation::Impl::open(const std::string& name) {
  const bool here = present() && name == node();
  const std::lock_guard<std::mutex> lock(mutex);
  if (!here) return failWith(ENOENT);
  if (denied) return failWith(EACCES);
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC | O_NONBLOCK) != 0) return -1;
  ::fcntl(ends[1], F_SETPIPE_SZ, kPipe);
  UsbFile& file = files[ends[1]];
  file.peer = ends[0];
  signal(ends[1], file);
  return ends[1];
}

int UsbEmulation::Impl::close(int fd) {
  const std::lock_guard<std::mutex> lock(mutex);
  static const auto next = realUsb<int (*)(int)>("close");
  if (!files[fd].gone) next(files[fd].peer);
  if (claimant == fd) claimant = -1;
  files.erase(fd);
  return next(fd);
}

/// Ready for output when something can be reaped.
void UsbEmulation::Impl::signal(int fd, const UsbFile& file) {
  if (file.gone) return;
  std::array<char, kPipe> bytes{};
  if (file.done.empty()) {
    while (::write(fd, bytes.data(), bytes.size()) > 0) continue;
  } else {
    while (::read(file.peer, bytes.data(), bytes.size()) > 0) continue;
  }
}

bool UsbEmulation::Impl::access(std::uint64_t address, bool write, std::uint32_t* value) {
  if (address >> 32 == 0xD000) {
    if (write)
      second_space[address] = *value;
    else
      *value = second_space[address];
    return true;
  }
  if (address >= kCommand) {
    if (write) return registers.write(address - kCommand, *value);
    const auto read = registers.read(address - kCommand);
    if (read) *value = *read;
    return read.has_value();
  }
  if (write || address < kRom || (address - kRom) / 4 >= rom.size()) return false;
  *value = rom[(address - kRom) / 4];
  return true;
}

void UsbEmulation::Impl::control(usbdevfs_urb* urb) {
  auto* setup = static_cast<unsigned char*>(urb->buffer);
  unsigned char* data = setup + 8;
  const auto word = [setup](int i) {
    return static_cast<std::uint64_t>(setup[i]) | static_cast<std::uint64_t>(setup[i + 1]) << 8;
  };
  const std::uint64_t space = setup[1] == 0x7F ? 0xFFFF : setup[1] == 0x80 ? 0xD000 : 0;
  const bool write = setup[0] == 0x40;
  std::uint32_t value = 0;
  for (int i = 3; write && i >= 0; --i) value = value << 8 | data[i];
  const bool valid = space != 0 && word(6) == 4 && (write || setup[0] == 0xC0) &&
                     access(space << 32 | word(4) << 16 | word(2), write, &value);
  urb->status = valid ? 0 : -EPIPE;
  urb->actual_length = valid ? 4 : 0;
  for (int i = 0; valid && !write && i < 4; ++i)
    data[i] = static_cast<unsigned char>(value >> (8 * i));
}

int UsbEmulation::Impl::submit(int fd, UsbFile& file, usbdevfs_urb* urb) {
  if (urb->type == USBDEVFS_URB_TYPE_CONTROL) {
    control(urb);
    file.done.push_back(urb);
    signal(fd, file);
    return 0;
  }
  if (urb->type != USBDEVFS_URB_TYPE_BULK || urb->endpoint != 0x81) return failWith(EINVAL);
  if (claimant != fd) return failWith(EINVAL);
  if (file.queued.size() >= limit) return failWith(ENOMEM);
  file.queued.push_back(urb);
  return 0;
}

int UsbEmulation::Impl::claim(int fd) {
  if (elsewhere || (claimant != -1 && claimant != fd)) return failWith(EBUSY);
  claimant = fd;
  return 0;
}

int UsbEmulation::Impl::ioctl(int fd, unsigned long request, void* argument) {
  const std::lock_guard<std::mutex> lock(mutex);
  UsbFile& file = files[fd];
  if (request == USBDEVFS_REAPURBNDELAY) {
    if (file.done.empty()) return failWith(file.gone ? ENODEV : EAGAIN);
    *static_cast<void**>(argument) = file.done.front();
    file.done.pop_front();
    signal(fd, file);
    return 0;
  }
  if (file.gone) return failWith(ENODEV);
  switch (request) {
    case USBDEVFS_GET_CAPABILITIES:
      *static_cast<std::uint32_t*>(argument) =
          USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION |
          USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_BULK_SCATTER_GATHER |
          USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
      return 0;
    case USBDEVFS_CLAIMINTERFACE:
    case USBDEVFS_DISCONNECT_CLAIM:
      return claim(fd);
    case USBDEVFS_RELEASEINTERFACE:
      if (claimant != fd) return failWith(EINVAL);
      claimant = -1;
      return 0;
    case USBDEVFS_SUBMITURB:
      return submit(fd, file, static_cast<usbdevfs_urb*>(argument));
    case USBDEVFS_DISCARDURB: {
      auto* urb = static_cast<usbdevfs_urb*>(argument);
      const auto found = std::find(file.queued.begin(), file.queued.end(), urb);
      if (found == file.queued.end()) return failWith(EINVAL);
      file.queued.erase(found);
      urb->status = -ENOENT;
      urb->actual_length = 0;
      file.done.push_back(urb);
      signal(fd, file);
      return 0;
    }
    case USBDEVFS_CLEAR_HALT:
      ++cleared;
      if (!file.queued.empty()) ++cleared_early;
      halted = false;
      return 0;
    case USBDEVFS_IOCTL:  // a kernel driver to attach again: there is none
      return failWith(ENODATA);
    default:
      return failWith(ENOTTY);
  }
}

bool UsbEmulation::Impl::complete(int status, const std::vector<std::uint8_t>& bytes) {
  const std::lock_guard<std::mutex> lock(mutex);
  const auto found = files.find(claimant);
  if (!plugged || halted || found == files.end() || found->second.queued.empty()) return false;
  if ((registers.get(0x614) & 0x80000000) == 0) return false;
  UsbFile& file = found->second;
  usbdevfs_urb* urb = file.queued.front();
  file.queued.pop_front();
  const std::size_t room = static_cast<std::size_t>(urb->buffer_length);
  const std::size_t sent = std::min(room, bytes.size());
  if (sent > 0) std::memcpy(urb->buffer, bytes.data(), sent);
  urb->actual_length = static_cast<int>(sent);
  urb->status = bytes.size() > room ? -EOVERFLOW : status;
  if (status == -EPIPE) halted = true;
  file.done.push_back(urb);
  signal(found->first, file);
  return true;
}

UsbEmulation::UsbEmulation() : impl_(std::make_unique<Impl>()) {}
UsbEmulation::~UsbEmulation() = default;

RegisterMap& UsbEmulation::registers() { return impl_->registers; }

void UsbEmulation::unplug() {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  static const auto close_file = realUsb<int (*)(int)>("close");
  impl_->plugged = impl_->halted = false;
  impl_->registers.set(0x614, 0);
  impl_->claimant = -1;
  for (auto& [fd, file] : impl_->files) {
    if (file.gone) continue;
    for (usbdevfs_urb* urb : file.queued) {
      urb->status = -ESHUTDOWN;
      urb->actual_length = 0;
      file.done.push_back(urb);
    }
    file.queued.clear();
    file.gone = true;
    close_file(file.peer);
  }
}

void UsbEmulation::plug() {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  ++impl_->device_number;
  impl_->plugged = true;
  impl_->describe();
}

void UsbEmulation::denyAccess(bool denied) { impl_->denied = denied; }
void UsbEmulation::claimElsewhere(bool claimed) { impl_->elsewhere = claimed; }
void UsbEmulation::limitTransfers(std::size_t number) { impl_->limit = number; }

bool UsbEmulation::send(const std::vector<std::uint8_t>& bytes) {
  return impl_->complete(0, bytes);
}
bool UsbEmulation::stall() { return impl_->complete(-EPIPE, {}); }

std::size_t UsbEmulation::queued() const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  std::size_t sum = 0;
  for (const auto& [fd, file] : impl_->files) sum += file.queued.size();
  return sum;
}

std::size_t UsbEmulation::unreaped() const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  std::size_t sum = 0;
  for (const auto& [fd, file] : impl_->files) sum += file.queued.size() + file.done.size();
  return sum;
}

std::size_t UsbEmulation::openFiles() const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->files.size();
}

int UsbEmulation::haltsCleared() const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->cleared;
}

int UsbEmulation::haltsClearedTooEarly() const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  return impl_->cleared_early;
}

}  // namespace scanner::bumblebee
