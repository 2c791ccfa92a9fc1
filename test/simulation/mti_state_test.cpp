#include "simulation/mti_state.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "scanner/core/se3.h"
#include "scanner/core/status.h"
#include "scanner/mti/bytes.h"

namespace scanner::simulation {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using mti::Message;
using mti::MessageId;

constexpr double kPi = 3.14159265358979323846;
constexpr std::uint16_t kCalibratedAndOrientation = 0x0006;

MtiSample sampleAt(double time_s, const Quaterniond& orientation) {
  MtiSample sample;
  sample.time_s = time_s;
  sample.imu.angular_velocity = Vector3d(0.1, 0.2, 0.3);
  sample.imu.linear_acceleration = orientation.conjugate() * Vector3d(0.0, 0.0, 9.82);
  sample.imu.orientation = orientation;
  sample.magnetic_field = orientation.conjugate() * Vector3d(0.0, 0.4, -0.9);
  sample.temperature_c = 24.0;
  return sample;
}

/// Stands still: tilted, and turned 30 degrees to the left of east.
Quaterniond somehow() {
  return expSo3(Vector3d(0.0, 0.0, kPi / 6.0)) * expSo3(Vector3d(0.0, -0.3, 0.0)) *
         expSo3(Vector3d(0.2, 0.0, 0.0));
}

/// A host that talks to the device at times of its own choosing.
class Conversation {
 public:
  explicit Conversation(std::vector<MtiSample> samples = {sampleAt(0.0, somehow())},
                        double clock_ppm = 0.0)
      : device(0x00300123, clock_ppm, MtiTrack(std::move(samples))) {
    device.powerOn(0.0);
  }
  std::vector<MtiState::Outgoing> wait(double until_s) {
    now = until_s;
    device.advance(now);
    return device.takeOutgoing();
  }
  /// The answers to one message.
  std::vector<Message> tell(std::uint8_t id, Bytes data = {}) {
    device.takeOutgoing();
    device.receive(mti::encode({id, std::move(data)}), now);
    std::vector<Message> answers;
    for (const auto& outgoing : device.takeOutgoing()) answers.push_back(outgoing.message);
    return answers;
  }
  std::vector<Message> tell(MessageId id, Bytes data = {}) {
    return tell(static_cast<std::uint8_t>(id), std::move(data));
  }
  /// True when the one answer is the acknowledgement, with this data.
  bool acknowledges(MessageId id, Bytes data = {}, const Bytes& expected = {}) {
    const std::vector<Message> answers = tell(id, std::move(data));
    return answers.size() == 1 && answers[0].id == static_cast<std::uint8_t>(id) + 1 &&
           answers[0].data == expected;
  }
  /// Code of the one Error that was answered; -1 for another answer.
  int errorOf(std::uint8_t id, Bytes data = {}) {
    const std::vector<Message> answers = tell(id, std::move(data));
    const bool error = answers.size() == 1 && answers[0].is(MessageId::kError);
    return error && answers[0].data.size() == 1 ? answers[0].data[0] : -1;
  }
  int errorOf(MessageId id, Bytes data = {}) {
    return errorOf(static_cast<std::uint8_t>(id), std::move(data));
  }
  void configure(std::uint16_t mode, std::uint32_t settings) {
    EXPECT_TRUE(acknowledges(MessageId::kGoToConfig));
    mti::ByteWriter bits;
    bits.u32(settings);
    const auto low = static_cast<std::uint8_t>(mode & 0xFFU);
    EXPECT_TRUE(
        acknowledges(MessageId::kSetOutputMode, {static_cast<std::uint8_t>(mode >> 8U), low}));
    EXPECT_TRUE(acknowledges(MessageId::kSetOutputSettings, bits.bytes()));
    EXPECT_TRUE(acknowledges(MessageId::kGoToMeasurement));
    mode_ = mode;
    settings_ = settings;
  }
  /// Data of the next sample, 0.1 s later.
  mti::MtData measure() {
    const std::vector<MtiState::Outgoing> sent = wait(now + 0.1);
    EXPECT_FALSE(sent.empty());
    const Result<mti::MtData> data = decodeMtData(sent.back().message, mode_, settings_);
    EXPECT_TRUE(data.isOk()) << data.status().message();
    return *data;
  }
  void reset(std::uint8_t code) {
    EXPECT_TRUE(acknowledges(MessageId::kResetOrientation, {0, code}));
  }

  MtiState device;
  double now = 0.0;

 private:
  std::uint16_t mode_ = 0;
  std::uint32_t settings_ = 0;
};

Quaterniond northWestUp(const Quaterniond& east_north_up) {
  return expSo3(Vector3d(0.0, 0.0, -kPi / 2.0)) * east_north_up;
}

void expectRotation(const Quaterniond& a, const Quaterniond& b) {
  EXPECT_LT(angleBetween(a, b), 1e-6);
}

TEST(MtiState, WakesUpIntoConfigWhenItIsAnswered) {
  Conversation host;
  const std::vector<MtiState::Outgoing> first = host.wait(0.0);
  ASSERT_EQ(first.size(), 1U);
  EXPECT_TRUE(first[0].message.is(MessageId::kWakeUp));
  host.now = 0.4;
  EXPECT_TRUE(host.tell(MessageId::kWakeUpAck).empty());
  EXPECT_TRUE(host.wait(2.0).empty()) << "silent in config";
  EXPECT_EQ(host.device.nextEvent(), std::numeric_limits<double>::infinity());
  EXPECT_TRUE(host.acknowledges(MessageId::kReqDid, {}, {0x00, 0x30, 0x01, 0x23}));
}

TEST(MtiState, MeasuresWhenTheWakeUpIsNotAnswered) {
  Conversation host;
  host.wait(0.0);
  EXPECT_TRUE(host.wait(0.5).empty());
  const std::vector<MtiState::Outgoing> sent = host.wait(0.6);
  ASSERT_EQ(sent.size(), 10U) << "100 Hz";
  for (std::size_t i = 0; i < sent.size(); ++i) {
    EXPECT_NEAR(sent[i].ready_s, 0.5 + 0.01 * static_cast<double>(i + 1) + 0.00197, 1e-9);
    const Result<mti::MtData> data = decodeMtData(sent[i].message, 0x0004, 1);
    ASSERT_TRUE(data.isOk()) << "quaternion and counter are the factory settings";
    EXPECT_EQ(data->counter, i);
    expectRotation(*data->orientation, northWestUp(somehow()));
  }
  EXPECT_TRUE(host.tell(MessageId::kWakeUpAck).empty()) << "too late, ignored";
  EXPECT_EQ(host.errorOf(MessageId::kReqDid), 4);
}

TEST(MtiState, SettingsNeedTheConfigState) {
  Conversation host;
  host.wait(1.0);
  for (const MessageId id :
       {MessageId::kReqDid, MessageId::kReqFirmwareRevision, MessageId::kReqConfiguration,
        MessageId::kSetPeriod, MessageId::kSetOutputMode, MessageId::kSetOutputSettings,
        MessageId::kSetOutputSkipFactor, MessageId::kSetBaudRate, MessageId::kSetHeading,
        MessageId::kSetObjectAlignment, MessageId::kSetErrorMode, MessageId::kGoToMeasurement}) {
    EXPECT_EQ(host.errorOf(id), 4) << "message " << static_cast<int>(id);
  }
  EXPECT_EQ(host.errorOf(MessageId::kReqData), 4) << "data come by themselves";
  EXPECT_EQ(host.errorOf(MessageId::kResetOrientation, {0, 0}), 4) << "store";
  EXPECT_TRUE(host.acknowledges(MessageId::kGoToConfig));
  EXPECT_TRUE(host.acknowledges(MessageId::kGoToConfig)) << "again";
  EXPECT_EQ(host.errorOf(0x99), 4) << "unknown";
  EXPECT_EQ(host.errorOf(MessageId::kReqData), 4);
  EXPECT_EQ(host.device.requests(), 18U);
  EXPECT_EQ(host.device.badRequests(), 16U);
}

TEST(MtiState, RefusesBadParameters) {
  Conversation host;
  host.tell(MessageId::kGoToConfig);
  EXPECT_EQ(host.errorOf(MessageId::kSetPeriod, {0, 224}), 3) << "over 512 Hz";
  EXPECT_EQ(host.errorOf(MessageId::kSetPeriod, {1}), 0x21);
  EXPECT_EQ(host.errorOf(MessageId::kSetOutputMode, {0x40, 0x00}), 0x21) << "raw is not emulated";
  EXPECT_EQ(host.errorOf(MessageId::kSetOutputMode, {0, 0}), 0x21);
  EXPECT_EQ(host.errorOf(MessageId::kSetOutputSettings, {0, 0, 0, 0x0C}), 0x21);
  EXPECT_EQ(host.errorOf(MessageId::kSetBaudRate, {0x0A}), 0x20);
  EXPECT_EQ(host.errorOf(MessageId::kSetErrorMode, {0, 4}), 0x21);
  EXPECT_EQ(host.errorOf(MessageId::kSetHeading, {0x40, 0x80, 0, 0}), 0x21) << "4 rad";
  EXPECT_EQ(host.errorOf(MessageId::kSetHeading, {0x7F, 0xC0, 0, 0}), 0x21) << "NaN";
  EXPECT_EQ(host.errorOf(MessageId::kSetObjectAlignment, Bytes(36, 0)), 0x21) << "no rotation";
  EXPECT_EQ(host.errorOf(MessageId::kSetObjectAlignment, Bytes(36, 0xFF)), 0x21) << "NaN";
  EXPECT_EQ(host.errorOf(MessageId::kResetOrientation, {0, 5}), 0x21);
  EXPECT_EQ(host.errorOf(MessageId::kResetOrientation), 0x21);
  EXPECT_TRUE(host.acknowledges(MessageId::kSetPeriod, {}, {0x04, 0x80})) << "unchanged";
  const Bytes broken = {0xFA, 0xFF, 0x30, 0x00, 0xD0};
  const std::uint64_t bad = host.device.badRequests();
  host.device.receive(broken, host.now);
  EXPECT_TRUE(host.device.takeOutgoing().empty()) << "a bad checksum is not answered";
  EXPECT_EQ(host.device.badRequests(), bad + 1);
}

TEST(MtiState, TellsItsConfiguration) {
  Conversation host;
  host.tell(MessageId::kGoToConfig);
  host.tell(MessageId::kSetPeriod, {0x03, 0xC0});
  host.tell(MessageId::kSetOutputSkipFactor, {0, 2});
  host.tell(MessageId::kSetOutputMode, {0, 6});
  host.tell(MessageId::kSetOutputSettings, {0, 0, 0, 9});
  const std::vector<Message> answers = host.tell(MessageId::kReqConfiguration);
  ASSERT_EQ(answers.size(), 1U);
  EXPECT_TRUE(answers[0].is(MessageId::kConfiguration));
  const Bytes& data = answers[0].data;
  ASSERT_EQ(data.size(), 118U);
  EXPECT_EQ(Bytes(data.begin(), data.begin() + 8), (Bytes{0x00, 0x30, 0x01, 0x23, 3, 0xC0, 0, 2}));
  EXPECT_EQ(Bytes(data.begin() + 96, data.begin() + 110),
            (Bytes{0, 1, 0x00, 0x30, 0x01, 0x23, 0, 74, 0, 6, 0, 0, 0, 9}));
  EXPECT_TRUE(host.acknowledges(MessageId::kSetOutputMode, {}, {0, 6}));
  EXPECT_TRUE(host.acknowledges(MessageId::kSetOutputSkipFactor, {}, {0, 2}));
  EXPECT_TRUE(host.acknowledges(MessageId::kSetOutputSettings, {}, {0, 0, 0, 9}));
}

TEST(MtiState, PeriodSkipFactorAndClockSetTheRate) {
  Conversation host({sampleAt(0.0, somehow())}, 1000.0);
  host.tell(MessageId::kGoToConfig);
  host.tell(MessageId::kSetPeriod, {0x02, 0x40});  // 200 Hz
  host.tell(MessageId::kSetOutputSkipFactor, {0, 3});
  host.tell(MessageId::kGoToMeasurement);
  const std::vector<MtiState::Outgoing> sent = host.wait(10.0);
  EXPECT_EQ(sent.size(), 500U) << "50 Hz and a clock that is fast by 0.1 %";
  EXPECT_NEAR(sent[1].ready_s - sent[0].ready_s, 0.02 / 1.001, 1e-9);
  EXPECT_EQ(decodeMtData(sent[7].message, 0x0004, 1)->counter, 7) << "counts messages";
}

TEST(MtiState, CounterWraps) {
  Conversation host;
  host.tell(MessageId::kGoToConfig);
  host.tell(MessageId::kGoToMeasurement);
  const std::vector<MtiState::Outgoing> sent = host.wait(655.4);
  ASSERT_EQ(sent.size(), 65540U);
  EXPECT_EQ(decodeMtData(sent[65535].message, 0x0004, 1)->counter, 65535);
  EXPECT_EQ(decodeMtData(sent[65536].message, 0x0004, 1)->counter, 0);
}

TEST(MtiState, SendsOnRequestOnly) {
  Conversation host;
  host.tell(MessageId::kGoToConfig);
  host.tell(MessageId::kSetOutputSkipFactor, {0xFF, 0xFF});
  host.tell(MessageId::kGoToMeasurement);
  EXPECT_TRUE(host.wait(1.0).empty());
  for (int i = 0; i < 2; ++i) {
    const std::vector<Message> answers = host.tell(MessageId::kReqData);
    ASSERT_EQ(answers.size(), 1U);
    EXPECT_EQ(decodeMtData(answers[0], 0x0004, 1)->counter, i);
  }
}

TEST(MtiState, AllOrientationModesAgree) {
  for (const std::uint32_t kind : {mti::output_settings::kQuaternion, mti::output_settings::kEuler,
                                   mti::output_settings::kMatrix}) {
    Conversation host;
    host.configure(kCalibratedAndOrientation, kind | 1U);
    const mti::MtData data = host.measure();
    expectRotation(*data.orientation, northWestUp(somehow()));
    EXPECT_LT((*data.orientation * *data.acceleration - Vector3d(0.0, 0.0, 9.82)).norm(), 1e-4);
    EXPECT_LT((*data.orientation * *data.magnetic_field - Vector3d(0.4, 0.0, -0.9)).norm(), 1e-4)
        << "x is magnetic north";
    Conversation ned;
    ned.configure(kCalibratedAndOrientation, kind | mti::output_settings::kNorthEastDown);
    const mti::MtData down = ned.measure();
    EXPECT_LT((*down.orientation * *down.acceleration - Vector3d(0.0, 0.0, -9.82)).norm(), 1e-4);
    EXPECT_LT((*down.orientation * *down.magnetic_field - Vector3d(0.4, 0.0, 0.9)).norm(), 1e-4);
  }
}

TEST(MtiState, HeadingResetKeepsTheVertical) {
  Conversation host;
  host.configure(kCalibratedAndOrientation, 1);
  const mti::MtData before = host.measure();
  host.reset(1);
  const mti::MtData after = host.measure();
  const Vector3d angles = rollPitchYaw(after.orientation->toRotationMatrix());
  const Vector3d old = rollPitchYaw(before.orientation->toRotationMatrix());
  EXPECT_NEAR(angles.z(), 0.0, 1e-6);
  EXPECT_NEAR(angles.x(), old.x(), 1e-6);
  EXPECT_NEAR(angles.y(), old.y(), 1e-6);
  EXPECT_EQ(after.acceleration, before.acceleration) << "calibrated data stay in the sensor frame";
}

TEST(MtiState, GlobalResetMakesTheSensorTheEarth) {
  Conversation host;
  host.configure(kCalibratedAndOrientation, 1);
  const mti::MtData before = host.measure();
  host.reset(2);
  const mti::MtData after = host.measure();
  expectRotation(*after.orientation, Quaterniond::Identity());
  EXPECT_EQ(after.acceleration, before.acceleration);
}

TEST(MtiState, ObjectResetLevelsTheOutputFrame) {
  Conversation host;
  host.configure(kCalibratedAndOrientation, 1);
  const Vector3d x = *host.measure().orientation * Vector3d::UnitX();
  host.reset(3);
  const mti::MtData after = host.measure();
  const Vector3d angles = rollPitchYaw(after.orientation->toRotationMatrix());
  EXPECT_NEAR(angles.x(), 0.0, 1e-6);
  EXPECT_NEAR(angles.y(), 0.0, 1e-6);
  EXPECT_NEAR(angles.z(), std::atan2(x.y(), x.x()), 1e-6) << "heading of the sensor's x axis";
  EXPECT_LT((*after.acceleration - Vector3d(0.0, 0.0, 9.82)).norm(), 1e-4) << "data turn with it";
  EXPECT_LT((*after.orientation * *after.magnetic_field - Vector3d(0.4, 0.0, -0.9)).norm(), 1e-4);
}

TEST(MtiState, AlignIsObjectThenHeading) {
  Conversation host;
  host.configure(kCalibratedAndOrientation, 1);
  host.reset(4);
  const mti::MtData aligned = host.measure();
  expectRotation(*aligned.orientation, Quaterniond::Identity());
  EXPECT_LT((*aligned.acceleration - Vector3d(0.0, 0.0, 9.82)).norm(), 1e-4);
  Conversation twice;
  twice.configure(kCalibratedAndOrientation, 1);
  twice.reset(3);
  twice.reset(1);
  const mti::MtData both = twice.measure();
  expectRotation(*both.orientation, *aligned.orientation);
  EXPECT_LT((*both.magnetic_field - *aligned.magnetic_field).norm(), 1e-6);
}

TEST(MtiState, ResetsLastOnlyWhenStored) {
  for (const bool store : {false, true}) {
    Conversation host;
    host.configure(kCalibratedAndOrientation, 1);
    const Quaterniond before = *host.measure().orientation;
    host.reset(4);
    EXPECT_TRUE(host.acknowledges(MessageId::kGoToConfig));
    if (store) host.reset(0);
    host.device.powerOn(host.now);
    host.wait(host.now + 0.5);
    expectRotation(*host.measure().orientation, store ? Quaterniond::Identity() : before);
  }
}

TEST(MtiState, ObjectAlignmentAndHeadingCanBeSet) {
  Conversation host;
  host.tell(MessageId::kGoToConfig);
  mti::ByteWriter matrix;  // x of the object is y of the sensor, y is z, z is x
  for (const double value : {0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0}) matrix.f32(value);
  mti::ByteWriter heading;
  heading.f32(0.5);
  EXPECT_TRUE(host.acknowledges(MessageId::kSetObjectAlignment, matrix.bytes()));
  EXPECT_TRUE(host.acknowledges(MessageId::kSetObjectAlignment, {}, matrix.bytes()));
  EXPECT_TRUE(host.acknowledges(MessageId::kSetHeading, heading.bytes()));
  EXPECT_TRUE(host.acknowledges(MessageId::kSetHeading, {}, heading.bytes()));
  host.configure(kCalibratedAndOrientation, 1);
  const mti::MtData data = host.measure();
  EXPECT_LT((*data.angular_velocity - Vector3d(0.2, 0.3, 0.1)).norm(), 1e-6);
  const Vector3d up = *data.orientation * *data.acceleration;
  EXPECT_LT((up - Vector3d(0.0, 0.0, 9.82)).norm(), 1e-4);
  const Vector3d north = *data.orientation * *data.magnetic_field;
  EXPECT_NEAR(std::atan2(north.y(), north.x()), 0.5, 1e-5);
}

TEST(MtiState, ResetStartsAnewWithWhatWasSet) {
  Conversation host;
  host.tell(MessageId::kGoToConfig);
  host.tell(MessageId::kSetOutputSkipFactor, {0, 1});
  EXPECT_TRUE(host.acknowledges(MessageId::kSetBaudRate, {0x00}));
  EXPECT_EQ(host.device.baudRate(), 115200) << "not yet";
  const std::vector<Message> answers = host.tell(MessageId::kReset);
  ASSERT_EQ(answers.size(), 2U);
  EXPECT_EQ(answers[0].id, 0x41);
  EXPECT_TRUE(answers[1].is(MessageId::kWakeUp));
  EXPECT_EQ(host.device.baudRate(), 460800);
  EXPECT_EQ(host.wait(1.5).size(), 50U);
}

TEST(MtiState, AnswersErrorsOnRequest) {
  Conversation host;
  host.device.setAnswerErrors(true);
  EXPECT_EQ(host.errorOf(MessageId::kGoToConfig), 4);
  host.device.setAnswerErrors(false);
  EXPECT_TRUE(host.acknowledges(MessageId::kGoToConfig));
}

TEST(MtiState, FollowsTheSamplesFromTheStartOn) {
  std::vector<MtiSample> samples;
  for (int i = 0; i <= 100; ++i) samples.push_back(sampleAt(0.01 * i, expSo3({0, 0, 0.01 * i})));
  Conversation host(samples);
  host.configure(kCalibratedAndOrientation, 1);
  EXPECT_LT(angleBetween(*host.measure().orientation, northWestUp(Quaterniond::Identity())), 1e-6);
  host.device.start(1.0);
  for (const MtiState::Outgoing& sent : host.wait(3.0)) {
    const double time_s = std::clamp(sent.ready_s - 0.00197 - 1.0, 0.0, 1.0);
    const Result<mti::MtData> data = decodeMtData(sent.message, kCalibratedAndOrientation, 1);
    ASSERT_TRUE(data.isOk());
    expectRotation(*data->orientation, northWestUp(expSo3({0, 0, time_s})));
  }
}

}  // namespace
}  // namespace scanner::simulation
