#include "simulation/serial_line.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace scanner::simulation {
namespace {

constexpr std::size_t kFifoBytes = 16;
constexpr double kBitsPerByte = 10.0;

}  // namespace

void SerialLine::send(const std::vector<std::uint8_t>& bytes, double ready_s, int baud) {
  const double byte_s = kBitsPerByte / baud;
  free_at_s_ = std::max(free_at_s_, ready_s);
  for (std::size_t begin = 0; begin < bytes.size(); begin += kFifoBytes) {
    const std::size_t end = std::min(begin + kFifoBytes, bytes.size());
    free_at_s_ += static_cast<double>(end - begin) * byte_s;
    const double arrival_s =
        burst_s_ > 0.0 ? std::ceil(free_at_s_ / burst_s_) * burst_s_ : free_at_s_;
    portions_.push_back({arrival_s,
                         baud,
                         {bytes.begin() + static_cast<std::ptrdiff_t>(begin),
                          bytes.begin() + static_cast<std::ptrdiff_t>(end)}});
  }
}

std::vector<SerialLine::Portion> SerialLine::arrived(double now_s) {
  std::vector<Portion> arrived;
  while (!portions_.empty() && portions_.front().arrival_s <= now_s) {
    arrived.push_back(std::move(portions_.front()));
    portions_.pop_front();
  }
  return arrived;
}

double SerialLine::nextArrival() const {
  return portions_.empty() ? std::numeric_limits<double>::infinity() : portions_.front().arrival_s;
}

void SerialLine::clear() {
  portions_.clear();
  free_at_s_ = 0.0;
}

}  // namespace scanner::simulation
