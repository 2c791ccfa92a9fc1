// Lost packets, slow readers, pulled cables, busy cameras, stops and starts.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "bumblebee/aravis_fixture.h"

namespace scanner::bumblebee {
namespace {

TEST_F(AravisTest, LostPacketsAreCountedAndNoWrongFramePasses) {
  plug(30.0, 512, 384);  // 50 packets a frame
  const auto camera = stream();
  ASSERT_TRUE(camera);
  auto frame = camera->grab(kPatience);
  ASSERT_TRUE(frame);
  device_->setLostPackets(0.01);
  // A busy machine loses packets of its own, before and after those that are left out here.
  std::uint64_t good = frame->status ? 1 : 0;
  std::uint64_t damaged = 1 - good;
  std::uint64_t gaps = 0;
  bool sound_again = false;
  const std::uint64_t first = numberOf(*frame->counter);
  std::uint64_t last = first;
  for (int i = 0; i < 90; ++i) {
    if (i == 80) device_->setLostPackets(0.0);
    frame = camera->grab(kPatience);
    ASSERT_TRUE(frame) << frame.status().message();
    ASSERT_TRUE(frame->counter);
    const std::uint64_t number = numberOf(*frame->counter);
    ASSERT_GT(number, last);
    gaps += number - last - 1;
    last = number;
    if (frame->status) {
      ++good;
      expectRight(*frame);
      sound_again = i > 80;
    } else {
      ++damaged;
      EXPECT_EQ(frame->status.code(), StatusCode::kNotEnoughData);
      EXPECT_TRUE(frame->bytes->empty());
      EXPECT_NE(frame->status.message().find("packets lost"), std::string::npos);
    }
  }
  EXPECT_TRUE(sound_again);
  EXPECT_EQ(good + damaged + gaps, last - first + 1);
  EXPECT_GT(damaged, 10U) << "40 % of 80";
  EXPECT_LT(damaged, 60U);
  const TransportStatistics statistics = camera->statistics();
  EXPECT_EQ(statistics.incomplete, damaged);
  EXPECT_EQ(statistics.frames, good);
  EXPECT_GE(statistics.lost_packets, damaged);
  EXPECT_LT(statistics.lost_packets, 100U) << "about 40 of 4000";
}

TEST_F(AravisTest, ASlowReaderGetsTheNewestFrames) {
  plug(100.0);
  TransportOptions options;
  options.buffers = 4;
  const auto camera = open(options);
  ASSERT_TRUE(camera && camera->configure(0, 0, {}) && camera->start());
  ASSERT_TRUE(camera->grab(kPatience));
  const std::uint64_t before = device_->framesTaken();
  const auto begin = Steady::now();
  while (device_->framesTaken() < before + 20 && secondsSince(begin) < 10.0) {
    std::this_thread::yield();
  }
  const auto frame = camera->grab(kPatience);
  ASSERT_TRUE(frame);
  expectRight(*frame);
  EXPECT_GT(numberOf(*frame->counter), before + 10);
  EXPECT_GT(camera->statistics().overruns, 10U);
}

TEST_F(AravisTest, UnplugIsNoticedAndTheCameraComesBack) {
  plug(30.0);
  auto camera = stream();
  ASSERT_TRUE(camera);
  ASSERT_TRUE(camera->grab(kPatience));
  device_->unplug();
  auto begin = Steady::now();
  for (;;) {
    const auto frame = camera->grab(kPatience);
    if (frame) continue;
    EXPECT_EQ(frame.status().code(), StatusCode::kIoError);
    EXPECT_NE(frame.status().message().find("gone"), std::string::npos);
    break;
  }
  EXPECT_LT(secondsSince(begin), 6.0);
  begin = Steady::now();
  EXPECT_EQ(camera->setControls({}).code(), StatusCode::kIoError);
  EXPECT_EQ(camera->start().code(), StatusCode::kIoError);
  camera.reset();
  EXPECT_LT(secondsSince(begin), 2.0) << "does not wait for farewells";
  EXPECT_FALSE(openAravis(kHere, {}));
  device_->plug();
  camera = stream();
  ASSERT_TRUE(camera);
  for (int i = 0; i < 3; ++i) {
    const auto frame = camera->grab(kPatience);
    ASSERT_TRUE(frame) << frame.status().message();
    expectRight(*frame);
  }
}

TEST_F(AravisTest, ARestartedCameraIsGoneAsWell) {
  plug(30.0);
  const auto camera = stream();
  ASSERT_TRUE(camera);
  ASSERT_TRUE(camera->grab(kPatience));
  device_->unplug();
  device_->plug();  // answers, but knows nothing of us
  Status status;
  const auto begin = Steady::now();
  while (status.code() != StatusCode::kIoError && secondsSince(begin) < 10.0) {
    status = camera->grab(kPatience).status();
  }
  EXPECT_EQ(status.code(), StatusCode::kIoError) << status.message();
}

TEST_F(AravisTest, ABusyCameraSaysSo) {
  plug(30.0);
  {
    const auto camera = stream();
    ASSERT_TRUE(camera);
    const auto second = openAravis(kHere, {});
    EXPECT_EQ(second.status().code(), StatusCode::kIoError);
    EXPECT_NE(second.status().message().find("busy"), std::string::npos)
        << second.status().message();
    const auto frame = camera->grab(kPatience);
    ASSERT_TRUE(frame);
    expectRight(*frame);
  }
  EXPECT_TRUE(openAravis(kHere, {})) << "free again";
}

TEST_F(AravisTest, StartsAndStopsAgainAndAgain) {
  plug(100.0);
  auto camera = stream();
  ASSERT_TRUE(camera);
  std::uint64_t last = 0;
  for (int i = 0; i < 5; ++i) {
    const auto frame = camera->grab(kPatience);
    ASSERT_TRUE(frame) << frame.status().message();
    expectRight(*frame);
    EXPECT_GE(*frame->counter, last);
    last = *frame->counter;
    camera->stop();
    camera->stop();
    EXPECT_EQ(camera->statistics().frames, 1U);
    ASSERT_TRUE(camera->start());
    ASSERT_TRUE(camera->start()) << "no harm";
  }
  camera.reset();  // while streaming
  EXPECT_TRUE(stream());
}

TEST_F(AravisTest, StopWakesAGrabInAnotherThread) {
  plug(0.2);
  const auto camera = stream();
  ASSERT_TRUE(camera);
  ASSERT_TRUE(camera->grab(kPatience));
  std::thread grabber([&] {
    EXPECT_EQ(camera->grab(std::chrono::seconds(60)).status().code(), StatusCode::kOutOfRange);
  });
  camera->stop();
  grabber.join();
}

}  // namespace
}  // namespace scanner::bumblebee
