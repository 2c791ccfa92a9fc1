#include "bumblebee/aravis_camera.h"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <limits>

#include "bumblebee/aravis_features.h"

namespace scanner::bumblebee::aravis {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// An incomplete frame waits this long for its last packet, unless the next frame comes.
constexpr guint kFrameRetentionUs = 300'000;
constexpr std::uint64_t kLargestShortId = 65535;
/// IP, UDP and GigE Vision headers of a packet that carries pixels; leader and trailer carry none.
constexpr std::uint64_t kPacketOverhead = 20 + 8 + 8, kPacketsWithoutPixels = 2;
constexpr int kFewestBuffers = 3;
constexpr int kProbes = 4;
constexpr Duration kProbePatience = milliseconds(500);

/// Whether a plain socket may hold two frames. Then it is better than Aravis' packet socket, which
/// copies in blocks and delivers late; else that one, where permitted, is safer.
bool plainSocketHolds(std::size_t bytes) {
  const int descriptor = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0) return false;
  const int wanted = static_cast<int>(std::min<std::size_t>(bytes, 1U << 30U));
  int granted = 0;
  socklen_t size = sizeof(granted);
  const bool known =
      ::setsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &wanted, sizeof(wanted)) == 0 &&
      ::getsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &granted, &size) == 0;
  ::close(descriptor);
  return known && granted / 2 >= wanted;  // the kernel doubles it for its own book-keeping
}

bool packetSocketIsPermitted() {
  const int descriptor = ::socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, 0);
  if (descriptor < 0) return false;
  ::close(descriptor);
  return true;
}

std::shared_ptr<Receiver>* share(const std::shared_ptr<Receiver>& receiver) {
  return new std::shared_ptr<Receiver>(receiver);
}
void unshare(void* shared) { delete static_cast<std::shared_ptr<Receiver>*>(shared); }
void unshareClosure(gpointer shared, GClosure* /*closure*/) { unshare(shared); }

bool isImage(ArvBuffer* buffer) {
  const ArvBufferPayloadType type = arv_buffer_get_payload_type(buffer);
  return type == ARV_BUFFER_PAYLOAD_TYPE_IMAGE ||
         type == ARV_BUFFER_PAYLOAD_TYPE_EXTENDED_CHUNK_DATA;
}

const char* describeStatus(ArvBufferStatus status) {
  switch (status) {
    case ARV_BUFFER_STATUS_TIMEOUT:
      return "its end did not come in time";
    case ARV_BUFFER_STATUS_MISSING_PACKETS:
      return "packets missing";
    case ARV_BUFFER_STATUS_WRONG_PACKET_ID:
      return "packets numbered wrongly";
    case ARV_BUFFER_STATUS_SIZE_MISMATCH:
      return "larger than the format says";
    default:
      return "not complete";
  }
}

}  // namespace

Camera::Camera(Object<ArvCamera> camera, CameraIdentity identity, std::string gige_address,
               const TransportOptions& options)
    : identity_(std::move(identity)),
      gige_address_(std::move(gige_address)),
      options_(options),
      receiver_(std::make_shared<Receiver>()),
      camera_(std::move(camera)),
      capabilities_(readCapabilities(camera_.get())) {
  lost_handler_ = g_signal_connect_data(arv_camera_get_device(camera_.get()), "control-lost",
                                        G_CALLBACK(&Receiver::onControlLost), share(receiver_),
                                        &unshareClosure, static_cast<GConnectFlags>(0));
}

Camera::~Camera() {
  stop();
  g_signal_handler_disconnect(arv_camera_get_device(camera_.get()), lost_handler_);
  if (receiver_->gone()) {
    freeLater([camera = camera_.release()] { g_object_unref(camera); });
  }
}

Status Camera::judge(Status status) const {
  if (status.code() == StatusCode::kIoError && !stillThere()) {
    receiver_->lose("camera is gone: " + status.message());
  }
  return status;
}

bool Camera::stillThere() const {
  if (receiver_->gone()) return false;
  if (!gige_address_.empty()) return probeGigE(gige_address_, kProbes, kProbePatience).answers;
  const std::lock_guard<std::mutex> lock(control_mutex_);
  guint32 version = 0;  // the first register of every USB3 Vision camera
  return arv_device_read_memory(arv_camera_get_device(camera_.get()), 0, sizeof(version), &version,
                                nullptr) != FALSE;
}

Result<FrameFormat> Camera::configure(int width_px, int height_px, const Controls& controls) {
  if (width_px < 0 || height_px < 0) {
    return Status(StatusCode::kInvalidInput, "the size of a picture cannot be negative");
  }
  if (receiver_->gone()) return goneStatus();
  Status status;
  {
    const std::lock_guard<std::mutex> lock(control_mutex_);
    if (stream_) return Status(StatusCode::kInvalidInput, "camera streams: stop it first");
    format_ = FrameFormat();
    ArvCamera* const camera = camera_.get();
    status = selectStereoFormat(camera);
    if (status) status = selectSize(camera, width_px, height_px);
    if (status && !gige_address_.empty()) status = selectPacketSize(camera, options_.packet_bytes);
    Error error;
    if (status && arv_camera_is_feature_available(camera, "AcquisitionMode", nullptr) != FALSE) {
      arv_camera_set_acquisition_mode(camera, ARV_ACQUISITION_MODE_CONTINUOUS, error.out());
      status = error.status("continuous acquisition");
    }
    if (status) status = applyControls(camera, capabilities_, controls);
    gint width = 0;
    gint height = 0;
    if (status) {
      arv_camera_get_region(camera, nullptr, nullptr, &width, &height, error.out());
      status = error.status("size of the picture");
    }
    if (status) {
      format_.pixels = readTile(camera);
      format_.order = ByteOrder::kLeftFirst;  // Mono16 is little-endian, the left eye's byte is low
      format_.width_px = width;
      format_.height_px = height;
      return format_;
    }
  }
  return judge(status);
}

Status Camera::start() {
  if (receiver_->gone()) return goneStatus();
  Status status;
  {
    const std::lock_guard<std::mutex> lock(control_mutex_);
    if (format_.width_px == 0) return {StatusCode::kInvalidInput, "camera is not configured"};
    if (stream_) return Status::ok();
    Error error;
    const guint payload = arv_camera_get_payload(camera_.get(), error.out());
    status = error.status("size of a frame");
    if (status) status = openStream(payload);
    if (status) {
      arv_camera_start_acquisition(camera_.get(), error.out());
      status = error.status("start of the acquisition");
    }
  }
  if (!status) stop();
  return judge(status);
}

Status Camera::openStream(std::size_t payload) {
  const auto pixels =
      static_cast<std::size_t>(format_.width_px) * static_cast<std::size_t>(format_.height_px);
  if (payload < 2 * pixels) {
    return {StatusCode::kUnsupported, "camera announces frames of " + std::to_string(payload) +
                                          " bytes, too short for its size"};
  }
  std::uint64_t packets = 0;
  Error error;
  if (!gige_address_.empty()) {
    const bool plain = plainSocketHolds(2 * payload);
    short_of_memory_ = !plain && !packetSocketIsPermitted();
    arv_camera_gv_set_stream_options(
        camera_.get(),
        plain ? ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED : ARV_GV_STREAM_OPTION_NONE);
    const guint size = arv_camera_gv_get_packet_size(camera_.get(), error.out());
    if (error) return error.status("packet size");
    const std::uint64_t useful = size > kPacketOverhead ? size - kPacketOverhead : 1;
    packets = (payload + useful - 1) / useful + kPacketsWithoutPixels;
  }
  stream_.reset(arv_camera_create_stream_full(camera_.get(), &Receiver::onStream, share(receiver_),
                                              &unshare, error.out()));
  if (!stream_) return error.status("stream");
  tuneStream(payload);
  const int buffers = std::max(options_.buffers, kFewestBuffers);
  // Two stay with Aravis: one that is being filled, one for the frame behind it.
  receiver_->begin(stream_.get(), packets, static_cast<std::size_t>(buffers - 2));
  for (int i = 0; i < buffers; ++i) {
    receiver_->recycle(Object<ArvBuffer>(arv_buffer_new(payload, nullptr)));
  }
  frames_ = incomplete_ = bytes_ = 0;
  last_id_ = Receiver::kUnknownId;
  clock_sound_ = capabilities_.device_clock;
  last_device_ns_ = 0;
  double rate_hz = 0.0;
  if (capabilities_.rate_hz) rate_hz = arv_camera_get_frame_rate(camera_.get(), nullptr);
  const double silence_s = rate_hz > 0.0 ? std::clamp(3.0 / rate_hz, 1.0, 30.0) : 1.0;
  probe_interval_ = std::chrono::duration_cast<Clock::duration>(fromSeconds(silence_s));
  next_probe_ = Clock::now() + probe_interval_;
  return Status::ok();
}

/// Aravis asks again for lost packets where the camera can send them twice; that stays.
void Camera::tuneStream(std::size_t payload) {
  if (gige_address_.empty()) return;
  constexpr std::size_t kLargestSocketBuffer = std::size_t{64} << 20U;
  const auto buffer = static_cast<gint>(std::min(8 * payload, kLargestSocketBuffer));
  g_object_set(stream_.get(), "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED,
               "socket-buffer-size", buffer, "frame-retention", kFrameRetentionUs, nullptr);
}

void Camera::stop() {
  receiver_->end();
  const std::lock_guard<std::mutex> lock(control_mutex_);
  if (!stream_) return;
  if (!receiver_->gone()) {
    Error error;
    arv_camera_stop_acquisition(camera_.get(), error.out());
    if (error) receiver_->lose("camera is gone: " + error.status("stop").message());
  }
  if (receiver_->gone()) {
    freeLater([stream = stream_.release()] { g_object_unref(stream); });
  } else {
    stream_.reset();
  }
}

Result<RawFrame> Camera::grab(Duration timeout) {
  const Clock::time_point deadline = Clock::now() + timeout;
  for (;;) {
    Receiver::Arrival arrival;
    switch (receiver_->waitFor(std::min(deadline, next_probe_), arrival)) {
      case Receiver::Wake::kFrame:
        next_probe_ = Clock::now() + probe_interval_;
        return makeFrame(std::move(arrival));
      case Receiver::Wake::kGone:
        return goneStatus();
      case Receiver::Wake::kStopped:
        return Status(StatusCode::kOutOfRange, "camera does not stream");
      case Receiver::Wake::kTime:
        break;
    }
    if (Clock::now() >= next_probe_) {
      if (!stillThere()) receiver_->lose("camera is gone: it sends nothing and does not answer");
      next_probe_ = Clock::now() + probe_interval_;
      continue;
    }
    if (Clock::now() >= deadline) {
      return Status(StatusCode::kOutOfRange,
                    "no frame within " + std::to_string(toSeconds(timeout)) + " s");
    }
  }
}

RawFrame Camera::makeFrame(Receiver::Arrival arrival) {
  RawFrame frame;
  frame.arrival = arrival.time;
  ArvBuffer* const buffer = arrival.buffer.get();
  const bool numbered = arv_buffer_get_frame_id(buffer) != Receiver::kUnknownId;
  numberFrame(buffer, numbered, frame);
  const std::string name =
      frame.counter ? "frame " + std::to_string(*frame.counter) : std::string("frame");
  frame.status = checkBuffer(arrival, name);
  if (numbered) frame.device_time = deviceTime(buffer);
  if (frame.status) {
    std::size_t size = 0;
    const auto* bytes = static_cast<const std::uint8_t*>(arv_buffer_get_image_data(buffer, &size));
    frame.bytes = std::make_shared<const std::vector<std::uint8_t>>(bytes, bytes + size);
    ++frames_;
    bytes_ += size;
  } else {
    frame.bytes = std::make_shared<const std::vector<std::uint8_t>>();
    ++incomplete_;
  }
  receiver_->recycle(std::move(arrival.buffer));
  return frame;
}

Status Camera::checkBuffer(const Receiver::Arrival& arrival, const std::string& name) const {
  ArvBuffer* const buffer = arrival.buffer.get();
  const ArvBufferStatus status = arv_buffer_get_status(buffer);
  if (status != ARV_BUFFER_STATUS_SUCCESS) {
    std::string line = name + ": " + describeStatus(status);
    if (arrival.packets > 0) {
      line += " (" + std::to_string(arrival.missing) + " of " + std::to_string(arrival.packets) +
              " packets lost)";
    }
    if (short_of_memory_) line += "; net.core.rmem_max is too small for two frames";
    return {StatusCode::kNotEnoughData, line};
  }
  if (!isImage(buffer)) return {StatusCode::kUnsupported, name + ": does not carry a picture"};
  const ArvPixelFormat format = arv_buffer_get_image_pixel_format(buffer);
  if (format != ARV_PIXEL_FORMAT_MONO_16) {
    char code[16];
    g_snprintf(code, sizeof(code), "0x%08x", format);
    return {StatusCode::kUnsupported, name + ": pixel format " + code + " instead of Mono16"};
  }
  const int width = arv_buffer_get_image_width(buffer);
  const int height = arv_buffer_get_image_height(buffer);
  std::size_t size = 0;
  arv_buffer_get_image_data(buffer, &size);
  const std::size_t expected =
      2 * static_cast<std::size_t>(format_.width_px) * static_cast<std::size_t>(format_.height_px);
  if (width != format_.width_px || height != format_.height_px || size != expected) {
    return {StatusCode::kInvalidInput,
            name + ": " + std::to_string(width) + " x " + std::to_string(height) + " in " +
                std::to_string(size) + " bytes instead of " + std::to_string(format_.width_px) +
                " x " + std::to_string(format_.height_px) + " in " + std::to_string(expected)};
  }
  return Status::ok();
}

/// A frame whose leader was lost lies between its neighbours; the earliest number that it can have
/// keeps the sum of lost frames right.
void Camera::numberFrame(ArvBuffer* buffer, bool usable, RawFrame& frame) {
  const bool gige = !gige_address_.empty();
  std::uint64_t id = arv_buffer_get_frame_id(buffer);
  if (usable && id > kLargestShortId) extended_ids_ = true;
  const bool short_ids = gige && !extended_ids_;
  frame.counter_first = gige ? 1 : 0;
  frame.counter_max = short_ids ? kLargestShortId : std::numeric_limits<std::uint64_t>::max();
  if (!usable) {
    if (last_id_ == Receiver::kUnknownId) return;
    id = last_id_ == frame.counter_max ? frame.counter_first : last_id_ + 1;
  } else if (gige && id == 0) {
    return;  // a camera that does not count
  }
  last_id_ = id;
  frame.counter = id;
}

/// Once a clock has run backwards, nothing that it says is trusted until the next start.
std::optional<Duration> Camera::deviceTime(ArvBuffer* buffer) {
  const std::uint64_t stamp_ns = arv_buffer_get_timestamp(buffer);
  if (!clock_sound_ || stamp_ns == 0) return std::nullopt;
  if (stamp_ns <= last_device_ns_ ||
      stamp_ns > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())) {
    clock_sound_ = false;
    return std::nullopt;
  }
  last_device_ns_ = stamp_ns;
  return Duration(static_cast<std::int64_t>(stamp_ns));
}

Status Camera::setControls(const Controls& controls) {
  if (receiver_->gone()) return goneStatus();
  Status status;
  {
    const std::lock_guard<std::mutex> lock(control_mutex_);
    status = applyControls(camera_.get(), capabilities_, controls);
  }
  return judge(status);
}

Result<Controls> Camera::controls() const {
  if (receiver_->gone()) return goneStatus();
  std::unique_lock<std::mutex> lock(control_mutex_);
  Result<Controls> result = readControls(camera_.get(), capabilities_);
  lock.unlock();
  if (!result) return judge(result.status());
  return result;
}

Result<std::uint32_t> Camera::readRegister(std::uint64_t /*offset*/) const {
  return Status(StatusCode::kUnsupported, "a GenICam camera has no IIDC registers");
}

Status Camera::writeRegister(std::uint64_t /*offset*/, std::uint32_t /*value*/) {
  return {StatusCode::kUnsupported, "a GenICam camera has no IIDC registers"};
}

std::optional<double> Camera::temperatureC() const {
  if (!capabilities_.temperature || receiver_->gone()) return std::nullopt;
  const std::lock_guard<std::mutex> lock(control_mutex_);
  return readTemperature(camera_.get());
}

TransportStatistics Camera::statistics() const {
  TransportStatistics result;
  result.frames = frames_;
  result.incomplete = incomplete_;
  result.bytes = bytes_;
  result.overruns = receiver_->overruns();
  result.lost_packets = receiver_->lostPackets();
  return result;
}

}  // namespace scanner::bumblebee::aravis
