#include "scanner/mti/bytes.h"

#include <cstring>

namespace scanner::mti {

void ByteWriter::u16(std::uint16_t value) {
  u8(static_cast<std::uint8_t>(value >> 8U));
  u8(static_cast<std::uint8_t>(value & 0xFFU));
}

void ByteWriter::u32(std::uint32_t value) {
  u16(static_cast<std::uint16_t>(value >> 16U));
  u16(static_cast<std::uint16_t>(value & 0xFFFFU));
}

void ByteWriter::f32(double value) {
  const float single = static_cast<float>(value);
  std::uint32_t bits = 0;
  std::memcpy(&bits, &single, sizeof(bits));
  u32(bits);
}

std::uint16_t ByteReader::u16() {
  const unsigned high = u8();
  return static_cast<std::uint16_t>((high << 8U) | u8());
}

std::uint32_t ByteReader::u32() {
  const std::uint32_t high = u16();
  return (high << 16U) | u16();
}

double ByteReader::f32() {
  const std::uint32_t bits = u32();
  float single = 0.0F;
  std::memcpy(&single, &bits, sizeof(single));
  return static_cast<double>(single);
}

}  // namespace scanner::mti
