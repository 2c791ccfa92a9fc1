#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

/// Numbers as the MT protocol writes them: big-endian, floats as IEEE 754 single precision.
namespace scanner::mti {

class ByteWriter {
 public:
  void u8(std::uint8_t value) { bytes_.push_back(value); }
  void u16(std::uint16_t value);
  void u32(std::uint32_t value);
  void f32(double value);
  void zeros(std::size_t count) { bytes_.resize(bytes_.size() + count); }
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  std::vector<std::uint8_t> bytes_;
};

/// Reads from the front. Reading beyond the end is a broken contract and throws std::out_of_range.
class ByteReader {
 public:
  explicit ByteReader(const std::vector<std::uint8_t>& bytes) : bytes_(bytes) {}
  std::uint8_t u8() { return bytes_.at(next_++); }
  std::uint16_t u16();
  std::uint32_t u32();
  double f32();

 private:
  const std::vector<std::uint8_t>& bytes_;
  std::size_t next_ = 0;
};

}  // namespace scanner::mti
