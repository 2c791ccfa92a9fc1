#include "scanner/simulation/emulated_bumblebee.h"

#include <arpa/inet.h>
#include <arv.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <optional>

/// What Aravis' fake camera (0.8.26) is not, and what follows:
///  - It binds to the address of an interface only: on the loopback interface to 127.0.0.1 and to
///  no
///    other 127.x.y.z. Whether it could bind to its control port it does not tell; we probe.
///  - It does not resend packets, has no test packets to negotiate their size with, no events, no
///    chunks, no hardware trigger, no per-frame exposure. Packets are lost by GLib's global random
///    numbers: a share, not a repeatable sequence.
///  - It notices a client that died only when the next one knocks, and streams to nobody meanwhile.
///  - Its register map ends at 10 dB of gain in whole steps; sizes end at 2048.
///  - Stereo specifics of a Bumblebee (IIDC registers, factory calibration, byte order of the
///    interleaving at 0x1048) do not exist in it.
namespace scanner::simulation {
namespace {

constexpr std::uint16_t kControlPort = 3956;       // GVCP
constexpr std::uint32_t kModelNameAddress = 0x68;  // of GigE Vision's bootstrap registers
constexpr std::size_t kModelNameSize = 32;
constexpr std::uint32_t kPacketSizeAddress = 0xd04;
/// The loopback interface takes packets of 64 kB; the default of 1400 bytes only costs time and
/// overruns the client's socket.
constexpr std::uint32_t kPacketBytes = 8192;
constexpr std::size_t kLongestSerial = 15;
constexpr int kLargestSide = 2048;
constexpr std::int64_t kLatestWakeUs = 100'000;  ///< of the camera's thread, after its time

/// Address of the interface that has this address or name.
in_addr resolveInterface(const std::string& interface) {
  ifaddrs* list = nullptr;
  if (::getifaddrs(&list) != 0) throw ConfigurationError("network interfaces cannot be listed");
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> owner(list, &::freeifaddrs);
  in_addr wanted{};
  const bool numeric = ::inet_pton(AF_INET, interface.c_str(), &wanted) == 1;
  for (const ifaddrs* entry = list; entry != nullptr; entry = entry->ifa_next) {
    if (entry->ifa_addr == nullptr || entry->ifa_addr->sa_family != AF_INET) continue;
    sockaddr_in address{};
    std::memcpy(&address, entry->ifa_addr, sizeof(address));
    const bool same = numeric ? address.sin_addr.s_addr == wanted.s_addr
                              : interface == static_cast<const char*>(entry->ifa_name);
    if (same) return address.sin_addr;
  }
  throw ConfigurationError("interface '" + interface + "' of the emulated camera: no local " +
                           "interface has this address or name");
}

bool controlPortIsFree(in_addr address) {
  const int descriptor = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0) return false;
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_port = htons(kControlPort);
  place.sin_addr = address;
  sockaddr generic{};
  static_assert(sizeof(generic) == sizeof(place));
  std::memcpy(&generic, &place, sizeof(place));
  const bool is_free = ::bind(descriptor, &generic, sizeof(generic)) == 0;
  ::close(descriptor);
  return is_free;
}

void check(bool ok, const std::string& what) {
  if (!ok) throw ConfigurationError("emulated camera: " + what);
}

bool isShare(double value) { return value >= 0.0 && value <= 1.0; }

}  // namespace

class EmulatedBumblebee::Impl {
 public:
  Impl(const Options& options, FrameSource source)
      : options_(options), source_(std::move(source)), lost_packets_(options.lost_packets) {
    check(options.width_px > 0 && options.width_px <= kLargestSide && options.height_px > 0 &&
              options.height_px <= kLargestSide,
          "width and height lie within 1 .. 2048 pixels");
    check(!options.serial.empty() && options.serial.size() <= kLongestSerial,
          "the serial number has 1 .. 15 characters");
    check(isShare(options.lost_packets), "the share of lost packets lies within 0 .. 1");
    check(options.rate_hz >= 0.1 && options.rate_hz <= 1000.0, "0.1 .. 1000 frames per second");
    check(options.exposure.exposure_s >= 10e-6 && options.exposure.exposure_s <= 10.0,
          "the exposure lies within 10 us .. 10 s");
    check(options.exposure.gain_db >= 0.0 && options.exposure.gain_db <= 10.0,
          "the gain lies within 0 .. 10 dB");
    check(source_ != nullptr, "a source of frames is needed");
    plug();
  }
  ~Impl() { unplug(); }

  void plug() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (camera_ != nullptr) return;
    const in_addr address = resolveInterface(options_.interface);
    const std::string where = "port 3956 of '" + options_.interface + "'";
    check(controlPortIsFree(address), where + " is in use");
    taken_ = 0;
    refused_ = 0;
    ArvGvFakeCamera* camera =
        arv_gv_fake_camera_new(options_.interface.c_str(), options_.serial.c_str());
    if (camera == nullptr || arv_gv_fake_camera_is_running(camera) == FALSE ||
        controlPortIsFree(address)) {
      g_clear_object(&camera);
      check(false, where + " cannot be served");
    }
    {
      const std::lock_guard<std::mutex> frame(frame_mutex_);
      camera_ = camera;
      plugged_ = true;
    }
    writeRegisters();
    arv_fake_camera_set_fill_pattern(arv_gv_fake_camera_get_fake_camera(camera_), &Impl::fill,
                                     this);
  }

  void unplug() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (camera_ == nullptr) return;
    {
      // Nothing leaves any more, not even the rest of a frame; and fill() must not touch an object
      // that is being destroyed.
      const std::lock_guard<std::mutex> frame(frame_mutex_);
      plugged_ = false;
      setLostRatio(1.0);
    }
    unplugged_.notify_all();
    g_object_unref(camera_);  // ends its thread and closes its sockets
    camera_ = nullptr;
  }

  void setLostPackets(double share) {
    check(isShare(share), "the share of lost packets lies within 0 .. 1");
    lost_packets_ = share;
  }

  std::uint64_t taken() const { return taken_; }
  std::uint64_t refused() const { return refused_; }
  Time frameTime() const { return fromNanoseconds(1000 * frame_us_); }

 private:
  void writeRegisters();
  void setLostRatio(double ratio) { g_object_set(camera_, "gvsp-lost-ratio", ratio, nullptr); }
  static void fill(ArvBuffer* buffer, void* self, guint32 exposure_us, guint32 gain,
                   ArvPixelFormat format);
  std::int64_t frameStart() const;
  bool take(ArvBuffer* buffer, const Exposure& exposure);

  const Options options_;
  const FrameSource source_;
  std::mutex mutex_;        ///< of camera_; locked before frame_mutex_
  std::mutex frame_mutex_;  ///< a frame is being taken
  std::condition_variable unplugged_;
  bool plugged_ = false;
  ArvGvFakeCamera* camera_ = nullptr;
  std::atomic<double> lost_packets_;
  std::atomic<std::uint64_t> taken_{0}, refused_{0};
  std::atomic<std::int64_t> frame_us_{0};  ///< wall clock
};

void EmulatedBumblebee::Impl::writeRegisters() {
  ArvFakeCamera* registers = arv_gv_fake_camera_get_fake_camera(camera_);
  const auto write = [registers](std::uint32_t address, double value) {
    arv_fake_camera_write_register(registers, address,
                                   static_cast<std::uint32_t>(std::lround(value)));
  };
  write(ARV_FAKE_CAMERA_REGISTER_SENSOR_WIDTH, options_.width_px);
  write(ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT, options_.height_px);
  write(ARV_FAKE_CAMERA_REGISTER_WIDTH, options_.width_px);
  write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, options_.height_px);
  write(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT, ARV_PIXEL_FORMAT_MONO_16);
  write(ARV_FAKE_CAMERA_REGISTER_ACQUISITION_FRAME_PERIOD_US, 1e6 / options_.rate_hz);
  write(ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US, 1e6 * options_.exposure.exposure_s);
  write(ARV_FAKE_CAMERA_REGISTER_GAIN_RAW, options_.exposure.gain_db);
  write(kPacketSizeAddress, kPacketBytes);
  char model[kModelNameSize] = "Bumblebee2";
  arv_fake_camera_write_memory(registers, kModelNameAddress, kModelNameSize, model);
}

/// The moment on the grid of frames that the camera's thread woke up for, in us of the wall clock.
/// That it woke a little later is the emulation's trouble and no camera's.
std::int64_t EmulatedBumblebee::Impl::frameStart() const {
  guint32 period_us = 0;
  arv_fake_camera_read_register(arv_gv_fake_camera_get_fake_camera(camera_),
                                ARV_FAKE_CAMERA_REGISTER_ACQUISITION_FRAME_PERIOD_US, &period_us);
  const std::int64_t now_us = g_get_real_time();
  const std::int64_t late_us = period_us == 0 ? 0 : now_us % static_cast<std::int64_t>(period_us);
  // Off the grid: the rate was changed a moment ago.
  return late_us < kLatestWakeUs && now_us - late_us > frame_us_ ? now_us - late_us : now_us;
}

/// Runs in the camera's thread before a frame is sent, with the settings of that moment. The share
/// of lost packets is set here because that thread reads it; losing all of them is the way not to
/// send a frame that the camera does not have.
void EmulatedBumblebee::Impl::fill(ArvBuffer* buffer, void* self, guint32 exposure_us, guint32 gain,
                                   ArvPixelFormat format) {
  auto* const camera = static_cast<Impl*>(self);
  std::unique_lock<std::mutex> frame(camera->frame_mutex_);
  if (!camera->plugged_) return;
  camera->frame_us_ = camera->frameStart();
  arv_buffer_set_timestamp(buffer, static_cast<guint64>(1000 * camera->frame_us_));
  const Exposure exposure{1e-6 * exposure_us, static_cast<double>(gain)};
  const bool good = format == ARV_PIXEL_FORMAT_MONO_16 && camera->take(buffer, exposure);
  ++(good ? camera->taken_ : camera->refused_);
  camera->setLostRatio(good ? camera->lost_packets_.load() : 1.0);
  using Clock = std::chrono::system_clock;
  const Clock::time_point exposed(std::chrono::duration_cast<Clock::duration>(
      std::chrono::microseconds(camera->frame_us_) + std::chrono::microseconds(exposure_us)));
  camera->unplugged_.wait_until(frame, exposed, [camera] { return !camera->plugged_; });
}

bool EmulatedBumblebee::Impl::take(ArvBuffer* buffer, const Exposure& exposure) {
  const cv::Rect region(arv_buffer_get_image_x(buffer), arv_buffer_get_image_y(buffer),
                        arv_buffer_get_image_width(buffer), arv_buffer_get_image_height(buffer));
  const cv::Rect sensor(0, 0, options_.width_px, options_.height_px);
  if ((region & sensor) != region || region.empty()) return false;
  try {  // the caller is C
    const StereoFrame frame = source_(taken_, exposure);
    if (frame.left.data.size() != sensor.size()) return false;
    const cv::Mat interleaved = interleave(frame.left.data, frame.right.data);
    size_t unused = 0;
    void* const bytes = const_cast<void*>(arv_buffer_get_data(buffer, &unused));
    interleaved(region).copyTo(cv::Mat(region.size(), CV_16UC1, bytes));
    return true;
  } catch (...) {
    return false;
  }
}

EmulatedBumblebee::EmulatedBumblebee(const Options& options, FrameSource source)
    : impl_(std::make_unique<Impl>(options, std::move(source))) {}
EmulatedBumblebee::~EmulatedBumblebee() = default;
void EmulatedBumblebee::setLostPackets(double share) { impl_->setLostPackets(share); }
void EmulatedBumblebee::unplug() { impl_->unplug(); }
void EmulatedBumblebee::plug() { impl_->plug(); }
Time EmulatedBumblebee::frameTime() const { return impl_->frameTime(); }
std::uint64_t EmulatedBumblebee::framesTaken() const { return impl_->taken(); }
std::uint64_t EmulatedBumblebee::framesRefused() const { return impl_->refused(); }

cv::Mat interleave(const cv::Mat& left, const cv::Mat& right) {
  if (left.size() != right.size() || left.type() != CV_8UC1 || right.type() != CV_8UC1) {
    throw ConfigurationError("pictures of the two eyes differ in size or are not 8 bit");
  }
  cv::Mat interleaved(left.size(), CV_16UC1);
  for (int y = 0; y < left.rows; ++y) {
    const auto* l = left.ptr<std::uint8_t>(y);
    const auto* r = right.ptr<std::uint8_t>(y);
    auto* out = interleaved.ptr<std::uint16_t>(y);
    for (int x = 0; x < left.cols; ++x) {
      out[x] = static_cast<std::uint16_t>(l[x] | (static_cast<unsigned>(r[x]) << 8U));
    }
  }
  return interleaved;
}

std::pair<cv::Mat, cv::Mat> deinterleave(const cv::Mat& interleaved) {
  if (interleaved.type() != CV_16UC1) {
    throw ConfigurationError("an interleaved stereo picture has one channel of 16 bit");
  }
  cv::Mat left(interleaved.size(), CV_8UC1);
  cv::Mat right(interleaved.size(), CV_8UC1);
  for (int y = 0; y < interleaved.rows; ++y) {
    const auto* in = interleaved.ptr<std::uint16_t>(y);
    auto* l = left.ptr<std::uint8_t>(y);
    auto* r = right.ptr<std::uint8_t>(y);
    for (int x = 0; x < interleaved.cols; ++x) {
      l[x] = static_cast<std::uint8_t>(in[x] & 0xFFU);
      r[x] = static_cast<std::uint8_t>(in[x] >> 8U);
    }
  }
  return {left, right};
}

}  // namespace scanner::simulation
