#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <vector>

#include "scanner/core/se3.h"
#include "scanner/mti/plausibility.h"

namespace scanner::mti {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr std::uint16_t kMode = output_mode::kCalibrated | output_mode::kOrientation;
constexpr std::uint32_t kMatrix = output_settings::kSampleCounter | output_settings::kMatrix;
constexpr std::uint32_t kQuaternion = output_settings::kSampleCounter;

/// Deterministic on every machine.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : state_(seed) {}
  std::uint64_t bits() {  // splitmix64
    std::uint64_t z = state_ += 0x9E3779B97F4A7C15ULL;
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31U);
  }
  double uniform() { return static_cast<double>(bits() >> 11U) * 0x1p-53; }
  double normal() {
    return std::sqrt(-2.0 * std::log(1.0 - uniform())) * std::cos(6.283185307179586 * uniform());
  }
  Vector3d normals() {
    const double x = normal();
    const double y = normal();
    return {x, y, normal()};
  }

 private:
  std::uint64_t state_;
};

/// Six sines from 0.3 to 9 Hz on each axis: walking, turning, trembling.
Vector3d sway(double t, double phase, double size) {
  Vector3d sum = Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    for (int k = 0; k < 6; ++k) {
      const double frequency = 0.3 + 1.7 * k + 0.13 * axis;
      sum[axis] += std::sin(6.283185307179586 * frequency * t + 2.0 * axis + phase + k) /
                   (1.0 + 0.6 * k * k);
    }
  }
  return size * sum;
}

struct Motion {
  double rate;          ///< rad/s
  double acceleration;  ///< m/s^2
  double knocks;        ///< share of samples with a knock of some 40 m/s^2
};
constexpr Motion kHandHeld = {0.24, 0.45, 0.0};
constexpr Motion kViolent = {8.0, 40.0, 0.01};

/// A recording at 100 Hz as the device would send it, with the noise of its data sheet.
struct Recording {
  std::vector<MtData> truth;  ///< as decoded from the undamaged message
  std::vector<Bytes> frames;

  Recording(int samples, const Motion& motion, std::uint32_t settings) {
    Dice dice(11);
    Quaterniond q = Quaterniond::Identity();
    for (int i = 0; i < samples; ++i) {
      const double t = 0.01 * i;
      MtData data;
      data.angular_velocity = sway(t, 0.0, motion.rate) + 0.007 * dice.normals();
      q = (q * expSo3(0.01 * *data.angular_velocity)).normalized();
      data.orientation = q;
      data.acceleration = sway(t, 1.0, motion.acceleration) + 0.01 * dice.normals() +
                          q.conjugate() * Vector3d(0.0, 0.0, 9.81);
      if (dice.uniform() < motion.knocks) *data.acceleration += 40.0 * dice.normals();
      data.magnetic_field =
          q.conjugate() * Vector3d(0.4 + 0.02 * std::sin(t), 0.0, -0.9) + 0.001 * dice.normals();
      data.counter = static_cast<std::uint16_t>(65000 + i);
      const Message message = encodeMtData(data, kMode, settings);
      truth.push_back(*decodeMtData(message, kMode, settings));
      frames.push_back(encode(message));
    }
  }
};

bool same(const MtData& a, const MtData& b) {
  return a.acceleration == b.acceleration && a.angular_velocity == b.angular_velocity &&
         a.magnetic_field == b.magnetic_field && a.counter == b.counter &&
         a.orientation->coeffs() == b.orientation->coeffs();
}

struct Outcome {
  int sent = 0;
  int unhit = 0;          ///< no byte of them was damaged
  int unhit_lost = 0;     ///< and yet not given on
  int wrong_decoded = 0;  ///< passed checksum and decoder
  int wrong = 0;          ///< given on with any bit different
  int visible = 0;        ///< given on and off by more than the sensor's noise
  int duplicates = 0;     ///< given on twice or out of order
  int wrong_counters = 0;
  double worst_acceleration = 0.0, worst_rate = 0.0, worst_field = 0.0, worst_rotation = 0.0;
  PlausibilityFilter::Statistics filter;
};

/// Receives what is left of a recording; a reading's arrival tells which frame it came from.
class Receiver {
 public:
  Receiver(const Recording& recording, std::uint32_t settings)
      : recording_(recording), settings_(settings), got_(recording.frames.size(), 0) {}

  void receive(const Bytes& bytes) {
    parser_.push(bytes.data(), bytes.size());
    while (const auto message = parser_.next()) {
      framed_ += encode(*message).size();
      const std::size_t end = framed_ + parser_.statistics().skipped_bytes;
      const std::size_t index = (end - 1) / recording_.frames[0].size();
      std::optional<Reading> reading;
      if (auto data = decodeMtData(*message, kMode, settings_)) {
        reading = Reading{*data, fromNanoseconds(static_cast<std::int64_t>(index)),
                          rotationDefect(*message, kMode, settings_)};
        outcome_.wrong_decoded += same(*data, recording_.truth[index]) ? 0 : 1;
      }
      filter_.push(*message, std::move(reading), parser_.statistics());
      take();
    }
  }

  Outcome finish(const std::vector<bool>& hit) {
    filter_.flush();
    take();
    outcome_.sent = static_cast<int>(hit.size());
    for (std::size_t i = 0; i < hit.size(); ++i) {
      outcome_.unhit += hit[i] ? 0 : 1;
      outcome_.unhit_lost += !hit[i] && got_[i] == 0 ? 1 : 0;
    }
    outcome_.filter = filter_.statistics();
    return outcome_;
  }

 private:
  void take() {
    while (const auto reading = filter_.next()) {
      const std::int64_t index = toNanoseconds(reading->arrival);
      outcome_.duplicates += index > last_ ? 0 : 1;
      last_ = index;
      got_[static_cast<std::size_t>(index)] = 1;
      compare(reading->data, recording_.truth[static_cast<std::size_t>(index)]);
    }
  }

  void compare(const MtData& data, const MtData& truth) {
    if (same(data, truth)) return;
    const auto off = [](const auto& a, const auto& b) { return (*a - *b).cwiseAbs().maxCoeff(); };
    const double acceleration = off(data.acceleration, truth.acceleration);
    const double rate = off(data.angular_velocity, truth.angular_velocity);
    const double field = off(data.magnetic_field, truth.magnetic_field);
    const double rotation = angleBetween(*data.orientation, *truth.orientation);
    ++outcome_.wrong;
    outcome_.wrong_counters += data.counter == truth.counter ? 0 : 1;
    // Three standard deviations of the noise.
    const bool visible = acceleration > 0.03 || rate > 0.021 || field > 0.003 || rotation > 1e-3;
    outcome_.visible += visible ? 1 : 0;
    outcome_.worst_acceleration = std::max(outcome_.worst_acceleration, acceleration);
    outcome_.worst_rate = std::max(outcome_.worst_rate, rate);
    outcome_.worst_field = std::max(outcome_.worst_field, field);
    outcome_.worst_rotation = std::max(outcome_.worst_rotation, rotation);
  }

  const Recording& recording_;
  std::uint32_t settings_;
  std::vector<char> got_;
  MessageParser parser_{254};
  PlausibilityFilter filter_;
  std::size_t framed_ = 0;
  std::int64_t last_ = -1;
  Outcome outcome_;
};

/// Sends a recording over a line that flips one bit in this share of its bytes.
Outcome overDamagedLine(const Recording& recording, std::uint32_t settings, double share) {
  Dice dice(5);
  Receiver receiver(recording, settings);
  std::vector<bool> hit;
  for (Bytes frame : recording.frames) {
    bool damaged = false;
    for (std::uint8_t& byte : frame) {
      if (dice.uniform() >= share) continue;
      byte ^= static_cast<std::uint8_t>(1U << (dice.bits() % 8U));
      damaged = true;
    }
    hit.push_back(damaged);
    receiver.receive(frame);
  }
  const Outcome outcome = receiver.finish(hit);
  std::printf(
      "%.3g%% of bytes hit: %d samples, %d unhit, of them %d lost; wrong: %d decoded, %d given on, "
      "%d of them visibly (at most %.3g m/s2, %.3g rad/s, %.3g fields, %.3g rad); rejected: "
      "%llu counter, %llu rotation, %llu jump\n",
      100.0 * share, outcome.sent, outcome.unhit, outcome.unhit_lost, outcome.wrong_decoded,
      outcome.wrong, outcome.visible, outcome.worst_acceleration, outcome.worst_rate,
      outcome.worst_field, outcome.worst_rotation,
      static_cast<unsigned long long>(outcome.filter.rejected_counter),
      static_cast<unsigned long long>(outcome.filter.rejected_rotation),
      static_cast<unsigned long long>(outcome.filter.rejected_jump));
  return outcome;
}

TEST(Plausibility, ASoundLineLosesNothingAndWaitsForNothingHoweverViolentTheMotion) {
  for (const std::uint32_t settings : {kMatrix, kQuaternion}) {
    const Recording recording(20000, kViolent, settings);
    const Outcome outcome = overDamagedLine(recording, settings, 0.0);
    EXPECT_EQ(outcome.filter.accepted, 20000U);
    EXPECT_EQ(outcome.filter.held, 0U);
    EXPECT_EQ(outcome.unhit_lost, 0);
    EXPECT_EQ(outcome.wrong, 0);
    EXPECT_EQ(outcome.duplicates, 0);
  }
}

TEST(Plausibility, NowAndThenAFlippedBitLosesThatSampleOnly) {
  const Recording recording(20000, kHandHeld, kMatrix);
  const Outcome outcome = overDamagedLine(recording, kMatrix, 1e-5);
  EXPECT_LT(outcome.unhit, 20000);
  EXPECT_EQ(outcome.unhit_lost, 0);
  EXPECT_EQ(outcome.wrong, 0);
}

/// The figures that the header speaks of.
TEST(Plausibility, OnePercentOfBytesDamaged) {
  for (const std::uint32_t settings : {kMatrix, kQuaternion}) {
    const int samples = 100000;
    const Recording recording(samples, kHandHeld, settings);
    const Outcome outcome = overDamagedLine(recording, settings, 0.01);
    EXPECT_GT(outcome.wrong_decoded, samples / 400) << "else the filter has nothing to show";
    EXPECT_LT(outcome.wrong, samples / 300) << "bits below the noise: nothing tells them apart";
    EXPECT_LT(outcome.visible, samples / 1000);
    EXPECT_LT(outcome.unhit_lost, outcome.unhit / 1000);
    EXPECT_LT(outcome.worst_rotation, settings == kMatrix ? 2e-6 : 0.05);
    EXPECT_EQ(outcome.wrong_counters, 0);
    EXPECT_EQ(outcome.duplicates, 0);
  }
}

/// One wrong number in one message of a line that was seen to be damaged just before.
class OneWrongMessage : public testing::Test {
 protected:
  static constexpr std::size_t kAt = 300;
  template <typename Change>
  PlausibilityFilter::Statistics after(const Change& change) {
    const Recording recording(400, kHandHeld, kMatrix);
    PlausibilityFilter filter;
    MessageParser::Statistics line;
    for (std::size_t i = 0; i < recording.frames.size(); ++i) {
      Reading reading{recording.truth[i], {}, 1e-7};
      if (i == kAt - 5) line.checksum_errors = 1;
      if (i == kAt) change(reading);
      const Message message{0x32, Bytes(74)};
      filter.push(message, reading, line);
    }
    filter.flush();
    return filter.statistics();
  }
};

TEST_F(OneWrongMessage, IsRejectedForWhatIsWrong) {
  const auto none = after([](Reading&) {});
  EXPECT_EQ(none.accepted, 400U);
  EXPECT_GT(none.held, 50U);
  EXPECT_EQ(after([](Reading& r) { *r.data.counter ^= 1U; }).rejected_counter, 1U);
  EXPECT_EQ(after([](Reading& r) { r.rotation_defect = 1e-5; }).rejected_rotation, 1U);
  EXPECT_EQ(after([](Reading& r) { r.data.acceleration->x() += 2.0; }).rejected_jump, 1U);
  EXPECT_EQ(after([](Reading& r) { r.data.angular_velocity->y() -= 1.0; }).rejected_jump, 1U);
  EXPECT_EQ(after([](Reading& r) { r.data.magnetic_field->z() *= -1.0; }).rejected_jump, 1U);
  EXPECT_EQ(after([](Reading& r) {
              r.data.orientation = *r.data.orientation * expSo3(Vector3d(0.1, 0.0, 0.0));
            }).rejected_jump,
            1U);
}

TEST(Plausibility, BytesLostOnTheLineAreNoReasonToRejectTheRest) {
  Dice dice(9);
  const Recording recording(20000, kHandHeld, kMatrix);
  PlausibilityFilter filter;
  MessageParser parser(254);
  std::uint64_t whole = 0;
  for (const Bytes& frame : recording.frames) {
    Bytes left;
    for (const std::uint8_t byte : frame) {
      if (dice.uniform() >= 0.002) left.push_back(byte);
    }
    parser.push(left.data(), left.size());
    while (const auto message = parser.next()) {
      std::optional<Reading> reading;
      if (auto data = decodeMtData(*message, kMode, kMatrix)) {
        reading = Reading{*data, {}, rotationDefect(*message, kMode, kMatrix)};
        ++whole;
      }
      filter.push(*message, std::move(reading), parser.statistics());
    }
  }
  filter.flush();
  EXPECT_GT(whole, 15000U);
  EXPECT_LT(filter.statistics().rejected(), whole / 1000);
}

TEST(Plausibility, ARestartForgetsTheStreamButNotTheCounts) {
  const Recording recording(10, kHandHeld, kMatrix);
  PlausibilityFilter filter;
  MessageParser::Statistics line;
  const Message message{0x32, Bytes(74)};
  for (const MtData& data : recording.truth) {
    ++line.checksum_errors;
    filter.push(message, Reading{data, {}, 0.0}, line);
  }
  EXPECT_FALSE(filter.lineIsSound());
  const std::uint64_t accepted = filter.statistics().accepted;
  filter.restart();
  EXPECT_FALSE(filter.next());
  filter.push(message, Reading{recording.truth[0], {}, 0.0}, {});
  EXPECT_TRUE(filter.next()) << "a new stream begins sound";
  EXPECT_EQ(filter.statistics().accepted, accepted + 1);
}

}  // namespace
}  // namespace scanner::mti
