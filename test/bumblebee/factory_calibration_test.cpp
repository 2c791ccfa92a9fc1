#include "scanner/bumblebee/factory_calibration.h"

#include <gtest/gtest.h>

#include <map>
#include <string>

namespace scanner::bumblebee {
namespace {

/// The memory of a camera: quadlets by offset, and what is asked of it.
class Registers {
 public:
  explicit Registers(const std::string& text) : Registers(text, text.size()) {}
  Registers(const std::string& text, std::size_t length) {
    map_[kCalibrationLengthRegister] = static_cast<std::uint32_t>(length);
    for (std::size_t i = 0; i < text.size(); ++i) {
      const auto value = static_cast<std::uint32_t>(static_cast<unsigned char>(text[i]));
      map_[kCalibrationDataRegister + i / 4 * 4] |= value << (24U - 8U * (i % 4));
    }
  }
  RegisterReader reader() {
    return [this](std::uint64_t offset) -> Result<std::uint32_t> {
      ++reads;
      const auto found = map_.find(offset);
      if (found == map_.end()) return Status(StatusCode::kIoError, "no such register");
      return found->second;
    };
  }
  int reads = 0;

 private:
  std::map<std::uint64_t, std::uint32_t> map_;
};

const char* const kText =
    "# Triclops configuration, version 2\r\n"
    "<CameraSerialNumber> 6510111\r\n"
    "Resolution 1024 768\n"
    "focal_length = 0.823\n"
    "Baseline: 0.119964\n"
    "FocalLength 99\n";

TEST(FactoryCalibration, IsReadWordByWordAndPickedOver) {
  for (const std::string extra : {"", "x", "xy", "xyz"}) {  // the last quadlet is full or not
    const std::string text = kText + extra;
    Registers registers(text);
    const Result<FactoryCalibration> c = readFactoryCalibration(registers.reader());
    ASSERT_TRUE(c) << c.status().message();
    EXPECT_EQ(c->text, text);
    EXPECT_EQ(c->serial.value_or(""), "6510111");
    EXPECT_EQ(c->width_px.value_or(0), 1024);
    EXPECT_EQ(c->height_px.value_or(0), 768);
    EXPECT_DOUBLE_EQ(c->focal_length.value_or(0.0), 0.823) << "the first line counts";
    EXPECT_DOUBLE_EQ(c->baseline.value_or(0.0), 0.119964);
  }
}

TEST(FactoryCalibration, PaddingAtTheEndIsNoText) {
  Registers registers(std::string("serial 12") + std::string(5, '\0') + "\xFF\xFF");
  const Result<FactoryCalibration> c = readFactoryCalibration(registers.reader());
  ASSERT_TRUE(c);
  EXPECT_EQ(c->text, "serial 12");
  EXPECT_EQ(c->serial.value_or(""), "12");
}

TEST(FactoryCalibration, NoneAndAbsurdLengthsAreSaid) {
  for (const std::uint32_t length : {0U, 0xFFFFFFFFU}) {
    Registers registers("", length);
    EXPECT_EQ(readFactoryCalibration(registers.reader()).status().code(),
              StatusCode::kNotEnoughData);
    EXPECT_EQ(registers.reads, 1);
  }
  for (const std::uint32_t length : {kLargestCalibration_bytes + 1, 0x80000000U, 0xFFFFFFFEU}) {
    Registers registers("", length);
    const Status status = readFactoryCalibration(registers.reader()).status();
    EXPECT_EQ(status.code(), StatusCode::kInvalidInput);
    EXPECT_NE(status.message().find(std::to_string(length)), std::string::npos);
    EXPECT_EQ(registers.reads, 1);
  }
}

TEST(FactoryCalibration, AFailingRegisterEndsTheReading) {
  Registers registers("abcdefgh", 400);  // the memory ends before the text does
  EXPECT_EQ(readFactoryCalibration(registers.reader()).status().code(), StatusCode::kIoError);
  EXPECT_EQ(registers.reads, 4);
}

TEST(FactoryCalibration, BinaryDataIsRefused) {
  Registers registers(std::string("focal\x01length", 12));
  EXPECT_EQ(readFactoryCalibration(registers.reader()).status().code(), StatusCode::kInvalidInput);
  Registers zeros(std::string(64, '\0'));
  EXPECT_EQ(readFactoryCalibration(zeros.reader()).status().code(), StatusCode::kInvalidInput);
}

TEST(FactoryCalibration, NonsenseIsLeftOut) {
  const FactoryCalibration c = parseFactoryCalibration(
      "SerialNumber 12ab\nResolution 1024\nResolution -3 4\nfocalLength 1e999\nbaseline nan\n"
      "baseline -0.1\nbaseline\nimage size 640x480");
  EXPECT_FALSE(c.serial);
  EXPECT_FALSE(c.focal_length);
  EXPECT_FALSE(c.baseline);
  EXPECT_EQ(c.width_px.value_or(0), 640);
  EXPECT_EQ(c.height_px.value_or(0), 480);
  EXPECT_TRUE(parseFactoryCalibration("").text.empty());
}

}  // namespace
}  // namespace scanner::bumblebee
