#pragma once

#include <cstdint>
#include <cstring>
#include <map>
#include <mutex>
#include <optional>
#include <set>

namespace scanner::bumblebee {

/// Control registers of a Bumblebee2 (colour, 640x480), by offset from 0xFFFFF0F00000, with what a
/// camera does when they are written. Thread-safe.
class RegisterMap {
 public:
  static constexpr std::uint32_t kFormat7 = 0x3000, kShutterAbs = 0x3100, kGainAbs = 0x3110,
                                 kRateAbs = 0x3120;
  RegisterMap() {
    const auto pointer = [](std::uint32_t offset) { return (0xF00000 + offset) / 4; };
    values_ = {{0x100, 0x01000000},         // Format7
               {0x19C, 0x10000000},         // mode 3
               {0x2EC, pointer(kFormat7)},  //
               {0x400, 0x00008000},         // power control
               {0x404, 0x80000000U >> 3 | 0x80000000U >> 7 | 0x80000000U >> 8 | 0x80000000U >> 11 |
                           0x80000000U >> 15},
               {0x50C, 0x81000000 | 1U << 12 | 1023},  // white balance 1..1023, manual
               {0x51C, 0xC1000000},                    // shutter: absolute, manual
               {0x520, 0xC1000000},                    // gain
               {0x52C, 0x80000000},                    // temperature
               {0x53C, 0xC1000000},                    // frame rate
               {0x604, 0},
               {0x608, 0},
               {0x60C, 0x02000000},
               {0x610, 0},
               {0x614, 0},
               {0x71C, pointer(kShutterAbs)},
               {0x720, pointer(kGainAbs)},
               {0x73C, pointer(kRateAbs)},
               {0x80C, 0x83000000 | 512U << 12 | 600},  // automatic
               {0x81C, 0x83000100},
               {0x820, 0x83000000},
               {0x82C, 0x82000C10},  // 308.8 K
               {0x83C, 0x83000000},
               {0x1040, 0x47524247},  // GRBG
               {0x1048, 0x80000001},
               {0x12F8, 0x80000000 | 0x3},
               {0x1F20, 7080123},
               {0x1F28, 0xA},
               {kFormat7 + 0x00, 640U << 16 | 480},
               {kFormat7 + 0x08, 0},
               {kFormat7 + 0x0C, 0},
               {kFormat7 + 0x10, 0},
               {kFormat7 + 0x14, 0x80000000U >> 10 | 0x80000000U >> 5},
               {kFormat7 + 0x38, 0},
               {kFormat7 + 0x3C, 0},
               {kFormat7 + 0x40, 4U << 16 | 4096},
               {kFormat7 + 0x44, 2048},
               {kFormat7 + 0x48, 0},
               {kFormat7 + 0x54, 8},
               {kFormat7 + 0x7C, 0x80000000}};
    setRange(kShutterAbs, 0.00001F, 0.5F, 0.01F);
    setRange(kGainAbs, 0.0F, 24.0F, 3.0F);
    setRange(kRateAbs, 0.5F, 48.0F, 15.0F);
  }

  /// Nothing: the camera answers with an address error.
  std::optional<std::uint32_t> read(std::uint64_t offset) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (failing_.count(offset) != 0) return std::nullopt;
    const auto found = values_.find(offset);
    return found == values_.end() ? 0U : found->second;
  }
  bool write(std::uint64_t offset, std::uint32_t value) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (failing_.count(offset) != 0) return false;
    writes_.insert(offset);
    if (stuck_.count(offset) != 0) return true;
    if (offset == 0x1048 || (offset >= 0x800 && offset < 0x900)) value |= 0x80000000;
    if (offset == 0x12F8) value = 0x80000000 | (value & 0x3FF);
    if (offset == kFormat7 + 0x7C) value = 0x80000000;  // settled at once, no error
    if (offset == kFormat7 + 0x44) value = (value & 0xFFFF0000) | 2048;
    values_[offset] = value;
    layOutFrame();
    return true;
  }

  std::uint32_t get(std::uint64_t offset) const { return read(offset).value_or(0); }
  void set(std::uint64_t offset, std::uint32_t value) {
    const std::lock_guard<std::mutex> lock(mutex_);
    values_[offset] = value;
  }
  float getFloat(std::uint64_t offset) const {
    const std::uint32_t bits = get(offset);
    float value = 0.0F;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }
  void setFloat(std::uint64_t offset, float value) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    set(offset, bits);
  }
  /// Reading and writing it fails.
  void fail(std::uint64_t offset) { failing_.insert(offset); }
  void mend(std::uint64_t offset) { failing_.erase(offset); }
  /// Takes writes and does not change.
  void stick(std::uint64_t offset) { stuck_.insert(offset); }
  bool written(std::uint64_t offset) const { return writes_.count(offset) != 0; }
  void forgetWrites() { writes_.clear(); }

 private:
  void setRange(std::uint32_t csr, float low, float high, float value) {
    setFloat(csr, low);
    setFloat(csr + 4, high);
    setFloat(csr + 8, value);
  }
  void layOutFrame() {
    const std::uint32_t size = values_[kFormat7 + 0x0C], packet = values_[kFormat7 + 0x44] >> 16;
    const std::uint32_t bytes = 2 * (size >> 16) * (size & 0xFFFF);
    values_[kFormat7 + 0x3C] = bytes;
    values_[kFormat7 + 0x48] = packet == 0 ? 0 : (bytes + packet - 1) / packet;
  }

  mutable std::mutex mutex_;
  std::map<std::uint64_t, std::uint32_t> values_;
  std::set<std::uint64_t> failing_, stuck_, writes_;
};

}  // namespace scanner::bumblebee
