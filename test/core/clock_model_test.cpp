#include "scanner/core/clock_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "scanner/core/status.h"

namespace scanner {
namespace {

const Time kStart = fromNanoseconds(1'700'000'000'000'000'000);

/// A device whose samples a host reads, with or without an adapter that collects them.
struct Stream {
  double rate_hz = 100.0;
  double drift_ppm = 0.0;  ///< positive: the device's clock is fast
  double burst_s = 0.0;
  double phase_s = 0.0037;   ///< of the bursts
  double delay_s = 60e-6;    ///< mean of the host's own delay, exponential
  double stall_share = 0.0;  ///< of the reads that are late by stall_s besides
  double stall_s = 5e-3;
  bool earliest = true;  ///< tell the model of the read before
};

struct Quality {
  double rms = 0.0;            ///< s, against the true sample time
  double rms_of_jitter = 0.0;  ///< the same without the mean
  double largest = 0.0;
  int not_increasing = 0;
};

class Reader {
 public:
  Reader(const Stream& stream, unsigned seed) : stream_(stream), random_(seed) {}

  /// True host time of sample i, seconds since the start.
  double truth(int i) const { return i / stream_.rate_hz / (1.0 + 1e-6 * stream_.drift_ppm); }
  Time stamp(ClockModel* model, int i) {
    const double sampled = truth(i);
    const double tick =
        stream_.burst_s > 0.0
            ? std::ceil((sampled - stream_.phase_s) / stream_.burst_s) * stream_.burst_s +
                  stream_.phase_s
            : sampled;
    if (!tick_ || tick > *tick_) {
      read_before_ = read_;
      read_ = std::max(tick + delay(), read_.value_or(tick));
      tick_ = tick;
    }
    ClockModel::Evidence evidence;
    if (stream_.earliest && read_before_) evidence.earliest = at(*read_before_);
    if (last_tick_ == tick_) evidence.earliest = Time::min();  // only the first of a burst
    last_tick_ = tick_;
    return model->update(fromSeconds(i / stream_.rate_hz), at(*read_), evidence);
  }
  Time at(double seconds) const { return kStart + fromSeconds(seconds) + step_; }
  void stepHost(Duration step) { step_ += step; }

 private:
  double uniform() { return (static_cast<double>(random_() >> 11U) + 0.5) * 0x1p-53; }
  double delay() {
    return -stream_.delay_s * std::log(uniform()) +
           (uniform() < stream_.stall_share ? stream_.stall_s : 0.0);
  }

  Stream stream_;
  std::mt19937_64 random_;
  std::optional<double> tick_, last_tick_, read_, read_before_;
  Duration step_{};
};

/// Of the stamps from `from_s` to `to_s`.
Quality run(const Stream& stream, double from_s, double to_s) {
  ClockModel model;
  Reader reader(stream, 7);
  Quality quality;
  double sum = 0.0;
  double squares = 0.0;
  int count = 0;
  std::optional<Time> last;
  for (int i = 0; i < to_s * stream.rate_hz; ++i) {
    const Time stamp = reader.stamp(&model, i);
    if (last && stamp <= *last) ++quality.not_increasing;
    last = stamp;
    if (i < from_s * stream.rate_hz) continue;
    const double error = toSeconds(stamp - reader.at(reader.truth(i)));
    sum += error;
    squares += error * error;
    quality.largest = std::max(quality.largest, std::abs(error));
    ++count;
  }
  const double mean = sum / count;
  quality.rms = std::sqrt(squares / count);
  quality.rms_of_jitter = std::sqrt(std::max(0.0, squares / count - mean * mean));
  return quality;
}

Stream bursts(double drift_ppm) {
  Stream stream;
  stream.drift_ppm = drift_ppm;
  stream.burst_s = 0.016;
  return stream;
}

TEST(ClockModel, BurstsLeaveLittleJitter) {
  for (const double drift_ppm : {-100.0, -60.0, -30.0, 30.0, 60.0, 100.0}) {
    Stream stream = bursts(drift_ppm);
    stream.stall_share = 0.01;
    // Bursts of 16 ms and samples every 10 ms tell more only as fast as the clocks drift.
    const Quality quality = run(stream, 120.0, 420.0);
    EXPECT_LT(quality.rms, 0.2e-3) << drift_ppm;
    EXPECT_LT(quality.rms_of_jitter, 0.1e-3) << drift_ppm;
    EXPECT_LT(quality.largest, 0.6e-3) << drift_ppm;
    EXPECT_EQ(quality.not_increasing, 0) << drift_ppm;
  }
}

TEST(ClockModel, WithoutDriftBurstsLeaveAnOffset) {
  // Phases of 2 ms that never move: nobody can tell where in them the samples are.
  const Quality quality = run(bursts(0.0), 10.0, 120.0);
  EXPECT_LT(quality.rms, 1.1e-3);
  EXPECT_LT(quality.rms_of_jitter, 0.1e-3);
}

TEST(ClockModel, TheBurstBeforeIsWorthKnowing) {
  Stream stream = bursts(30.0);
  const Quality with = run(stream, 120.0, 420.0);
  stream.earliest = false;
  const Quality without = run(stream, 120.0, 420.0);
  EXPECT_LT(with.rms, 0.5 * without.rms);
}

TEST(ClockModel, TheStartIsCalm) {
  for (const double drift_ppm : {-100.0, 0.0, 100.0}) {
    const Quality quality = run(bursts(drift_ppm), 0.0, 10.0);
    EXPECT_EQ(quality.not_increasing, 0);
    EXPECT_LT(quality.largest, 16e-3) << "never outside of the first burst";
    EXPECT_LT(run(bursts(drift_ppm), 0.3, 10.0).largest, 2.2e-3);
  }
}

TEST(ClockModel, PromptArrivalsAreFollowedClosely) {
  for (const double drift_ppm : {-100.0, 0.0, 30.0}) {
    for (const bool earliest : {false, true}) {
      Stream stream;
      stream.drift_ppm = drift_ppm;
      stream.stall_share = 0.02;
      stream.earliest = earliest;
      EXPECT_LT(run(stream, 1.0, 60.0).rms, 0.05e-3) << drift_ppm;
      EXPECT_LT(run(stream, 60.0, 120.0).rms, 0.01e-3) << drift_ppm;
    }
  }
}

TEST(ClockModel, FindsTheDrift) {
  for (const double drift_ppm : {-80.0, 0.0, 25.0}) {
    ClockModel model;
    Stream stream;
    stream.drift_ppm = drift_ppm;
    Reader reader(stream, 1);
    reader.stamp(&model, 0);
    EXPECT_FALSE(model.ready());
    EXPECT_EQ(model.driftPpm(), 0.0);
    for (int i = 1; i < 6000; ++i) reader.stamp(&model, i);
    EXPECT_TRUE(model.ready());
    EXPECT_NEAR(model.driftPpm(), drift_ppm, 1.0);
    EXPECT_NEAR(model.arrivalJitter(), stream.delay_s, 0.5 * stream.delay_s);
    model.restart();
    EXPECT_FALSE(model.ready());
    EXPECT_EQ(model.restarts(), 0U) << "of steps only";
  }
}

/// Stamps around a step of the host's clock after 20 s.
std::vector<double> errorsAround(Duration step, std::uint64_t* restarts) {
  ClockModel model;
  Reader reader(Stream(), 3);
  std::vector<double> errors;
  Time last = Time::min();
  for (int i = 0; i < 6000; ++i) {
    if (i == 2000) reader.stepHost(step);
    const Time stamp = reader.stamp(&model, i);
    EXPECT_GT(stamp, last) << i;
    last = stamp;
    errors.push_back(toSeconds(stamp - reader.at(reader.truth(i))));
  }
  *restarts = model.restarts();
  return errors;
}

TEST(ClockModel, AHostClockThatIsSetForwardIsFollowed) {
  std::uint64_t restarts = 0;
  const std::vector<double> errors = errorsAround(std::chrono::seconds(3600), &restarts);
  EXPECT_EQ(restarts, 1U);
  EXPECT_LT(errors[2050], -3000.0) << "for a second it could be a stall";
  EXPECT_NEAR(errors[2150], 0.0, 1e-3);
}

TEST(ClockModel, AHostClockThatIsSetBackIsApproached) {
  std::uint64_t restarts = 0;
  const std::vector<double> errors = errorsAround(std::chrono::milliseconds(-1500), &restarts);
  EXPECT_EQ(restarts, 1U);
  EXPECT_NEAR(errors[2000], 1.49, 0.02) << "no stamp goes back";
  EXPECT_NEAR(errors[5999], 0.0, 1e-3);
}

TEST(ClockModel, ADriftThatChangesIsFollowed) {
  ClockModel model;
  double host = 0.0;
  double largest = 0.0;
  for (int i = 1; i < 60000; ++i) {
    host += i < 30000 ? 0.01 * (1.0 + 20e-6) : 0.01 * (1.0 - 60e-6);
    const Time arrival = kStart + fromSeconds(host + (i % 7) * 1e-4);
    const Time stamp =
        model.update(fromSeconds(0.01 * i), arrival, {Time::max(), arrival - fromSeconds(0.002)});
    if (i > 40000) largest = std::max(largest, std::abs(toSeconds(stamp - kStart) - host));
  }
  EXPECT_NEAR(model.driftPpm(), 60.0, 2.0);
  EXPECT_LT(largest, 0.5e-3);
}

TEST(ClockModel, DeviceTimeThatDoesNotIncreaseChangesNothing) {
  ClockModel model;
  const Time first = model.update(fromSeconds(1.0), kStart);
  EXPECT_EQ(model.update(fromSeconds(1.0), kStart + fromSeconds(5.0)), first);
  EXPECT_EQ(model.update(fromSeconds(0.5), kStart + fromSeconds(5.0)), first);
  EXPECT_GT(model.update(fromSeconds(1.01), kStart + fromSeconds(0.01)), first);
}

TEST(ClockModel, StampsIncreaseAcrossARestart) {
  ClockModel model;
  Time last = Time::min();
  for (int run = 0; run < 5; ++run) {
    // Device times and arrivals start anew, the latter even earlier than before.
    for (int i = 0; i < 50; ++i) {
      const Time stamp =
          model.update(fromSeconds(0.01 * i), kStart + fromSeconds(0.01 * i - 0.1 * run));
      EXPECT_GT(stamp, last);
      last = stamp;
    }
    model.restart();
  }
}

TEST(ClockModel, RefusesOptionsThatCannotBe) {
  ClockModel::Options options;
  options.window_s = 0.0;
  EXPECT_THROW(ClockModel{options}, ConfigurationError);
  options = {};
  options.max_drift_ppm = -1.0;
  EXPECT_THROW(ClockModel{options}, ConfigurationError);
}

}  // namespace
}  // namespace scanner
