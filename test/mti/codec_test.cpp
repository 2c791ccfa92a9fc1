#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <string>

#include "scanner/core/se3.h"
#include "scanner/mti/bytes.h"
#include "scanner/mti/mt_data.h"

namespace scanner::mti {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Eigen::Quaterniond;
using Eigen::Vector3d;

std::vector<Message> parse(MessageParser& parser, const Bytes& bytes) {
  parser.push(bytes.data(), bytes.size());
  std::vector<Message> messages;
  while (auto message = parser.next()) messages.push_back(*message);
  return messages;
}

Bytes concatenate(const std::vector<Message>& messages) {
  Bytes all;
  for (const Message& message : messages) {
    const Bytes bytes = encode(message);
    all.insert(all.end(), bytes.begin(), bytes.end());
  }
  return all;
}

bool same(const Message& a, const Message& b) { return a.id == b.id && a.data == b.data; }

/// Messages of many lengths whose data is full of preambles, the parser's worst company.
std::vector<Message> hardMessages() {
  std::mt19937 random(4);
  std::vector<Message> messages;
  for (const std::size_t size : {0, 1, 4, 54, 74, 253, 254, 255, 256, 1000, 8192}) {
    Message message{static_cast<std::uint8_t>(random() & 0xFFU), Bytes(size)};
    for (std::uint8_t& byte : message.data) {
      byte = static_cast<std::uint8_t>(random() % 3 == 0   ? 0xFA
                                       : random() % 2 == 0 ? 0xFF
                                                           : random());
    }
    messages.push_back(message);
  }
  return messages;
}

TEST(Message, EncodesAsTheManualShows) {
  EXPECT_EQ(encode({0x30, {}}), (Bytes{0xFA, 0xFF, 0x30, 0x00, 0xD1}));
  EXPECT_EQ(encode({0x10, {}}), (Bytes{0xFA, 0xFF, 0x10, 0x00, 0xF1}));
  EXPECT_EQ(encode({0xD0, {0x00, 0x06}}), (Bytes{0xFA, 0xFF, 0xD0, 0x02, 0x00, 0x06, 0x29}));
}

TEST(Message, LongDataHasALongLength) {
  const Bytes bytes = encode({0x36, Bytes(255, 0)});
  EXPECT_EQ(Bytes(bytes.begin(), bytes.begin() + 6), (Bytes{0xFA, 0xFF, 0x36, 0xFF, 0x00, 0xFF}));
  EXPECT_EQ(bytes.size(), 6U + 255U + 1U);
  EXPECT_EQ(encode({0x36, Bytes(254, 0)}).size(), 4U + 254U + 1U);
  EXPECT_NO_THROW(encode({0x36, Bytes(8192)}));
  EXPECT_THROW(encode({0x36, Bytes(8193)}), ConfigurationError);
}

TEST(MessageParser, FindsWhatWasEncodedHoweverItIsCut) {
  const std::vector<Message> messages = hardMessages();
  const Bytes bytes = concatenate(messages);
  for (const std::size_t portion :
       {std::size_t{1}, std::size_t{7}, std::size_t{64}, bytes.size()}) {
    MessageParser parser;
    std::vector<Message> found;
    for (std::size_t i = 0; i < bytes.size(); i += portion) {
      const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(i);
      const std::size_t count = std::min(portion, bytes.size() - i);
      for (Message& message : parse(parser, {begin, begin + static_cast<std::ptrdiff_t>(count)})) {
        found.push_back(std::move(message));
      }
    }
    ASSERT_EQ(found.size(), messages.size()) << "portions of " << portion;
    EXPECT_TRUE(std::equal(found.begin(), found.end(), messages.begin(), same));
    EXPECT_EQ(parser.statistics().messages, messages.size());
    EXPECT_EQ(parser.statistics().skipped_bytes, 0U);
    EXPECT_EQ(parser.statistics().checksum_errors, 0U);
  }
}

TEST(MessageParser, StartsAnywhere) {
  Bytes bytes = {0x12, 0xFA, 0xFA, 0xFF};  // rubbish that looks like a beginning
  const Bytes frame = encode({0x32, {1, 2, 3}});
  for (int i = 0; i < 300; ++i) bytes.insert(bytes.end(), frame.begin(), frame.end());
  MessageParser parser;
  const std::vector<Message> found = parse(parser, bytes);
  EXPECT_EQ(found.size(), 300U);
  EXPECT_EQ(parser.statistics().skipped_bytes, 4U);
}

TEST(MessageParser, AFlippedBitLosesOneMessageOnly) {
  const std::vector<Message> messages(5, {0x32, Bytes(54, 0x11)});
  const Bytes whole = concatenate(messages);
  const std::size_t frame = whole.size() / 5;
  for (std::size_t bit = 0; bit < 8 * frame; ++bit) {
    Bytes bytes = whole;
    bytes[2 * frame + bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    bytes.resize(bytes.size() + 300);  // whatever a damaged length announces arrives at last
    MessageParser parser(254);
    EXPECT_EQ(parse(parser, bytes).size(), 4U) << "bit " << bit;
  }
}

TEST(MessageParser, ATruncatedMessageDoesNotHideTheNext) {
  const Bytes frame = encode({0x32, Bytes(54, 0x22)});
  for (std::size_t length = 1; length < frame.size(); ++length) {
    Bytes bytes(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(length));
    // Its missing length may be taken from the next one's preamble (250): six frames are longer.
    for (int i = 0; i < 6; ++i) bytes.insert(bytes.end(), frame.begin(), frame.end());
    MessageParser parser;
    EXPECT_EQ(parse(parser, bytes).size(), 6U) << length << " bytes of the first";
    EXPECT_EQ(parser.statistics().skipped_bytes, length);
  }
}

TEST(MessageParser, AnImpossibleLengthIsNoFrame) {
  MessageParser parser(254);
  Bytes bytes = {0xFA, 0xFF, 0x32, 0xFF, 0x01, 0x00};  // 256 bytes to come
  const Bytes frame = encode({0x31, {}});
  bytes.insert(bytes.end(), frame.begin(), frame.end());
  EXPECT_EQ(parse(parser, bytes).size(), 1U);
}

TEST(MessageParser, RandomBytesDoNoHarm) {
  std::mt19937 random(1);
  MessageParser parser;
  std::uint64_t pushed = 0;
  std::uint64_t framed = 0;
  for (int round = 0; round < 2000; ++round) {
    Bytes bytes(random() % 200);
    for (std::uint8_t& byte : bytes) {
      byte = static_cast<std::uint8_t>(random() % 4 == 0   ? 0xFA
                                       : random() % 3 == 0 ? 0xFF
                                                           : random());
    }
    pushed += bytes.size();
    for (const Message& message : parse(parser, bytes)) framed += encode(message).size();
  }
  EXPECT_LE(framed + parser.statistics().skipped_bytes, pushed);
  EXPECT_GE(framed + parser.statistics().skipped_bytes + 8192 + 7, pushed);
  parse(parser, Bytes(8192 + 7));  // flush: no length announces more
  EXPECT_EQ(parse(parser, encode({0x30, {}})).size(), 1U);
}

TEST(Bytes, AreBigEndian) {
  ByteWriter out;
  out.u16(0x1234);
  out.u32(0x89ABCDEF);
  out.f32(-2.5);
  EXPECT_EQ(out.bytes(), (Bytes{0x12, 0x34, 0x89, 0xAB, 0xCD, 0xEF, 0xC0, 0x20, 0x00, 0x00}));
  ByteReader in(out.bytes());
  EXPECT_EQ(in.u16(), 0x1234);
  EXPECT_EQ(in.u32(), 0x89ABCDEF);
  EXPECT_EQ(in.f32(), -2.5);
  EXPECT_THROW(in.u8(), std::out_of_range);
}

MtData everything() {
  MtData data;
  data.temperature_c = 24.0625;
  data.acceleration = Vector3d(0.5, -1.25, 9.8125);
  data.angular_velocity = Vector3d(0.125, -0.75, 2.5);
  data.magnetic_field = Vector3d(0.25, -0.5, -0.875);
  data.orientation = expSo3(Vector3d(0.3, -0.5, 1.2));
  data.analog_in_1 = std::uint16_t{0x1234};
  data.analog_in_2 = std::uint16_t{0xFEDC};
  data.status = std::uint8_t{3};
  data.counter = std::uint16_t{65535};
  return data;
}

TEST(MtData, SizesAreThoseOfTheManual) {
  using namespace output_settings;  // NOLINT(google-build-using-namespace)
  EXPECT_EQ(mtDataSize(0x0006, kMatrix | kSampleCounter), 74U);
  EXPECT_EQ(mtDataSize(0x0006, kSampleCounter), 54U);
  EXPECT_EQ(mtDataSize(0x0006, kEuler | kSampleCounter), 50U);
  EXPECT_EQ(mtDataSize(0x0002, 0), 36U);
  EXPECT_EQ(mtDataSize(0x0002, kNoGyro | kNoMagnetometer), 12U);
  EXPECT_EQ(mtDataSize(0x080F, 0), 4U + 36U + 16U + 4U + 1U);
  EXPECT_EQ(mtDataSize(output_mode::kRaw, 0), 0U);
  EXPECT_EQ(mtDataSize(0x0006, 0x100), 0U) << "fixed point";
  EXPECT_EQ(mtDataSize(0x0006, 0x0C), 0U) << "no such orientation";
  EXPECT_EQ(mtDataSize(0, 0), 0U);
}

/// Every mode and all settings, numbers that single precision holds: what goes in comes out.
TEST(MtData, DecodeUndoesEncode) {
  const MtData data = everything();
  constexpr std::uint16_t kModes[] = {0x0001, 0x0002, 0x0004, 0x0006, 0x0008, 0x0800, 0x080F};
  for (const std::uint16_t mode : kModes) {
    for (std::uint32_t settings = 0; settings < 0x1000; ++settings) {
      if (mtDataSize(mode, settings) == 0) continue;
      const Message message = encodeMtData(data, mode, settings);
      ASSERT_EQ(message.data.size(), mtDataSize(mode, settings));
      const Result<MtData> back = decodeMtData(message, mode, settings);
      ASSERT_TRUE(back.isOk()) << back.status().message();
      const auto expectSame = [](const auto& out, const auto& in) {
        EXPECT_EQ(out.value_or(*in), *in);
      };
      expectSame(back->temperature_c, data.temperature_c);
      expectSame(back->acceleration, data.acceleration);
      expectSame(back->angular_velocity, data.angular_velocity);
      expectSame(back->magnetic_field, data.magnetic_field);
      expectSame(back->analog_in_1, data.analog_in_1);
      expectSame(back->analog_in_2, data.analog_in_2);
      expectSame(back->status, data.status);
      expectSame(back->counter, data.counter);
      EXPECT_EQ(back->acceleration.has_value(), (mode & 2) != 0 && (settings & 0x10) == 0);
      EXPECT_EQ(back->counter.has_value(), (settings & 1) != 0);
      ASSERT_EQ(back->orientation.has_value(), (mode & 4) != 0);
      EXPECT_LT(angleBetween(back->orientation.value_or(*data.orientation), *data.orientation),
                1e-6);
    }
  }
}

TEST(MtData, OrientationMapsTheSensorToTheEarth) {
  // A quarter turn to the left: the sensor's x axis points west, along the y axis of the earth.
  MtData data;
  data.orientation = Eigen::AngleAxisd(std::atan(1.0) * 2.0, Vector3d::UnitZ());
  const Message matrix = encodeMtData(data, output_mode::kOrientation, output_settings::kMatrix);
  ByteReader in(matrix.data);
  const double expected[] = {0, 1, 0, -1, 0, 0, 0, 0, 1};  // column by column
  for (const double value : expected) EXPECT_NEAR(in.f32(), value, 1e-7);
  const Message euler = encodeMtData(data, output_mode::kOrientation, output_settings::kEuler);
  ByteReader angles(euler.data);
  EXPECT_NEAR(angles.f32(), 0.0, 1e-5);
  EXPECT_NEAR(angles.f32(), 0.0, 1e-5);
  EXPECT_NEAR(angles.f32(), 90.0, 1e-5);
}

TEST(MtData, RefusesWhatCannotBe) {
  const Message good = encodeMtData(everything(), 0x0006, 1);
  EXPECT_EQ(decodeMtData(good, 0x4000, 1).status().code(), StatusCode::kUnsupported);
  EXPECT_EQ(decodeMtData(good, 0x0006, 0).status().code(), StatusCode::kInvalidInput) << "length";
  EXPECT_EQ(decodeMtData({0x30, good.data}, 0x0006, 1).status().code(), StatusCode::kInvalidInput);
  for (std::size_t field = 0; field < 13; ++field) {  // 9 floats of data, 4 of the quaternion
    Message message = good;
    std::fill_n(message.data.begin() + static_cast<std::ptrdiff_t>(4 * field), 4, 0xFF);  // NaN
    EXPECT_EQ(decodeMtData(message, 0x0006, 1).status().code(), StatusCode::kInvalidInput);
  }
  Message stretched = good;
  std::fill_n(stretched.data.begin() + 36, 4, 0x3F);  // w = 0.747
  EXPECT_EQ(decodeMtData(stretched, 0x0006, 1).status().code(), StatusCode::kInvalidInput);
  Message mirrored = encodeMtData(everything(), 0x0004, output_settings::kMatrix);
  for (std::size_t column = 0; column < 3; ++column) {
    mirrored.data[12 * column] ^= 0x80U;  // first row
  }
  EXPECT_EQ(decodeMtData(mirrored, 0x0004, output_settings::kMatrix).status().code(),
            StatusCode::kInvalidInput);
  MtData incomplete = everything();
  incomplete.magnetic_field.reset();
  EXPECT_THROW(encodeMtData(incomplete, 0x0006, 1), ConfigurationError);
  EXPECT_THROW(encodeMtData(everything(), output_mode::kRaw, 1), ConfigurationError);
}

TEST(MtData, RandomDataGivesAValueOrAReason) {
  std::mt19937 random(2);
  for (const std::uint32_t kind : {output_settings::kQuaternion, output_settings::kMatrix}) {
    Message message{0x32, Bytes(mtDataSize(0x0006, kind))};
    for (int i = 0; i < 20000; ++i) {
      for (std::uint8_t& byte : message.data) byte = static_cast<std::uint8_t>(random());
      const Result<MtData> data = decodeMtData(message, 0x0006, kind);
      if (!data.isOk()) continue;
      EXPECT_NEAR(data->orientation->norm(), 1.0, 1e-9);
    }
  }
}

class RealDataMti : public testing::Test {
 protected:
  void SetUp() override {
    const char* set = std::getenv("SCANNER_DATA");
    folder_ = std::filesystem::path(set != nullptr ? set : SCANNER_SOURCE_DIR "/../shared/data") /
              "xsens";
    if (!std::filesystem::exists(folder_)) {
      GTEST_SKIP() << folder_.string() << " is not there";
    }
  }
  static Bytes fromHex(const std::string& text) {
    Bytes bytes;
    std::string digits;
    for (const char c : text) {
      if (std::isxdigit(static_cast<unsigned char>(c)) != 0) digits += c;
    }
    for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
      bytes.push_back(static_cast<std::uint8_t>(std::stoul(digits.substr(i, 2), nullptr, 16)));
    }
    return bytes;
  }
  std::filesystem::path folder_;
};

TEST_F(RealDataMti, ALegacyFrameDecodes) {
  std::ifstream file(folder_ / "mtdata_legacy_one_frame.hex");
  const Bytes bytes = fromHex({std::istreambuf_iterator<char>(file), {}});
  MessageParser parser;
  const std::vector<Message> messages = parse(parser, bytes);
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_EQ(encode(messages[0]), bytes);
  const Result<MtData> data = decodeMtData(messages[0], output_mode::kCalibrated, 0);
  ASSERT_TRUE(data.isOk()) << data.status().message();
  EXPECT_NEAR(data->acceleration->norm(), 9.82, 0.05) << "at rest";
  EXPECT_LT(data->angular_velocity->norm(), 0.02);
  // As recorded; the third is no field of the earth, but the checksum holds.
  EXPECT_NEAR(data->magnetic_field->x(), -0.5715, 1e-4);
  EXPECT_NEAR(data->magnetic_field->y(), 1.9146, 1e-4);
  EXPECT_NEAR(data->magnetic_field->z(), -114.619, 1e-3);
}

TEST_F(RealDataMti, EveryMessageOfTheCapturesIsFound) {
  for (int capture = 1; capture <= 5; ++capture) {
    const std::filesystem::path folder = folder_ / "mtdata2" / std::to_string(capture);
    std::ifstream binary(folder / "output.bin", std::ios::binary);
    const std::string raw{std::istreambuf_iterator<char>(binary), {}};
    MessageParser parser;
    const std::vector<Message> messages = parse(parser, Bytes(raw.begin(), raw.end()));
    std::ifstream golden(folder / "messages.golden");
    std::size_t count = 0;
    for (std::string line; std::getline(golden, line) && !line.empty(); ++count) {
      ASSERT_LT(count, messages.size());
      EXPECT_EQ(encode(messages[count]), fromHex(line)) << "capture " << capture << ", " << count;
    }
    EXPECT_EQ(messages.size(), count);
    EXPECT_GT(count, 0U);
    EXPECT_EQ(parser.statistics().skipped_bytes, 0U);
  }
}

}  // namespace
}  // namespace scanner::mti
