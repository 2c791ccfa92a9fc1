#include "scanner/simulation/emulated_mti.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>

#include "scanner/core/se3.h"
#include "scanner/mti/mt_data.h"

namespace scanner::simulation {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Clock = std::chrono::steady_clock;
using Eigen::Vector3d;
using mti::Message;
using mti::MessageId;

constexpr double kPatienceS = 5.0;  ///< what a busy machine may take

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// A driver's end of the terminal.
class Host {
 public:
  explicit Host(const std::string& path, speed_t speed = B115200)
      : descriptor_(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) {
    EXPECT_GE(descriptor_, 0) << path;
    setSpeed(speed);
  }
  ~Host() { ::close(descriptor_); }
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  void setSpeed(speed_t speed) {
    termios settings{};
    EXPECT_EQ(::tcgetattr(descriptor_, &settings), 0);
    ::cfmakeraw(&settings);
    ::cfsetspeed(&settings, speed);
    EXPECT_EQ(::tcsetattr(descriptor_, TCSANOW, &settings), 0);
  }
  void tell(MessageId id, Bytes data = {}) {
    const Bytes bytes = mti::encode({static_cast<std::uint8_t>(id), std::move(data)});
    EXPECT_EQ(::write(descriptor_, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  /// The next message, or nothing within the time.
  std::optional<Message> next(double patience_s = kPatienceS) {
    const Clock::time_point start = Clock::now();
    while (true) {
      if (std::optional<Message> message = parser_.next()) return message;
      const double left_s = patience_s - since(start);
      if (left_s <= 0.0 || hung_up_) return std::nullopt;
      readMore(left_s);
    }
  }
  /// Skips what is not this message.
  std::optional<Message> nextOf(std::uint8_t id, double patience_s = kPatienceS) {
    const Clock::time_point start = Clock::now();
    while (std::optional<Message> message = next(patience_s - since(start))) {
      if (message->id == id) return message;
    }
    return std::nullopt;
  }
  bool ask(MessageId id, Bytes data = {}) {
    tell(id, std::move(data));
    return nextOf(static_cast<std::uint8_t>(static_cast<unsigned>(id) + 1U)).has_value();
  }
  void configure(std::uint8_t mode, std::uint8_t settings) {
    EXPECT_TRUE(ask(MessageId::kGoToConfig));
    EXPECT_TRUE(ask(MessageId::kSetOutputMode, {0, mode}));
    EXPECT_TRUE(ask(MessageId::kSetOutputSettings, {0, 0, 0, settings}));
  }
  bool hungUp() const { return hung_up_; }
  /// One portion of what has come.
  Bytes readMore(double patience_s) {
    pollfd state{descriptor_, POLLIN, 0};
    std::array<std::uint8_t, 4096> buffer{};
    if (::poll(&state, 1, static_cast<int>(std::ceil(1e3 * patience_s))) <= 0) return {};
    const ssize_t count = ::read(descriptor_, buffer.data(), buffer.size());
    hung_up_ = count == 0 || (count < 0 && errno == EIO);
    if (count <= 0) return {};
    parser_.push(buffer.data(), static_cast<std::size_t>(count));
    return {buffer.begin(), buffer.begin() + count};
  }
  const mti::MessageParser::Statistics& parsed() const { return parser_.statistics(); }

 private:
  int descriptor_;
  bool hung_up_ = false;
  mti::MessageParser parser_;
};

/// A turn about the vertical, 1 rad/s for 20 s.
std::vector<MtiSample> turning() {
  std::vector<MtiSample> samples;
  for (int i = 0; i < 2000; ++i) {
    MtiSample sample;
    sample.time_s = 0.01 * i;
    sample.imu.angular_velocity = Vector3d::UnitZ();
    sample.imu.linear_acceleration = 9.82 * Vector3d::UnitZ();
    sample.imu.orientation = expSo3(Vector3d(0.0, 0.0, 0.01 * i));
    sample.magnetic_field = Vector3d::UnitX();
    samples.push_back(sample);
  }
  return samples;
}

std::string uniqueLink() {
  return (std::filesystem::temp_directory_path() / ("scanner_mti_" + std::to_string(::getpid())))
      .string();
}

TEST(EmulatedMti, IsConfiguredAndMeasures) {
  EmulatedMti device({}, turning());
  Host host(device.path());
  host.configure(6, 1);
  host.tell(MessageId::kReqDid);
  const std::optional<Message> id = host.nextOf(0x01);
  ASSERT_TRUE(id);
  EXPECT_EQ(id->data, (Bytes{0x00, 0x30, 0x01, 0x23}));
  EXPECT_TRUE(host.ask(MessageId::kGoToMeasurement));
  for (int i = 0; i < 50; ++i) {
    const std::optional<Message> message = host.next();
    ASSERT_TRUE(message);
    const Result<mti::MtData> data = decodeMtData(*message, 6, 1);
    ASSERT_TRUE(data.isOk()) << data.status().message();
    EXPECT_EQ(data->counter, i);
    EXPECT_NEAR(data->acceleration->z(), 9.82, 1e-5);
  }
  EXPECT_EQ(host.parsed().skipped_bytes, 0U);
  EXPECT_GE(device.statistics().messages_sent, 50U);
  EXPECT_EQ(device.statistics().bad_requests, 0U);
}

TEST(EmulatedMti, SamplesArriveInTheirTime) {
  EmulatedMti device({}, turning());
  Host host(device.path());
  host.configure(6, 1);
  EXPECT_TRUE(host.ask(MessageId::kGoToMeasurement));
  const Clock::time_point zero = Clock::now();
  device.start();
  // Sampling, 1.97 ms, 59 bytes at 115200 baud: no message can be here before that.
  const double least_s = 0.00197 + 590.0 / 115200.0;
  double best_s = 1.0;
  for (int i = 0; i < 100; ++i) {
    const std::optional<Message> message = host.next();
    const double arrival_s = since(zero);
    ASSERT_TRUE(message);
    const Result<mti::MtData> data = decodeMtData(*message, 6, 1);
    ASSERT_TRUE(data.isOk());
    const double heading = rollPitchYaw(data->orientation->toRotationMatrix()).z();
    const double sampled_s = heading + std::acos(0.0);  // 1 rad/s; north-west-up is turned by -90
    if (sampled_s < 1e-3) continue;                     // before the start
    EXPECT_GT(arrival_s - sampled_s, least_s - 1e-3);
    best_s = std::min(best_s, arrival_s - sampled_s);
  }
  EXPECT_LT(best_s, least_s + 0.01) << "the least of a hundred latencies";
}

TEST(EmulatedMti, ResetWakesUpAgain) {
  EmulatedMti device({}, turning());
  Host host(device.path());
  EXPECT_TRUE(host.ask(MessageId::kGoToConfig));
  EXPECT_TRUE(host.ask(MessageId::kReset));
  ASSERT_TRUE(host.nextOf(0x3E)) << "WakeUp";
  host.tell(MessageId::kWakeUpAck);
  EXPECT_TRUE(host.ask(MessageId::kReqFirmwareRevision)) << "in config";
  EXPECT_TRUE(host.ask(MessageId::kReset));
  const std::optional<Message> data = host.nextOf(0x32);
  ASSERT_TRUE(data) << "not answered: measures";
  EXPECT_TRUE(decodeMtData(*data, 4, 1).isOk()) << "with the factory settings";
}

TEST(EmulatedMti, UnpluggedTheTerminalHangsUpAndComesBack) {
  EmulatedMti::Options options;
  options.link = uniqueLink();
  EmulatedMti device(options, turning());
  EXPECT_EQ(device.path(), options.link);
  {
    Host host(options.link);
    host.configure(6, 9);
    device.unplug();
    EXPECT_FALSE(host.next()) << "nothing follows";
    EXPECT_TRUE(host.hungUp());
    EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(options.link)));
    device.unplug();  // again: nothing happens
    device.plug();
    device.plug();
  }
  Host host(options.link);
  const std::optional<Message> data = host.nextOf(0x32);
  ASSERT_TRUE(data);
  EXPECT_EQ(data->data.size(), 74U) << "what was set survived";
}

TEST(EmulatedMti, TheLinkIsNotForcedUponOthers) {
  EmulatedMti::Options options;
  options.link = uniqueLink();
  std::ofstream(options.link) << "precious";
  EXPECT_THROW(EmulatedMti(options, turning()), ConfigurationError);
  EXPECT_EQ(std::filesystem::file_size(options.link), 8U);
  std::filesystem::remove(options.link);
  std::filesystem::create_symlink("/nowhere/at/all", options.link);  // left by one that crashed
  { const EmulatedMti device(options, turning()); }
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(options.link)));
  options.link = "/nowhere/at/all";
  EXPECT_THROW(EmulatedMti(options, turning()), ConfigurationError);
  options.link.clear();
  EXPECT_THROW(EmulatedMti(options, {}), ConfigurationError);
}

TEST(EmulatedMti, DamagedBytesAreCountedAndDetected) {
  EmulatedMti device({}, turning());
  EXPECT_THROW(device.setFaults({1.5, 0.0, false, false}), ConfigurationError);
  Host host(device.path());
  host.configure(6, 1);
  EXPECT_TRUE(host.ask(MessageId::kGoToMeasurement));
  device.setFaults({0.004, 0.004, false, false});
  int good = 0;
  for (int i = 0; i < 60; ++i) {
    const std::optional<Message> message = host.nextOf(0x32);
    ASSERT_TRUE(message);
    if (decodeMtData(*message, 6, 1).isOk()) ++good;
  }
  EXPECT_EQ(good, 60) << "the checksum holds back what is damaged";
  const EmulatedMti::Statistics statistics = device.statistics();
  EXPECT_GT(statistics.bytes_corrupted, 0U);
  EXPECT_GT(statistics.bytes_dropped, 0U);
  EXPECT_GT(host.parsed().skipped_bytes, 0U);
}

TEST(EmulatedMti, IsMuteOrAnswersErrorsOnRequest) {
  EmulatedMti device({}, turning());
  Host host(device.path());
  EXPECT_TRUE(host.ask(MessageId::kGoToConfig));
  device.setFaults({0.0, 0.0, true, false});
  host.tell(MessageId::kReqDid);
  EXPECT_TRUE(host.nextOf(0x42));
  device.setFaults({0.0, 0.0, false, true});
  host.tell(MessageId::kReqDid);
  EXPECT_FALSE(host.next(0.3));
  device.setFaults({});
  EXPECT_TRUE(host.ask(MessageId::kReqFirmwareRevision));
}

TEST(EmulatedMti, AHostAtAnotherBaudRateGetsGarbage) {
  EmulatedMti device({}, turning());
  Host host(device.path());
  EXPECT_TRUE(host.ask(MessageId::kGoToConfig));
  EXPECT_TRUE(host.ask(MessageId::kSetBaudRate, {0x00}));  // 460800
  EXPECT_TRUE(host.ask(MessageId::kReset));
  EXPECT_FALSE(host.nextOf(0x32, 0.8)) << "still at 115200";
  EXPECT_GT(host.parsed().skipped_bytes, 0U);
  host.setSpeed(B460800);
  EXPECT_TRUE(host.ask(MessageId::kGoToConfig));
}

TEST(EmulatedMti, ASlowLineLeavesSamplesOut) {
  EmulatedMti device({}, turning());
  Host host(device.path());
  host.configure(6, 1);
  EXPECT_TRUE(host.ask(MessageId::kSetBaudRate, {0x07}));  // 19200: 59 bytes take 31 ms
  EXPECT_TRUE(host.ask(MessageId::kReset));
  host.setSpeed(B19200);
  ASSERT_TRUE(host.nextOf(0x32));
  std::uint16_t last = 0;
  const Clock::time_point start = Clock::now();
  for (int i = 0; i < 20; ++i) {
    const std::optional<Message> message = host.nextOf(0x32);
    ASSERT_TRUE(message);
    last = *decodeMtData(*message, 6, 1)->counter;
  }
  EXPECT_GT(since(start), 19 * 590.0 / 19200.0);
  EXPECT_GT(last, 50) << "one sample of three has room";
  EXPECT_GT(device.statistics().messages_skipped, 0U);
}

TEST(EmulatedMti, AnAdapterDeliversInBursts) {
  EmulatedMti::Options options;
  options.burst_s = 0.1;
  EmulatedMti device(options, turning());
  Host host(device.path());
  host.configure(6, 1);
  EXPECT_TRUE(host.ask(MessageId::kGoToMeasurement));
  std::size_t most = 0;
  for (int i = 0; i < 5; ++i) most = std::max(most, host.readMore(kPatienceS).size());
  EXPECT_GE(most, 5U * 59U) << "about ten messages at once";
}

TEST(EmulatedMti, WhatNobodyReadsIsLost) {
  EmulatedMti device({}, turning());
  Host host(device.path());
  host.configure(6, 1);
  EXPECT_TRUE(host.ask(MessageId::kSetPeriod, {0, 225}));
  EXPECT_TRUE(host.ask(MessageId::kSetBaudRate, {0x80}));
  EXPECT_TRUE(host.ask(MessageId::kReset));
  host.setSpeed(B921600);
  // 30 kB/s fill the kernel's buffer in a few seconds at most; the device goes on all the same.
  const Clock::time_point start = Clock::now();
  while (device.statistics().bytes_overrun == 0 && since(start) < 10.0) {
    ::poll(nullptr, 0, 20);
  }
  EXPECT_GT(device.statistics().bytes_overrun, 0U);
  host.tell(MessageId::kGoToConfig);
  EXPECT_TRUE(host.nextOf(0x31)) << "answers as before";
}

TEST(EmulatedMti, NothingOldWaitsForTheNextHost) {
  EmulatedMti device({}, turning());
  std::uint16_t last = 0;
  {
    Host host(device.path());
    host.configure(6, 1);
    EXPECT_TRUE(host.ask(MessageId::kGoToMeasurement));
    last = *decodeMtData(*host.next(), 6, 1)->counter;
    const std::uint64_t sent = device.statistics().messages_sent;
    const Clock::time_point start = Clock::now();
    while (device.statistics().messages_sent < sent + 10 && since(start) < kPatienceS) {
      ::poll(nullptr, 0, 5);
    }
  }
  // Time is what this is about: samples of 0.2 s while nobody listens.
  ::poll(nullptr, 0, 200);
  Host host(device.path());
  const std::optional<Message> message = host.next();
  ASSERT_TRUE(message);
  EXPECT_GT(*decodeMtData(*message, 6, 1)->counter, last + 20) << "neither old nor unread";
}

}  // namespace
}  // namespace scanner::simulation
