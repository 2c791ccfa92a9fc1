#include "scanner/mti/message.h"

#include <numeric>

#include "scanner/core/status.h"

namespace scanner::mti {
namespace {

constexpr std::uint8_t kPreamble = 0xFA;
constexpr std::uint8_t kBusId = 0xFF;
constexpr std::uint8_t kExtendedLength = 0xFF;

}  // namespace

std::vector<std::uint8_t> encode(const Message& message) {
  const std::size_t size = message.data.size();
  if (size > kLongestData) {
    throw ConfigurationError("MT message of " + std::to_string(size) + " data bytes, at most " +
                             std::to_string(kLongestData));
  }
  std::vector<std::uint8_t> bytes = {kPreamble, kBusId, message.id};
  if (size < kExtendedLength) {
    bytes.push_back(static_cast<std::uint8_t>(size));
  } else {
    bytes.push_back(kExtendedLength);
    bytes.push_back(static_cast<std::uint8_t>(size >> 8U));
    bytes.push_back(static_cast<std::uint8_t>(size & 0xFFU));
  }
  bytes.insert(bytes.end(), message.data.begin(), message.data.end());
  const unsigned sum = std::accumulate(bytes.begin() + 1, bytes.end(), 0U);
  bytes.push_back(static_cast<std::uint8_t>((0x100U - (sum & 0xFFU)) & 0xFFU));
  return bytes;
}

void MessageParser::push(const std::uint8_t* bytes, std::size_t count) {
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(begin_));
  begin_ = 0;
  buffer_.insert(buffer_.end(), bytes, bytes + count);
}

std::optional<Message> MessageParser::next() {
  while (true) {
    switch (inspect()) {
      case Candidate::kIncomplete:
        return std::nullopt;
      case Candidate::kNoFrame:
        skipByte();
        break;
      case Candidate::kWhole: {
        const auto frame = buffer_.begin() + static_cast<std::ptrdiff_t>(begin_);
        const auto data = frame + static_cast<std::ptrdiff_t>(data_offset_);
        Message message{*(frame + 2), {data, data + static_cast<std::ptrdiff_t>(data_size_)}};
        begin_ += data_offset_ + data_size_ + 1;
        ++statistics_.messages;
        return message;
      }
    }
  }
}

/// Whether a frame begins at begin_; sets data_offset_ and data_size_ when one does.
MessageParser::Candidate MessageParser::inspect() {
  const std::size_t available = buffer_.size() - begin_;
  const auto byte = [this](std::size_t i) { return buffer_[begin_ + i]; };
  if (available == 0) return Candidate::kIncomplete;
  if (byte(0) != kPreamble) return Candidate::kNoFrame;
  if (available < 2) return Candidate::kIncomplete;
  if (byte(1) != kBusId) return Candidate::kNoFrame;
  if (available < 4) return Candidate::kIncomplete;
  data_offset_ = 4;
  data_size_ = byte(3);
  if (data_size_ == kExtendedLength) {
    if (available < 6) return Candidate::kIncomplete;
    data_offset_ = 6;
    data_size_ = (static_cast<std::size_t>(byte(4)) << 8U) | byte(5);
  }
  if (data_size_ > longest_) return Candidate::kNoFrame;
  const std::size_t frame_size = data_offset_ + data_size_ + 1;
  if (available < frame_size) return Candidate::kIncomplete;
  unsigned sum = 0;
  for (std::size_t i = 1; i < frame_size; ++i) sum += byte(i);
  if ((sum & 0xFFU) == 0) return Candidate::kWhole;
  ++statistics_.checksum_errors;
  return Candidate::kNoFrame;
}

void MessageParser::skipByte() {
  ++begin_;
  ++statistics_.skipped_bytes;
}

}  // namespace scanner::mti
