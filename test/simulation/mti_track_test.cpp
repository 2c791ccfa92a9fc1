#include "simulation/mti_track.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "scanner/core/se3.h"
#include "scanner/core/status.h"
#include "simulation/serial_line.h"

namespace scanner::simulation {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Eigen::Vector3d;

/// Turns about the vertical with 1 rad/s.
MtiSample sampleAt(double time_s) {
  MtiSample sample;
  sample.time_s = time_s;
  sample.imu.orientation = expSo3(Vector3d(0.0, 0.0, time_s));
  return sample;
}

TEST(MtiTrack, InterpolatesTheMotionButNotTheNoise) {
  std::vector<MtiSample> samples;
  const auto rate = [](double t) { return Vector3d(std::sin(20.0 * t), 0.0, 1.0); };
  for (int i = 0; i < 100; ++i) {
    MtiSample sample = sampleAt(0.01 * i);
    sample.truth = sample.imu;
    sample.truth.angular_velocity = rate(sample.time_s);
    sample.imu.angular_velocity = sample.truth.angular_velocity;
    sample.imu.angular_velocity.y() = i % 2 == 0 ? 1.0 : -1.0;  // blending would give 0
    samples.push_back(sample);
  }
  const MtiTrack track(samples);
  for (double t = 0.02; t < 0.97; t += 0.0037) {
    const MtiReading reading = track.at(t);
    EXPECT_NEAR(reading.angular_velocity.x(), rate(t).x(), 2e-4) << t;
    EXPECT_NEAR(std::abs(reading.angular_velocity.y()), 1.0, 1e-12);
    EXPECT_LT(angleBetween(reading.orientation, expSo3(Vector3d(0.0, 0.0, t))), 1e-9);
  }
  EXPECT_EQ(track.at(-5.0).angular_velocity, samples.front().imu.angular_velocity);
  EXPECT_EQ(track.at(50.0).angular_velocity, samples.back().imu.angular_velocity);
}

TEST(MtiTrack, WaitsToAndFroThroughWhatLiesBeforeTheStart) {
  std::vector<MtiSample> samples;
  for (int i = -200; i <= 100; ++i) samples.push_back(sampleAt(0.01 * i));
  const MtiTrack track(samples);
  const auto turned = [&](double t) { return logSo3(track.at(t).orientation).z(); };
  EXPECT_NEAR(turned(-0.5), -0.5, 1e-9);
  EXPECT_NEAR(turned(-2.5), -1.5, 1e-9);  // on the way back
  EXPECT_NEAR(turned(-4.5), -0.5, 1e-9);
  EXPECT_NEAR(turned(0.5), 0.5, 1e-9);
  EXPECT_NEAR(logSo3(track.waiting(6.5).orientation).z(), -1.5, 1e-9);
}

TEST(MtiTrack, StandsStillAsAtTheEnd) {
  std::vector<MtiSample> samples;
  for (int i = 0; i <= 100; ++i) samples.push_back(sampleAt(0.01 * i));
  const MtiTrack track(samples, 0.4);
  EXPECT_NEAR(logSo3(track.at(1.1).orientation).z(), 0.9, 1e-9);
  EXPECT_NEAR(logSo3(track.at(1.5).orientation).z(), 0.7, 1e-9);
  EXPECT_NEAR(logSo3(track.at(1.9).orientation).z(), 0.9, 1e-9);
}

TEST(MtiTrack, RefusesUselessSamples) {
  EXPECT_THROW(MtiTrack({}), ConfigurationError);
  MtiSample blind = sampleAt(0.0);
  blind.imu.orientation.reset();
  EXPECT_THROW(MtiTrack({blind}), ConfigurationError);
  EXPECT_THROW(MtiTrack({sampleAt(1.0), sampleAt(1.0)}), ConfigurationError);
}

Bytes arrivedBytes(SerialLine& line, double now_s) {
  Bytes bytes;
  for (const SerialLine::Portion& portion : line.arrived(now_s)) {
    bytes.insert(bytes.end(), portion.bytes.begin(), portion.bytes.end());
  }
  return bytes;
}

TEST(SerialLine, BytesTakeTenBitsEach) {
  SerialLine line(0.0);
  line.send(Bytes(54, 7), 1.0, 115200);
  line.send(Bytes(5, 8), 1.0, 9600);
  EXPECT_NEAR(line.nextArrival(), 1.0 + 160.0 / 115200.0, 1e-12);
  EXPECT_NEAR(line.freeAt(), 1.0 + 540.0 / 115200.0 + 50.0 / 9600.0, 1e-12);
  EXPECT_EQ(arrivedBytes(line, 1.0 + 320.5 / 115200.0).size(), 32U);
  EXPECT_EQ(arrivedBytes(line, 1.0 + 540.5 / 115200.0).size(), 22U);
  EXPECT_EQ(arrivedBytes(line, 2.0), Bytes(5, 8));
  EXPECT_TRUE(line.arrived(9.0).empty());
  EXPECT_EQ(line.nextArrival(), std::numeric_limits<double>::infinity());
}

TEST(SerialLine, AnAdapterCollectsBytes) {
  SerialLine line(0.016);
  for (int i = 0; i < 10; ++i) line.send(Bytes(54, 1), 0.01 * i, 115200);
  std::size_t total = 0;
  for (int burst = 1; total < 540; ++burst) {
    ASSERT_LT(burst, 20);
    EXPECT_TRUE(line.arrived(0.016 * burst - 1e-6).empty());
    total += arrivedBytes(line, 0.016 * burst + 1e-6).size();
  }
  line.send(Bytes(54, 1), 1.0, 115200);
  line.clear();
  EXPECT_TRUE(line.arrived(9.0).empty());
}

}  // namespace
}  // namespace scanner::simulation
