#include "mti/message_stream.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace scanner::mti {
namespace {

using Clock = std::chrono::steady_clock;

/// Longer announcements are damage: the largest message we ask for has 118 data bytes, MTData2 with
/// everything that exists stays below this.
constexpr std::size_t kLongestExpected = 512;
constexpr std::uint64_t kFifoBytes = 16;  ///< a receiver hands over so many at a time at most
constexpr std::size_t kMostReads = 4096;
constexpr double kWriteTimeoutS = 1.0;

std::uint64_t frameSize(const Message& message) {
  const std::uint64_t size = message.data.size();
  return size + (size < 0xFF ? 5 : 7);
}

}  // namespace

MessageStream::MessageStream(SerialPort port, const WakeUpCall& stop)
    : port_(std::move(port)), stop_(stop), parser_(kLongestExpected) {}

Result<std::optional<Incoming>> MessageStream::next(double seconds) {
  const Clock::time_point start = Clock::now();
  while (true) {
    if (std::optional<Message> message = parser_.next()) {
      return std::optional<Incoming>(annotate(std::move(*message)));
    }
    const double left = seconds - std::chrono::duration<double>(Clock::now() - start).count();
    if (left <= 0.0 || stopped()) return std::optional<Incoming>();
    if (const Status status = readMore(left); !status) return status;
  }
}

Status MessageStream::readMore(double seconds) {
  const Result<SerialPort::Chunk> chunk = port_.read(seconds);
  if (!chunk) return chunk.status();
  if (chunk->bytes.empty()) return Status::ok();
  parser_.push(chunk->bytes.data(), chunk->bytes.size());
  received_ += chunk->bytes.size();
  reads_.push_back({received_, chunk->before, chunk->after});
  if (reads_.size() > kMostReads) reads_.pop_front();
  return Status::ok();
}

/// Byte k of the message (from 1) is through k byte times after the first bit. A read that ends k
/// bytes into the message shows that byte k was through at its end, and that the next portion of
/// the receiver was not when it began.
Incoming MessageStream::annotate(Message message) {
  Incoming incoming;
  const std::uint64_t size = frameSize(message);
  in_messages_ += size;
  incoming.message = std::move(message);
  incoming.statistics = parser_.statistics();
  const std::uint64_t end = in_messages_ + incoming.statistics.skipped_bytes;
  const std::uint64_t begin = end - size;
  const double byte_s = port_.secondsPerByte();
  incoming.length_s = static_cast<double>(size) * byte_s;
  // The read before the first byte is still needed.
  while (reads_.size() > 1 && reads_[1].end <= begin) reads_.pop_front();
  for (const Read& read : reads_) {
    const std::uint64_t there = read.end > begin ? std::min(read.end - begin, size) : 0;
    if (there > 0) {
      incoming.first_bit.latest = std::min(
          incoming.first_bit.latest, read.after - fromSeconds(static_cast<double>(there) * byte_s));
    }
    if (there == size) {
      incoming.arrival = read.after;
      break;
    }
    const double missing = static_cast<double>(std::min(there + kFifoBytes, size));
    incoming.first_bit.earliest =
        std::max(incoming.first_bit.earliest, read.before - fromSeconds(missing * byte_s));
  }
  return incoming;
}

Status MessageStream::send(const Message& message) {
  return port_.write(encode(message), kWriteTimeoutS);
}

void MessageStream::discardInput() {
  port_.discardInput();
  while (parser_.next()) {
  }
  // What is left of a damaged frame must not swallow the next one.
  parser_ = MessageParser(kLongestExpected);
  reads_.clear();
  received_ = 0;
  in_messages_ = 0;
}

}  // namespace scanner::mti
