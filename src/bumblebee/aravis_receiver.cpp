#include "bumblebee/aravis_receiver.h"

#include <pthread.h>
#include <sched.h>

#include <algorithm>

namespace scanner::bumblebee::aravis {
namespace {

/// A modest real-time priority where the system permits it: what the kernel's socket buffer cannot
/// hold while this thread waits for its turn is lost.
void raisePriority() {
  sched_param parameters{};
  parameters.sched_priority = 10;
  ::pthread_setschedparam(::pthread_self(), SCHED_RR | SCHED_RESET_ON_FORK, &parameters);
}

}  // namespace

void Receiver::begin(ArvStream* stream, std::uint64_t packets_per_frame, std::size_t most_waiting) {
  const std::lock_guard<std::mutex> lock(mutex_);
  stream_ = stream;
  frame_packets_ = packets_per_frame;
  frame_packets_sure_ = false;
  most_waiting_ = most_waiting;
  counted_packets_ = overruns_ = lost_packets_ = 0;
}

void Receiver::end() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stream_ = nullptr;
    waiting_.clear();
  }
  news_.notify_all();
}

void Receiver::recycle(Object<ArvBuffer> buffer) {
  const std::lock_guard<std::mutex> lock(mutex_);
  recycleLocked(std::move(buffer));
}

void Receiver::recycleLocked(Object<ArvBuffer> buffer) {
  if (stream_ == nullptr) return;
  arv_buffer_set_frame_id(buffer.get(), kUnknownId);
  arv_buffer_set_timestamp(buffer.get(), 0);
  arv_stream_push_buffer(stream_, buffer.release());
}

Receiver::Wake Receiver::waitFor(std::chrono::steady_clock::time_point deadline, Arrival& arrival) {
  std::unique_lock<std::mutex> lock(mutex_);
  news_.wait_until(lock, deadline,
                   [this] { return !waiting_.empty() || stream_ == nullptr || gone_; });
  if (!waiting_.empty()) {
    arrival = std::move(waiting_.front());
    waiting_.pop_front();
    return Wake::kFrame;
  }
  if (gone_) return Wake::kGone;
  return stream_ == nullptr ? Wake::kStopped : Wake::kTime;
}

void Receiver::lose(const std::string& reason) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!gone_) reason_ = reason;
    gone_ = true;
  }
  news_.notify_all();
}

bool Receiver::gone() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return gone_;
}

std::string Receiver::reason() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return reason_;
}

std::uint64_t Receiver::overruns() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return overruns_;
}

std::uint64_t Receiver::lostPackets() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return lost_packets_;
}

void Receiver::onStream(void* shared, ArvStreamCallbackType type, ArvBuffer* /*buffer*/) {
  if (type == ARV_STREAM_CALLBACK_TYPE_INIT) raisePriority();
  if (type != ARV_STREAM_CALLBACK_TYPE_BUFFER_DONE) return;
  (*static_cast<std::shared_ptr<Receiver>*>(shared))->take();
}

void Receiver::onControlLost(ArvDevice* /*device*/, void* shared) {
  (*static_cast<std::shared_ptr<Receiver>*>(shared))
      ->lose("camera is gone: it no longer takes orders from here (unplugged, or restarted)");
}

/// Aravis has put the buffer into the stream's own queue before it calls. Its system time stamp
/// cannot serve as the arrival: that is the moment of the first packet.
void Receiver::take() {
  const Time now = wallClock();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (stream_ == nullptr) return;  // Aravis frees what is in its queue
    Arrival arrival;
    arrival.buffer.reset(arv_stream_try_pop_buffer(stream_));
    if (!arrival.buffer) return;
    arrival.time = now;
    countPackets(arrival);
    waiting_.push_back(std::move(arrival));
    if (waiting_.size() > most_waiting_) {  // nobody grabs: the newest are worth more
      recycleLocked(std::move(waiting_.front().buffer));
      waiting_.pop_front();
      ++overruns_;
    }
  }
  news_.notify_all();
}

/// Aravis' own count of missing packets takes all after the first gap for missing. Runs in the
/// thread that counts, so the figures belong together.
void Receiver::countPackets(Arrival& arrival) {
  if (frame_packets_ == 0) return;
  const auto info = [this](const char* name) {
    return arv_stream_get_info_uint64_by_name(stream_, name);
  };
  const std::uint64_t useless =
      info("n_duplicated_packets") + info("n_ignored_packets") + info("n_error_packets");
  const std::uint64_t all = info("n_received_packets");
  const std::uint64_t received = all - std::min(all, useless);
  const ArvBufferStatus status = arv_buffer_get_status(arrival.buffer.get());
  // The first packet of the next frame is what ends an incomplete one, unless time does.
  const std::uint64_t next = status == ARV_BUFFER_STATUS_MISSING_PACKETS ? 1 : 0;
  std::uint64_t own = received - std::min(received, counted_packets_ + next);
  if (status == ARV_BUFFER_STATUS_SUCCESS) {
    if (!frame_packets_sure_ && own > 0) frame_packets_ = own;
    frame_packets_sure_ = true;
    own = frame_packets_;
  } else if (status != ARV_BUFFER_STATUS_ABORTED) {
    own = std::min(own, frame_packets_);
    arrival.missing = frame_packets_ - own;
  }
  counted_packets_ += own;
  arrival.packets = frame_packets_;
  lost_packets_ += arrival.missing;
}

}  // namespace scanner::bumblebee::aravis
