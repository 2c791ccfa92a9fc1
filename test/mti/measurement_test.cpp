#include "mti/measurement.h"

#include <gtest/gtest.h>

#include <functional>
#include <utility>

#include "scanner/core/se3.h"
#include "scanner/mti/mt_data.h"
#include "scanner/mti/mt_data2.h"

namespace scanner::mti {
namespace {

const Time kStart = fromNanoseconds(1'700'000'000'000'000'000);
constexpr double kRateHz = 100.0;
constexpr double kByteS = 10.0 / 460800.0;

Output legacyOutput(std::uint32_t extra_settings = 0) {
  Output output;
  output.mode = output_mode::kCalibrated | output_mode::kOrientation;
  output.settings = output_settings::kSampleCounter | output_settings::kMatrix | extra_settings;
  output.rate_hz = kRateHz;
  output.counter = true;
  return output;
}

MtData still(std::uint16_t counter, const Eigen::Quaterniond& orientation) {
  MtData data;
  data.acceleration = Eigen::Vector3d(0.0, 0.0, 9.81);
  data.angular_velocity = Eigen::Vector3d::Zero();
  data.magnetic_field = Eigen::Vector3d::UnitX();
  data.orientation = orientation;
  data.counter = counter;
  return data;
}

/// A clean line that carries messages sampled at given times.
class Line {
 public:
  Incoming carry(const Message& message, double sampled_s) {
    Incoming incoming;
    incoming.message = message;
    incoming.length_s = static_cast<double>(message.data.size() + 5) * kByteS;
    incoming.arrival = kStart + fromSeconds(sampled_s + 1.97e-3 + incoming.length_s);
    ++statistics_.messages;
    incoming.statistics = statistics_;
    return incoming;
  }

 private:
  MessageParser::Statistics statistics_;
};

std::vector<Sample> take(Measurement* measurement) {
  std::vector<Sample> samples;
  while (const std::optional<Sample> sample = measurement->next()) samples.push_back(*sample);
  return samples;
}

TEST(MtiMeasurement, TheCounterWraps) {
  Measurement measurement(0.0);
  const Output output = legacyOutput();
  measurement.begin(output);
  Line line;
  std::vector<Sample> samples;
  for (int i = 0; i < 1000; ++i) {
    if (i >= 530 && i < 540) continue;  // lost around the wrap
    const auto counter = static_cast<std::uint16_t>(65000 + i);
    const Message message =
        encodeMtData(still(counter, Eigen::Quaterniond::Identity()), output.mode, output.settings);
    measurement.push(line.carry(message, i / kRateHz));
    for (const Sample& sample : take(&measurement)) samples.push_back(sample);
  }
  ASSERT_EQ(samples.size(), 970U) << "20 settle, 10 are lost";
  EXPECT_EQ(measurement.statistics().lost, 10U);
  EXPECT_EQ(measurement.statistics().rejected, 0U);
  EXPECT_EQ(samples.back().number - samples.front().number, 979U);
  for (const Sample& sample : samples) {
    const double sampled_s = static_cast<double>(sample.number - 1) / kRateHz;
    EXPECT_NEAR(toSeconds(sample.stamp - kStart), sampled_s, 1e-5);
  }
}

TEST(MtiMeasurement, ACounterThatStartsAnewIsNoLoss) {
  Measurement measurement(0.0);
  const Output output = legacyOutput();
  measurement.begin(output);
  Line line;
  Time last = Time::min();
  std::uint64_t last_number = 0;
  for (int i = 0; i < 300; ++i) {
    const auto counter = static_cast<std::uint16_t>(i < 150 ? 40000 + i : i - 150);
    const Message message =
        encodeMtData(still(counter, Eigen::Quaterniond::Identity()), output.mode, output.settings);
    measurement.push(line.carry(message, i / kRateHz));
    for (const Sample& sample : take(&measurement)) {
      EXPECT_GT(sample.stamp, last);
      EXPECT_GT(sample.number, last_number);
      last = sample.stamp;
      last_number = sample.number;
    }
  }
  EXPECT_EQ(measurement.statistics().lost, 0U);
  EXPECT_LT(last_number, 302U);
}

/// The sample that comes out for one orientation.
Eigen::Quaterniond through(const Output& output,
                           const std::function<Message(std::uint16_t)>& make) {
  Measurement measurement(0.0);
  measurement.begin(output);
  Line line;
  std::optional<Sample> last;
  for (int i = 0; i < 40; ++i) {
    measurement.push(line.carry(make(static_cast<std::uint16_t>(i)), i / kRateHz));
    for (const Sample& sample : take(&measurement)) last = sample;
  }
  EXPECT_TRUE(last && last->orientation);
  return last && last->orientation ? *last->orientation : Eigen::Quaterniond(0, 0, 0, 0);
}

TEST(MtiMeasurement, EveryEarthFrameBecomesEastNorthUp) {
  const Eigen::Quaterniond R_enu_sensor(expSo3(Eigen::Vector3d(0.3, -0.4, 1.2)));
  // Axes of the other frames, in ENU: north, west, up; north, east, down.
  Eigen::Matrix3d nwu;
  nwu << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  Eigen::Matrix3d ned;
  ned << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  const Eigen::Quaterniond R_nwu_sensor = Eigen::Quaterniond(nwu) * R_enu_sensor;
  const Eigen::Quaterniond R_ned_sensor = Eigen::Quaterniond(ned) * R_enu_sensor;
  for (const bool down : {false, true}) {
    const Output output = legacyOutput(down ? output_settings::kNorthEastDown : 0);
    const Eigen::Quaterniond out = through(output, [&](std::uint16_t counter) {
      return encodeMtData(still(counter, down ? R_ned_sensor : R_nwu_sensor), output.mode,
                          output.settings);
    });
    EXPECT_LT(out.angularDistance(R_enu_sensor), 1e-6) << down;
  }
  Output output;
  output.mt_data2 = output.counter = true;
  output.rate_hz = kRateHz;
  const std::vector<std::pair<EarthFrame, Eigen::Quaterniond>> sent = {
      {EarthFrame::kEastNorthUp, R_enu_sensor},
      {EarthFrame::kNorthWestUp, R_nwu_sensor},
      {EarthFrame::kNorthEastDown, R_ned_sensor}};
  for (const auto& [frame, orientation] : sent) {
    const Eigen::Quaterniond out = through(output, [&](std::uint16_t counter) {
      MtData2 data;
      data.packet_counter = counter;
      data.quaternion = InFrame<Eigen::Quaterniond>{orientation, frame};
      return encodeMtData2(
          data, {xdi::kPacketCounter,
                 static_cast<std::uint16_t>(xdi::kQuaternion | static_cast<std::uint16_t>(frame))});
    });
    EXPECT_LT(out.angularDistance(R_enu_sensor), 1e-6) << static_cast<int>(frame);
  }
}

TEST(MtiMeasurement, WithoutACounterStampsAreThoseOfArrival) {
  Measurement measurement(0.001);
  Output output = legacyOutput();
  output.settings &= ~output_settings::kSampleCounter;
  output.counter = false;
  measurement.begin(output);
  Line line;
  const Message message =
      encodeMtData(still(0, Eigen::Quaterniond::Identity()), output.mode, output.settings);
  std::vector<Sample> samples;
  for (int i = 0; i < 10; ++i) {
    measurement.push(line.carry(message, 0.016 * (i / 2)));  // two arrive at once
    for (const Sample& sample : take(&measurement)) samples.push_back(sample);
  }
  ASSERT_EQ(samples.size(), 10U);
  for (std::size_t i = 1; i < samples.size(); ++i) {
    EXPECT_GT(samples[i].stamp, samples[i - 1].stamp);
    EXPECT_NEAR(toSeconds(samples[i].stamp - kStart), 0.016 * static_cast<double>(i / 2) - 0.001,
                1e-6);
  }
}

TEST(MtiMeasurement, WhatDoesNotDecodeIsRejected) {
  Measurement measurement(0.0);
  const Output output = legacyOutput();
  measurement.begin(output);
  Line line;
  Message message =
      encodeMtData(still(0, Eigen::Quaterniond::Identity()), output.mode, output.settings);
  message.data.pop_back();
  measurement.push(line.carry(message, 0.0));
  measurement.push(line.carry({0x01, {1, 2, 3, 4}}, 0.01));
  measurement.flush();
  EXPECT_TRUE(take(&measurement).empty());
  EXPECT_EQ(measurement.statistics().rejected, 1U);
  EXPECT_FALSE(measurement.lastArrival());
}

}  // namespace
}  // namespace scanner::mti
