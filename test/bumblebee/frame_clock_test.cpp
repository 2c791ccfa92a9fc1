#include "bumblebee/frame_clock.h"

#include <gtest/gtest.h>

#include <cmath>

#include "bumblebee/frame_counter.h"
#include "bumblebee/rate_meter.h"

namespace scanner::bumblebee {
namespace {

constexpr std::int64_t kEpoch_ns = 1'700'000'000'000'000'000;

/// Frames of a camera at 15 Hz whose clock began at 77 s and is 40 ppm fast. They arrive after
/// exposure and transfer, and now and then later.
class Stream {
 public:
  explicit Stream(StampMoment moment) : moment_(moment) {}

  Time truth(int i, double exposure_s) const { return at(i / 15.0 + 0.5 * exposure_s); }
  RawFrame frame(int i, double exposure_s, bool with_clock = true) const {
    const double start = i / 15.0;
    double moment = start;
    if (moment_ != StampMoment::kStartOfExposure) moment += exposure_s;
    const double delay = i % 5 == 0 ? 0.0 : 0.003 * (i % 4);
    RawFrame frame;
    frame.moment = moment_;
    if (with_clock) frame.device_time = fromSeconds(77.0 + moment * (1.0 + 40e-6));
    frame.arrival = at(start + exposure_s + kTransfer_s + delay);
    return frame;
  }
  static Time at(double seconds) { return fromNanoseconds(kEpoch_ns) + fromSeconds(seconds); }
  static constexpr double kTransfer_s = 0.0126;

 private:
  StampMoment moment_;
};

FrameClock::Input input(double exposure_s) {
  FrameClock::Input in;
  in.counted = true;
  in.period_s = 1.0 / 15.0;
  in.exposure_s = exposure_s;
  return in;
}

class FrameClockMoment : public testing::TestWithParam<StampMoment> {};

TEST_P(FrameClockMoment, StampsAreMidExposureWhateverTheExposure) {
  const Stream stream(GetParam());
  FrameClock clock;
  clock.restart(Stream::kTransfer_s);
  Time last{};
  for (int i = 0; i < 900; ++i) {
    const double exposure_s = i < 300 ? 0.008 : (i < 600 ? 0.001 : 0.012);
    const Time stamp = clock.stamp(stream.frame(i, exposure_s), input(exposure_s));
    EXPECT_GT(stamp, last);
    last = stamp;
    if (i % 300 < 30) continue;  // the fit settles
    EXPECT_NEAR(toSeconds(stamp - stream.truth(i, exposure_s)), 0.0, 0.0005) << i;
  }
  EXPECT_EQ(clock.source(), StampSource::kDeviceClock);
  EXPECT_NEAR(clock.driftPpm(), 40.0, 15.0);
}
INSTANTIATE_TEST_SUITE_P(All, FrameClockMoment,
                         testing::Values(StampMoment::kStartOfExposure, StampMoment::kEndOfExposure,
                                         StampMoment::kStartOfTransmission),
                         [](const testing::TestParamInfo<StampMoment>& moment) {
                           return "moment" + std::to_string(static_cast<int>(moment.param));
                         });

TEST(FrameClock, ASettingThatTheCameraTakesLateDoesNotPullTheClock) {
  const Stream stream(StampMoment::kStartOfExposure);
  FrameClock clock;
  clock.restart(Stream::kTransfer_s);
  for (int i = 0; i < 600; ++i) {
    // Said to be in force two frames before it is.
    const double real_s = (i / 100) % 2 == 0 ? 0.001 : 0.012;
    const double said_s = ((i + 2) / 100) % 2 == 0 ? 0.001 : 0.012;
    const Time stamp = clock.stamp(stream.frame(i, real_s), input(said_s));
    if (i < 30 || real_s != said_s) continue;
    EXPECT_NEAR(toSeconds(stamp - stream.truth(i, real_s)), 0.0, 0.001) << i;
  }
}

TEST(FrameClock, WithoutADeviceClockTheCounterSteadiesArrivals) {
  const Stream stream(StampMoment::kStartOfExposure);
  FrameClock clock;
  clock.restart(Stream::kTransfer_s);
  int previous = -1;
  for (int i = 0; i < 900; ++i) {
    if (i % 7 == 3) continue;  // dropped: the counter tells
    FrameClock::Input in = input(0.004);
    in.period_s = 1.003 / 15.0;  // what the camera is set to is not quite what it does
    in.advance = static_cast<std::uint64_t>(i - previous);
    previous = i;
    const Time stamp = clock.stamp(stream.frame(i, 0.004, false), in);
    if (i < 100) continue;
    EXPECT_NEAR(toSeconds(stamp - stream.truth(i, 0.004)), 0.0, 0.002) << i;
  }
  EXPECT_EQ(clock.source(), StampSource::kCounter);
}

TEST(FrameClock, WithoutAnythingItIsTheArrivalAndSaysSo) {
  const Stream stream(StampMoment::kStartOfExposure);
  FrameClock clock;
  clock.restart(Stream::kTransfer_s);
  FrameClock::Input in = input(0.004);
  in.counted = false;
  EXPECT_NEAR(toSeconds(clock.stamp(stream.frame(0, 0.004, false), in) - stream.truth(0, 0.004)),
              0.0, 1e-6);
  EXPECT_EQ(clock.source(), StampSource::kArrival);
  EXPECT_EQ(clock.driftPpm(), 0.0);
}

TEST(FrameClock, NeverGoesBackNotEvenOverStreams) {
  FrameClock clock;
  clock.restart(0.0);
  const Stream stream(StampMoment::kStartOfExposure);
  Time last{};
  for (int i = 0; i < 400; ++i) {
    if (i % 100 == 50) clock.restart(0.0);
    RawFrame frame = stream.frame(i, 0.01);
    if (i >= 150) frame.device_time = *frame.device_time - std::chrono::seconds(70);  // new power
    if (i >= 250) frame.arrival -= std::chrono::seconds(3);  // the host's clock is set
    if (i % 50 == 7) frame.device_time.reset();
    if (i % 50 == 8) frame.arrival -= std::chrono::seconds(1);
    const Time stamp = clock.stamp(frame, input(i % 2 == 0 ? 0.01 : 0.001));
    EXPECT_GT(stamp, last) << i;
    last = stamp;
  }
}

TEST(AssumedLatency, FollowsTheBus) {
  FrameFormat format;
  format.width_px = 1024;
  format.height_px = 768;
  CameraIdentity camera;
  camera.transport = Transport::kAravis;
  EXPECT_NEAR(assumedLatency(camera, format, {}), 0.0126, 0.0001);
  camera.vendor = "Aravis";
  EXPECT_EQ(assumedLatency(camera, format, {}), 0.0);
  camera.transport = Transport::kDc1394;
  EXPECT_NEAR(assumedLatency(camera, format, {}), 0.048, 0.0001) << "384 packets of 4096 bytes";
  camera.transport = Transport::kFile;
  EXPECT_EQ(assumedLatency(camera, format, {}), 0.0);
}

TEST(FrameCounter, WrapsAndKnowsWhatCannotBe) {
  FrameCounter counter;
  EXPECT_EQ(counter.step(65534, 1, 65535, 50), 1U);
  EXPECT_EQ(counter.step(65535, 1, 65535, 50), 1U);
  EXPECT_EQ(counter.step(1, 1, 65535, 50), 1U);
  EXPECT_EQ(counter.step(4, 1, 65535, 50), 3U);
  EXPECT_EQ(counter.step(4, 1, 65535, 50), std::nullopt);
  EXPECT_EQ(counter.step(2, 1, 65535, 50), 1U) << "back: reset";
  EXPECT_EQ(counter.step(1000, 1, 65535, 50), 1U) << "too far";
  EXPECT_EQ(counter.step(0xFFFFFFFF, 0, 0xFFFFFFFF, 50), 1U);
  EXPECT_EQ(counter.step(2, 0, 0xFFFFFFFF, 50), 3U);
  EXPECT_EQ(counter.step(1, 0, 0, 50), 1U) << "does not wrap";
  EXPECT_EQ(counter.step(UINT64_MAX, 0, UINT64_MAX, 50), 1U);
  EXPECT_EQ(counter.step(0, 0, UINT64_MAX, 50), 1U);
  counter.restart();
  EXPECT_EQ(counter.step(9, 1, 65535, 50), 1U);
}

TEST(RateMeter, CountsTheLastSecondsAndFallsSilent) {
  RateMeter meter;
  const RateMeter::Moment begin{};
  const auto at = [&](int ms) { return begin + std::chrono::milliseconds(ms); };
  EXPECT_EQ(meter.rates(at(0)).frames_hz, 0.0);
  for (int i = 0; i < 100; ++i) meter.add(at(100 * i), 1000);
  EXPECT_NEAR(meter.rates(at(9900)).frames_hz, 10.0, 1e-9);
  EXPECT_NEAR(meter.rates(at(9900)).bytes_hz, 10000.0, 1e-6);
  EXPECT_EQ(meter.rates(at(20000)).frames_hz, 0.0);
  meter.clear();
  EXPECT_EQ(meter.rates(at(9900)).frames_hz, 0.0);
}

}  // namespace
}  // namespace scanner::bumblebee
