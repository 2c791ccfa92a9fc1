#include <gtest/gtest.h>

#include <algorithm>
#include <bitset>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <utility>

#include "scanner/core/se3.h"
#include "scanner/mti/mt_data2.h"

namespace scanner::mti {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr std::uint16_t kFormats[] = {xdi::kFloat, xdi::kFixed1220, xdi::kFixed1632, xdi::kDouble};
constexpr std::uint16_t kFrames[] = {xdi::kEastNorthUp, xdi::kNorthEastDown, xdi::kNorthWestUp};

std::uint16_t with(std::uint16_t base, std::uint16_t format, std::uint16_t frame = 0) {
  return static_cast<std::uint16_t>(base | format | frame);
}

/// Numbers that every format holds exactly.
MtData2 everything(EarthFrame frame) {
  MtData2 data;
  data.packet_counter = std::uint16_t{65535};
  data.sample_time_fine = 0x12345678U;
  data.sample_time_coarse = 5174U;
  data.utc_time = UtcTime{121900000, 2019, 1, 20, 13, 47, 24, 7};
  data.temperature_c = -12.0625;
  data.pressure_pa = 101389U;
  data.quaternion = InFrame<Quaterniond>{Quaterniond(0.5, -0.5, 0.5, 0.5), frame};
  Matrix3d turn;
  turn << 0, -1, 0, 0, 0, 1, -1, 0, 0;
  data.rotation_matrix = InFrame<Matrix3d>{turn, frame};
  data.euler_deg = InFrame<Vector3d>{Vector3d(-99.5, 0.25, 179.75), frame};
  data.acceleration = Vector3d(0.5, -9.75, -1.125);
  data.acceleration_hr = Vector3d(0.25, -9.5, -1.0);
  data.free_acceleration = InFrame<Vector3d>{Vector3d(0.125, 0.25, -0.5), frame};
  data.delta_v = Vector3d(0.0625, -0.03125, 0.5);
  data.angular_velocity = Vector3d(-0.125, 2.5, -34.0);
  data.angular_velocity_hr = Vector3d(-0.25, 2.0, -33.0);
  data.delta_q = Quaterniond(1.0, 0.0, 0.0, 0.0);
  data.magnetic_field = Vector3d(0.5, -0.75, 1.25);
  data.lat_lon_deg = Eigen::Vector2d(57.5, -11.875);
  data.altitude_m = 81.5;
  data.position_ecef_m = Vector3d(1024.5, -512.25, 2000.0);
  data.velocity = InFrame<Vector3d>{Vector3d(-1.5, 0.5, 0.25), frame};
  data.status_byte = std::uint8_t{5};
  data.status_word = 0x00400003U;
  return data;
}

std::vector<std::uint16_t> allIdentifiers(std::uint16_t format, std::uint16_t frame) {
  using namespace xdi;  // NOLINT(google-build-using-namespace)
  std::vector<std::uint16_t> identifiers = {kPacketCounter, kSampleTimeFine, kSampleTimeCoarse,
                                            kUtcTime,       kPressure,       kStatusByte,
                                            kStatusWord};
  for (const std::uint16_t base :
       {kTemperature, kDeltaV, kAcceleration, kAccelerationHr, kAltitudeEllipsoid, kPositionEcef,
        kLatLon, kRateOfTurn, kDeltaQ, kRateOfTurnHr, kMagneticField}) {
    identifiers.push_back(with(base, format));
  }
  for (const std::uint16_t base :
       {kQuaternion, kRotationMatrix, kEulerAngles, kFreeAcceleration, kVelocity}) {
    identifiers.push_back(with(base, format, frame));
  }
  return identifiers;
}

TEST(MtData2, DecodeUndoesEncodeInEveryFormatAndFrame) {
  for (const std::uint16_t format : kFormats) {
    for (const std::uint16_t frame : kFrames) {
      const MtData2 data = everything(static_cast<EarthFrame>(frame));
      const auto identifiers = allIdentifiers(format, frame);
      const Message message = encodeMtData2(data, identifiers);
      const Result<MtData2> back = decodeMtData2(message);
      ASSERT_TRUE(back.isOk()) << back.status().message();
      EXPECT_EQ(encodeMtData2(*back, identifiers).data, message.data);
      EXPECT_EQ(back->skipped, 0);
      EXPECT_EQ(back->packet_counter, data.packet_counter);
      EXPECT_EQ(back->utc_time->second, 24);
      EXPECT_EQ(back->temperature_c, data.temperature_c);
      EXPECT_EQ(back->quaternion->value.coeffs(), data.quaternion->value.coeffs());
      EXPECT_EQ(back->rotation_matrix->value, data.rotation_matrix->value);
      EXPECT_EQ(back->velocity->frame, static_cast<EarthFrame>(frame));
      EXPECT_EQ(back->angular_velocity, data.angular_velocity);
      EXPECT_EQ(back->lat_lon_deg, data.lat_lon_deg);
      EXPECT_EQ(back->status_word, data.status_word);
    }
  }
}

TEST(MtData2, UnknownPacketsAreSkippedAndCounted) {
  Message message =
      encodeMtData2(everything(EarthFrame::kEastNorthUp), {xdi::kPacketCounter, xdi::kStatusByte});
  const Bytes raw = {0xA0, 0x10, 0x02, 0x12, 0x34};           // sensor component readout
  const Bytes fourth_frame = {0x20, 0x1C, 0x02, 0x00, 0x00};  // of a quaternion: there is none
  message.data.insert(message.data.begin() + 5, raw.begin(), raw.end());
  message.data.insert(message.data.end(), fourth_frame.begin(), fourth_frame.end());
  const Result<MtData2> data = decodeMtData2(message);
  ASSERT_TRUE(data.isOk()) << data.status().message();
  EXPECT_EQ(data->skipped, 2);
  EXPECT_EQ(data->status_byte, std::uint8_t{5});
  EXPECT_FALSE(data->quaternion);
}

TEST(MtData2, EveryTruncationIsRefusedOrEndsBetweenPackets) {
  const Message whole = encodeMtData2(everything(EarthFrame::kNorthWestUp),
                                      allIdentifiers(xdi::kFixed1632, xdi::kNorthWestUp));
  std::vector<std::size_t> ends = {0};
  while (ends.back() < whole.data.size())
    ends.push_back(ends.back() + 3 + whole.data[ends.back() + 2]);
  for (std::size_t size = 0; size < whole.data.size(); ++size) {
    const Message part{whole.id, Bytes(whole.data.begin(),
                                       whole.data.begin() + static_cast<std::ptrdiff_t>(size))};
    const bool between = std::find(ends.begin(), ends.end(), size) != ends.end();
    EXPECT_EQ(decodeMtData2(part).isOk(), between) << size;
  }
}

TEST(MtData2, RefusesWhatCannotBe) {
  const MtData2 data = everything(EarthFrame::kEastNorthUp);
  const auto codeOf = [](const Message& message) { return decodeMtData2(message).status().code(); };
  Message twice = encodeMtData2(data, {xdi::kStatusByte, xdi::kStatusByte});
  EXPECT_EQ(codeOf(twice), StatusCode::kInvalidInput);
  Message size = encodeMtData2(data, {xdi::kAcceleration});
  size.data[2] = 11;
  size.data.pop_back();
  EXPECT_EQ(codeOf(size), StatusCode::kInvalidInput) << "eleven bytes of three floats";
  EXPECT_EQ(codeOf({0x32, {}}), StatusCode::kInvalidInput) << "MTData";
  for (const std::uint16_t format : {xdi::kFloat, xdi::kDouble}) {
    Message nan = encodeMtData2(data, {with(xdi::kRateOfTurn, format)});
    std::fill_n(nan.data.begin() + 3, 8, std::uint8_t{0xFF});
    EXPECT_EQ(codeOf(nan), StatusCode::kInvalidInput);
  }
  for (const std::uint16_t format : kFormats) {
    MtData2 odd = data;
    odd.quaternion->value = Quaterniond(0.5, 0.5, 0.5, 0.25);
    EXPECT_EQ(codeOf(encodeMtData2(odd, {with(xdi::kQuaternion, format)})),
              StatusCode::kInvalidInput);
    odd.rotation_matrix->value = -Matrix3d::Identity();
    EXPECT_EQ(codeOf(encodeMtData2(odd, {with(xdi::kRotationMatrix, format)})),
              StatusCode::kInvalidInput)
        << "a reflection";
  }
}

TEST(MtData2, EncodingRefusesWhatIsMissingOrDoesNotFit) {
  MtData2 data = everything(EarthFrame::kEastNorthUp);
  EXPECT_THROW(encodeMtData2(data, {0xA010}), ConfigurationError);
  EXPECT_THROW(encodeMtData2(data, {with(xdi::kQuaternion, 0, xdi::kNorthEastDown)}),
               ConfigurationError)
      << "another frame";
  data.acceleration = Vector3d(2048.0, 0.0, 0.0);
  EXPECT_THROW(encodeMtData2(data, {with(xdi::kAcceleration, xdi::kFixed1220)}),
               ConfigurationError);
  EXPECT_NO_THROW(encodeMtData2(data, {with(xdi::kAcceleration, xdi::kFixed1632)}));
  data.acceleration = Vector3d(std::nan(""), 0.0, 0.0);
  EXPECT_THROW(encodeMtData2(data, {xdi::kAcceleration}), ConfigurationError);
  data.acceleration.reset();
  EXPECT_THROW(encodeMtData2(data, {xdi::kAcceleration}), ConfigurationError);
}

/// The same pose in every frame and form comes to the same orientation for the driver.
TEST(MtData2, OrientationIsTheSameFromEveryFrame) {
  const Quaterniond enu = expSo3(Vector3d(0.3, -0.5, 1.2));
  // Axes of the other frames in coordinates of east, north, up.
  Matrix3d ned_from_enu;
  ned_from_enu << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  Matrix3d nwu_from_enu;
  nwu_from_enu << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  const Quaterniond nwu(nwu_from_enu * enu.toRotationMatrix());
  const std::pair<EarthFrame, Quaterniond> cases[] = {
      {EarthFrame::kEastNorthUp, enu},
      {EarthFrame::kNorthEastDown, Quaterniond(Matrix3d(ned_from_enu * enu.toRotationMatrix()))},
      {EarthFrame::kNorthWestUp, nwu}};
  for (const auto& [frame, q] : cases) {
    MtData2 quaternion;
    quaternion.quaternion = InFrame<Quaterniond>{q, frame};
    MtData2 matrix;
    matrix.rotation_matrix = InFrame<Matrix3d>{q.toRotationMatrix(), frame};
    MtData2 euler;
    euler.euler_deg =
        InFrame<Vector3d>{rollPitchYaw(q.toRotationMatrix()) * 57.29577951308232, frame};
    for (const MtData2& data : {quaternion, matrix, euler}) {
      EXPECT_LT(angleBetween(*toMtData(data).orientation, nwu), 1e-9);
    }
  }
}

TEST(MtData2, RandomDataGivesAValueOrAReason) {
  std::mt19937 random(3);
  const Message good = encodeMtData2(everything(EarthFrame::kEastNorthUp),
                                     allIdentifiers(xdi::kDouble, xdi::kEastNorthUp));
  for (int i = 0; i < 50000; ++i) {
    Message message = good;
    for (int hits = 0; hits < 3; ++hits) {
      message.data[random() % message.data.size()] = static_cast<std::uint8_t>(random());
    }
    const Result<MtData2> data = decodeMtData2(message);
    if (!data) continue;
    if (const auto orientation = data->orientation()) {
      EXPECT_NEAR(orientation->value.norm(), 1.0, 1e-9);
    }
    EXPECT_TRUE(!data->acceleration || data->acceleration->allFinite());
  }
}

// ---- recordings and what the vendor's tools decoded from them --------------------------------

/// One packet of a golden file: a name, perhaps its frame, and values as text.
struct GoldenPacket {
  std::string name;
  bool east_north_up = false;
  std::vector<std::string> values;
};
using GoldenFrame = std::vector<GoldenPacket>;

std::vector<double> list(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }
std::vector<double> list(const Quaterniond& q) { return {q.w(), q.x(), q.y(), q.z()}; }

/// What was decoded under the name the golden files use; empty for none.
std::vector<double> decodedValues(const MtData2& data, const std::string& name) {
  const auto number = [](const auto& field) {
    return field ? std::vector<double>{static_cast<double>(*field)} : std::vector<double>{};
  };
  const auto plain = [](const auto& field) { return field ? list(*field) : std::vector<double>{}; };
  const auto framed = [](const auto& field) {
    return field ? list(field->value) : std::vector<double>{};
  };
  if (name == "PacketCounter") return number(data.packet_counter);
  if (name == "SampleTimeFine") return number(data.sample_time_fine);
  if (name == "SampleTimeCoarse") return number(data.sample_time_coarse);
  if (name == "Temperature") return number(data.temperature_c);
  if (name == "BaroPressure") return number(data.pressure_pa);
  if (name == "StatusByte") return number(data.status_byte);
  if (name == "StatusWord") return number(data.status_word);
  if (name == "Quaternion") return framed(data.quaternion);
  if (name == "EulerAngles") return framed(data.euler_deg);
  if (name == "Acceleration") return plain(data.acceleration);
  if (name == "FreeAcceleration") return framed(data.free_acceleration);
  if (name == "DeltaV") return plain(data.delta_v);
  if (name == "RateOfTurn") return plain(data.angular_velocity);
  if (name == "DeltaQ") return plain(data.delta_q);
  if (name == "MagneticField") return plain(data.magnetic_field);
  if (name == "AltitudeEllipsoid") return number(data.altitude_m);
  if (name == "PositionECEF") return plain(data.position_ecef_m);
  if (name == "VelocityXYZ") return framed(data.velocity);
  if (name == "LatLon" && data.lat_lon_deg) return {data.lat_lon_deg->x(), data.lat_lon_deg->y()};
  if (name == "RotationMatrix" && data.rotation_matrix) {
    const Matrix3d& m = data.rotation_matrix->value;
    return std::vector<double>(m.data(), m.data() + 9);  // column by column
  }
  if (name == "UTCTime" && data.utc_time) {
    const UtcTime& t = *data.utc_time;
    return {double(t.year), double(t.month),  double(t.day),
            double(t.hour), double(t.minute), t.second + 1e-9 * t.nanoseconds};
  }
  return {};
}

/// The number and one unit in its last printed digit.
std::pair<double, double> printedNumber(const std::string& text) {
  const std::size_t exponent_at = std::min(text.find('e'), text.size());
  const std::size_t point = text.find('.');
  const int decimals = point < exponent_at ? static_cast<int>(exponent_at - point) - 1 : 0;
  const int exponent = exponent_at < text.size() ? std::atoi(text.c_str() + exponent_at + 1) : 0;
  return {std::strtod(text.c_str(), nullptr), std::pow(10.0, exponent - decimals)};
}

/// The golden values as numbers with their tolerances.
std::vector<std::pair<double, double>> goldenValues(const GoldenPacket& packet) {
  std::vector<std::pair<double, double>> numbers;
  if (packet.name == "UTCTime") {
    int part[5];
    double second = 0.0;
    EXPECT_EQ(std::sscanf(packet.values[0].c_str(), "%d-%d-%dT%d:%d:%lfZ", &part[0], &part[1],
                          &part[2], &part[3], &part[4], &second),
              6);
    for (const int value : part) numbers.emplace_back(value, 0.0);
    numbers.emplace_back(second, 1e-9);
    return numbers;
  }
  for (const std::string& value : packet.values) {
    const bool bits = packet.name == "StatusByte" || packet.name == "StatusWord";
    numbers.push_back(bits ? std::make_pair(double(std::bitset<32>(value).to_ulong()), 0.0)
                           : printedNumber(value));
  }
  return numbers;
}

/// Compares all values of one frame; returns how many there were.
std::size_t compare(const MtData2& data, const GoldenFrame& golden, const std::string& where) {
  std::size_t compared = 0;
  int gnss = 0;
  for (const GoldenPacket& packet : golden) {
    if (packet.name.rfind("GNSS", 0) == 0) {
      ++gnss;
      continue;
    }
    const std::vector<double> decoded = decodedValues(data, packet.name);
    const auto expected = goldenValues(packet);
    EXPECT_EQ(decoded.size(), expected.size()) << where << ", " << packet.name;
    for (std::size_t i = 0; i < std::min(decoded.size(), expected.size()); ++i) {
      EXPECT_NEAR(decoded[i], expected[i].first, expected[i].second)
          << where << ", " << packet.name << " " << i;
      ++compared;
    }
  }
  EXPECT_EQ(data.skipped, gnss) << where;
  if (data.quaternion && data.rotation_matrix) {  // one orientation in two forms
    EXPECT_LT(angleBetween(data.quaternion->value.normalized(),
                           Quaterniond(nearestRotation(data.rotation_matrix->value))),
              1e-6)
        << where;
  }
  return compared;
}

std::vector<GoldenFrame> readGolden(const std::filesystem::path& file) {
  std::vector<GoldenFrame> frames(1);
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (line.empty()) {
      frames.emplace_back();
    } else if (line[0] != ' ') {
      const bool enu = line.find("EastNorthUp") != std::string::npos;
      frames.back().push_back({line.substr(0, line.find_first_of("(:")), enu, {}});
    } else {
      const std::size_t colon = line.find(':');
      const bool labelled = colon <= 5;  // "  Q0:", "  Lat:", but not the colons of a time
      frames.back().back().values.push_back(line.substr(labelled ? colon + 1 : 2));
    }
  }
  if (frames.back().empty()) frames.pop_back();
  return frames;
}

/// "(Name|Float|ENU, 16 bytes, (q0: 1.0, ...)), ..." of one line of the vendor's tool.
GoldenFrame readVendorLine(const std::string& text) {
  GoldenFrame frame;
  const std::string mark = " bytes, ";
  for (std::size_t at = text.find(mark); at != std::string::npos; at = text.find(mark, at + 1)) {
    const std::size_t open = text.rfind('(', at);
    const std::size_t name_end = text.find_first_of("|,", open);
    const std::size_t next = text.find(mark, at + 1);
    const std::size_t end = next == std::string::npos ? text.size() : text.rfind('(', next);
    GoldenPacket packet{text.substr(open + 1, name_end - open - 1), true, {}};
    std::string digits;
    for (std::size_t i = at + mark.size(); i < end; ++i) {
      const bool within_name = digits.empty() && i + 1 < end && std::isalpha(text[i]) != 0;
      if (within_name) {  // skips "q0:", "accX:"
        i = text.find(':', i);
      } else if (std::isdigit(static_cast<unsigned char>(text[i])) != 0 || text[i] == '.' ||
                 text[i] == '-') {
        digits += text[i];
      } else if (!digits.empty()) {
        packet.values.push_back(std::exchange(digits, {}));
      }
    }
    frame.push_back(packet);
  }
  return frame;
}

class RealDataMtData2 : public testing::Test {
 protected:
  void SetUp() override {
    const char* set = std::getenv("SCANNER_DATA");
    folder_ = std::filesystem::path(set != nullptr ? set : SCANNER_SOURCE_DIR "/../shared/data") /
              "xsens";
    if (!std::filesystem::exists(folder_)) {
      GTEST_SKIP() << folder_.string() << " is not there";
    }
  }
  static std::vector<Message> messagesOf(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    const std::string raw{std::istreambuf_iterator<char>(in), {}};
    const Bytes bytes(raw.begin(), raw.end());
    MessageParser parser;
    parser.push(bytes.data(), bytes.size());
    std::vector<Message> messages;
    while (auto message = parser.next()) messages.push_back(*message);
    return messages;
  }
  std::filesystem::path folder_;
};

TEST_F(RealDataMtData2, EveryValueOfEveryFrameOfTheCaptures) {
  std::size_t frames = 0;
  std::size_t values = 0;
  for (int capture = 1; capture <= 5; ++capture) {
    const std::filesystem::path folder = folder_ / "mtdata2" / std::to_string(capture);
    const std::vector<Message> messages = messagesOf(folder / "output.bin");
    const std::vector<GoldenFrame> golden = readGolden(folder / "output.golden");
    ASSERT_EQ(messages.size(), golden.size());
    for (std::size_t i = 0; i < messages.size(); ++i) {
      const std::string where = "capture " + std::to_string(capture) + ", " + std::to_string(i);
      const Result<MtData2> data = decodeMtData2(messages[i]);
      ASSERT_TRUE(data.isOk()) << where << ": " << data.status().message();
      values += compare(*data, golden[i], where);
      for (const GoldenPacket& packet : golden[i]) {
        if (!packet.east_north_up) continue;
        if (const auto orientation = data->orientation()) {
          EXPECT_EQ(orientation->frame, EarthFrame::kEastNorthUp);
        }
      }
      ++frames;
    }
  }
  EXPECT_EQ(frames, 500U);
  EXPECT_GT(values, 10000U);
  RecordProperty("values", static_cast<int>(values));
}

TEST_F(RealDataMtData2, WhatTheVendorsToolDecoded) {
  std::ifstream in(folder_ / "mtdata2_golden.txt");
  std::size_t frames = 0;
  std::size_t values = 0;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    Message message{0x36, {}};
    for (std::size_t i = 0; i + 1 < line.find(';'); i += 3) {
      message.data.push_back(static_cast<std::uint8_t>(std::stoul(line.substr(i, 2), nullptr, 16)));
    }
    const Result<MtData2> data = decodeMtData2(message);
    ASSERT_TRUE(data.isOk()) << data.status().message();
    values += compare(*data, readVendorLine(line.substr(line.find(';'))),
                      "vendor's line " + std::to_string(frames));
    ++frames;
  }
  EXPECT_EQ(frames, 6U);
  EXPECT_GE(values, 130U);
  RecordProperty("values", static_cast<int>(values));
}

/// Whether a real device's rotations are as precise as single precision lets them be.
TEST_F(RealDataMtData2, RotationsAreExactToSinglePrecision) {
  double worst = 0.0;
  int rotations = 0;
  for (const Message& message : messagesOf(folder_ / "mtdata2" / "5" / "output.bin")) {
    const Result<MtData2> data = decodeMtData2(message);
    ASSERT_TRUE(data.isOk());
    if (!data->rotation_matrix) continue;
    worst = std::max(worst, data->rotationDefect());
    ++rotations;
  }
  EXPECT_GT(rotations, 90);
  EXPECT_LT(worst, 1e-6);
  RecordProperty("worst", std::to_string(worst * 1e9) + "e-9");
}

}  // namespace
}  // namespace scanner::mti
