#include "scanner/mti/driver.h"

#include <dirent.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <mutex>
#include <thread>

#include "mti/driver_options.h"
#include "mti/mti_truth.h"
#include "scanner/core/status.h"
#include "scanner/simulation/emulated_mti.h"
#include "support/temporary_folder.h"

namespace scanner::mti {
namespace {

using Clock = std::chrono::steady_clock;
using simulation::EmulatedMti;
using test::TruthLine;

constexpr double kPatienceS = 20.0;  ///< what a busy machine may take

bool eventually(const std::function<bool()>& condition, double patience_s = kPatienceS) {
  const Clock::time_point start = Clock::now();
  while (!condition()) {
    if (std::chrono::duration<double>(Clock::now() - start).count() > patience_s) return false;
    ::poll(nullptr, 0, 5);
  }
  return true;
}

/// What a driver gave.
class Collector {
 public:
  Driver::Callback callback() {
    return [this](const Sample& sample) {
      const std::lock_guard<std::mutex> lock(mutex_);
      samples_.push_back(sample);
    };
  }
  std::vector<Sample> samples() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return samples_;
  }
  std::size_t count() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return samples_.size();
  }
  bool await(std::size_t more) const {
    const std::size_t before = count();
    return eventually([&] { return count() >= before + more; });
  }

 private:
  mutable std::mutex mutex_;
  std::vector<Sample> samples_;
};

DriverOptions optionsFor(const EmulatedMti& device) {
  DriverOptions options;
  options.port = device.path();
  options.answer_timeout_s = 0.25;
  options.retry_min_s = 0.05;
  options.retry_max_s = 0.2;
  return options;
}

DriverOptions atFactoryRate(const EmulatedMti& device) {
  DriverOptions options = optionsFor(device);
  options.baud_rate = 115200;
  return options;
}

void expectInOrder(const std::vector<Sample>& samples) {
  for (std::size_t i = 1; i < samples.size(); ++i) {
    ASSERT_GT(samples[i].stamp, samples[i - 1].stamp) << i;
    ASSERT_GT(samples[i].number, samples[i - 1].number) << i;
  }
}

/// All are what the device measured at their number. `tolerance`: of the values.
void expectTrue(const std::vector<Sample>& samples, double rate_hz, double tolerance) {
  const TruthLine line(samples, 1.0 / rate_hz);
  for (const Sample& sample : samples) {
    ASSERT_TRUE(sample.acceleration && sample.angular_velocity && sample.orientation);
    EXPECT_LT(test::differenceFromTruth(sample, line.at(sample)), tolerance) << sample.number;
  }
}

class MtiDriver : public ::testing::Test {
 protected:
  /// A link of our own, so that the port has the same name when it is plugged in again.
  EmulatedMti::Options deviceOptions() const {
    EmulatedMti::Options options;
    options.link = folder_ / "mti";
    return options;
  }
  test::TemporaryFolder folder_;
  Collector collector_;
};

TEST_F(MtiDriver, ConfiguresMovesTheBaudRateAndStreams) {
  EmulatedMti device(deviceOptions(), test::truthTrack());
  device.start();
  Driver driver(optionsFor(device), collector_.callback());
  ASSERT_TRUE(collector_.await(150)) << driver.statistics().problem;
  const DriverStatistics statistics = driver.statistics();
  EXPECT_EQ(statistics.state, DriverState::kMeasuring);
  EXPECT_EQ(statistics.baud_rate, 460800);
  EXPECT_EQ(statistics.device_id, "00300123");
  EXPECT_EQ(statistics.firmware, "2.8.1");
  EXPECT_EQ(statistics.protocol, "MTData");
  EXPECT_EQ(statistics.problem, "");
  EXPECT_EQ(statistics.connections, 1U);
  EXPECT_EQ(statistics.lost, 0U);
  EXPECT_EQ(statistics.rejected, 0U);
  const std::vector<Sample> samples = collector_.samples();
  expectInOrder(samples);
  expectTrue(samples, 100.0, test::kTruthTolerance);
  EXPECT_EQ(samples.back().number - samples.front().number, samples.size() - 1);
  EXPECT_TRUE(samples.back().magnetic_field && samples.back().temperature_c);
}

TEST_F(MtiDriver, StampsAreTheTimesOfSampling) {
  EmulatedMti::Options options = deviceOptions();
  options.burst_s = 0.016;
  EmulatedMti device(options, test::truthTrack());
  device.start();
  const auto zero = Time(std::chrono::system_clock::now().time_since_epoch());
  Driver driver(optionsFor(device), collector_.callback());
  ASSERT_TRUE(collector_.await(300));
  const std::vector<Sample> samples = collector_.samples();
  expectInOrder(samples);
  const TruthLine line(samples, 0.01);
  double stamps = 0.0;
  double arrivals = 0.0;
  for (const Sample& sample : samples) {
    stamps += std::pow(toSeconds(sample.stamp - zero) - line.at(sample), 2);
    arrivals += std::pow(toSeconds(sample.arrival - zero) - line.at(sample), 2);
  }
  // The figures proper come from bench/mti_stamps; here a busy machine must not matter.
  EXPECT_LT(stamps, 0.25 * arrivals);
}

TEST_F(MtiDriver, EveryFormOfOrientationIsTheSameRotation) {
  EmulatedMti device(deviceOptions(), test::truthTrack());
  device.start();
  for (const OrientationFormat format :
       {OrientationFormat::kQuaternion, OrientationFormat::kMatrix, OrientationFormat::kEuler}) {
    DriverOptions options = atFactoryRate(device);
    options.orientation = format;
    options.magnetic_field = format == OrientationFormat::kMatrix;
    options.temperature = format == OrientationFormat::kMatrix;
    Collector collector;
    Driver driver(options, collector.callback());
    ASSERT_TRUE(collector.await(20)) << driver.statistics().problem;
    expectTrue(collector.samples(), 100.0, test::kTruthTolerance);
    EXPECT_EQ(collector.samples().back().magnetic_field.has_value(), options.magnetic_field);
  }
}

TEST_F(MtiDriver, TakesTheStreamAsItIs) {
  EmulatedMti device(deviceOptions(), test::truthTrack());
  device.start();
  DriverOptions options = optionsFor(device);
  options.configure = false;
  Driver driver(options, collector_.callback());
  ASSERT_TRUE(collector_.await(20)) << driver.statistics().problem;
  EXPECT_EQ(driver.statistics().baud_rate, 115200) << "the factory's";
  EXPECT_TRUE(collector_.samples().back().orientation);
  EXPECT_FALSE(collector_.samples().back().acceleration);
}

TEST_F(MtiDriver, TheLineLimitsTheRate) {
  EmulatedMti device(deviceOptions(), test::truthTrack());
  device.start();
  DriverOptions options = atFactoryRate(device);
  options.baud_rate = 38400;
  Driver driver(options, collector_.callback());
  ASSERT_TRUE(collector_.await(60)) << driver.statistics().problem;
  const DriverStatistics statistics = driver.statistics();
  EXPECT_EQ(statistics.baud_rate, 38400);
  EXPECT_NE(statistics.notes.find("limited"), std::string::npos) << statistics.notes;
  EXPECT_EQ(statistics.lost, 0U);
  EXPECT_EQ(device.statistics().messages_skipped, 0U);
}

TEST_F(MtiDriver, AllResets) {
  EmulatedMti device(deviceOptions(), test::truthTrack());
  device.start();
  DriverOptions options = atFactoryRate(device);
  options.start_reset = StartReset::kHeading;
  Driver driver(options, collector_.callback());
  ASSERT_TRUE(collector_.await(30)) << driver.statistics().problem;
  // The truth turns by 0.001 rad/s: little happens within this test.
  const auto angleFromEast = [this] {
    return Eigen::AngleAxisd(*collector_.samples().back().orientation).angle();
  };
  ASSERT_TRUE(eventually([&] { return angleFromEast() > 1.5; })) << "x to the north at the start";
  EXPECT_NEAR(angleFromEast(), std::acos(0.0), 0.05);
  for (const OrientationReset reset : {OrientationReset::kGlobal, OrientationReset::kHeading,
                                       OrientationReset::kObject, OrientationReset::kAlign}) {
    const Status status = driver.resetOrientation(reset);
    EXPECT_TRUE(status.isOk()) << status.message();
    EXPECT_TRUE(collector_.await(5));
  }
  const Status stored = driver.resetOrientation(OrientationReset::kStore);
  EXPECT_TRUE(stored.isOk()) << stored.message();
  ASSERT_TRUE(collector_.await(30)) << "measures on";
  EXPECT_EQ(driver.statistics().connections, 1U);
  device.unplug();
  ASSERT_TRUE(eventually([&] { return driver.statistics().state == DriverState::kSearching; }));
  EXPECT_EQ(driver.resetOrientation(OrientationReset::kHeading).code(), StatusCode::kOutOfRange);
  device.plug();
  ASSERT_TRUE(collector_.await(5));
  EXPECT_NEAR(angleFromEast(), std::acos(0.0), 0.2) << "the stored reset survived";
  expectInOrder(collector_.samples());
}

TEST_F(MtiDriver, ResetThatIsRefused) {
  EmulatedMti device(deviceOptions(), test::truthTrack());
  device.start();
  Status from_callback;
  Driver* self = nullptr;
  std::mutex mutex;
  Driver driver(atFactoryRate(device), [&](const Sample& sample) {
    collector_.callback()(sample);
    const std::lock_guard<std::mutex> lock(mutex);
    if (self && from_callback.isOk()) {
      from_callback = self->resetOrientation(OrientationReset::kHeading);
    }
  });
  ASSERT_TRUE(collector_.await(5)) << driver.statistics().problem;
  device.setFaults({0.0, 0.0, true, false});
  EXPECT_EQ(driver.resetOrientation(OrientationReset::kHeading).code(), StatusCode::kInvalidInput);
  device.setFaults({});
  {
    const std::lock_guard<std::mutex> lock(mutex);
    self = &driver;
  }
  ASSERT_TRUE(collector_.await(5));
  const std::lock_guard<std::mutex> lock(mutex);
  EXPECT_EQ(from_callback.code(), StatusCode::kInvalidInput) << "would wait for itself";
}

TEST_F(MtiDriver, GoesOnWhenItIsPluggedInAgain) {
  EmulatedMti device(deviceOptions(), test::truthTrack());
  device.start();
  Driver driver(optionsFor(device), collector_.callback());
  for (int i = 1; i <= 3; ++i) {
    ASSERT_TRUE(collector_.await(30)) << driver.statistics().problem;
    EXPECT_EQ(driver.statistics().connections, static_cast<unsigned>(i));
    device.unplug();
    ASSERT_TRUE(eventually([&] { return driver.statistics().state == DriverState::kSearching; }));
    EXPECT_NE(driver.statistics().problem, "");
    device.plug();
  }
  ASSERT_TRUE(collector_.await(30));
  expectInOrder(collector_.samples());
  EXPECT_EQ(driver.statistics().lost, 0U);
}

/// Measures, suffers, says what is wrong, measures again.
void suffer(const EmulatedMti::Options& device_options, const simulation::MtiFaults& faults,
            const std::string& expected_problem) {
  EmulatedMti device(device_options, test::truthTrack());
  device.start();
  Collector collector;
  DriverOptions options = atFactoryRate(device);
  options.silence_timeout_s = 0.2;
  Driver driver(options, collector.callback());
  ASSERT_TRUE(collector.await(5)) << driver.statistics().problem;
  device.setFaults(faults);
  // Errors are answers to questions only: as long as data come nobody asks.
  if (faults.answer_errors) {
    device.unplug();
    device.plug();
  }
  EXPECT_TRUE(eventually([&] {
    return driver.statistics().problem.find(expected_problem) != std::string::npos;
  })) << driver.statistics().problem;
  EXPECT_EQ(driver.statistics().state, DriverState::kSearching);
  device.setFaults({});
  ASSERT_TRUE(collector.await(20)) << driver.statistics().problem;
  EXPECT_EQ(driver.statistics().problem, "");
  EXPECT_EQ(driver.statistics().connections, 2U);
  expectInOrder(collector.samples());
}

TEST_F(MtiDriver, RecoversFromAMuteDevice) {
  suffer(deviceOptions(), {0.0, 0.0, false, true}, "no answer at any baud rate");
}
TEST_F(MtiDriver, RecoversFromADeviceThatAnswersErrors) {
  suffer(deviceOptions(), {0.0, 0.0, true, false}, "errors only");
}
TEST_F(MtiDriver, RecoversFromGarbage) {
  suffer(deviceOptions(), {1.0, 0.0, false, false}, "no MT message");
}

TEST_F(MtiDriver, DamageIsHeldBack) {
  EmulatedMti device(deviceOptions(), test::truthTrack());
  device.start();
  DriverOptions options = atFactoryRate(device);
  options.rate_hz = 100.0;
  Driver driver(options, collector_.callback());
  ASSERT_TRUE(collector_.await(50)) << driver.statistics().problem;
  device.setFaults({0.004, 0.0, false, false});
  ASSERT_TRUE(collector_.await(150)) << driver.statistics().problem;
  device.setFaults({0.0, 0.01, false, false});
  ASSERT_TRUE(collector_.await(60)) << driver.statistics().problem;
  device.setFaults({});
  ASSERT_TRUE(collector_.await(50));
  const DriverStatistics statistics = driver.statistics();
  EXPECT_EQ(statistics.connections, 1U);
  EXPECT_GT(statistics.checksum_errors, 0U);
  EXPECT_GT(statistics.skipped_bytes, 0U);
  const std::vector<Sample> samples = collector_.samples();
  expectInOrder(samples);
  // What the plausibility filter cannot tell from noise is below this, but for one sample in 10^5
  // (see plausibility.h, and its own test).
  expectTrue(samples, 100.0, 0.5);
  const std::uint64_t span = samples.back().number - samples.front().number + 1;
  EXPECT_NEAR(static_cast<double>(statistics.lost), static_cast<double>(span - samples.size()), 3.0)
      << "the loss is counted";
  EXPECT_GT(statistics.lost, 15U) << "every fourth message was hit";
  EXPECT_LT(statistics.lost, 1000U);
}

TEST_F(MtiDriver, APortInUseIsWaitedFor) {
  EmulatedMti device(deviceOptions(), test::truthTrack());
  device.start();
  auto first = std::make_unique<Driver>(atFactoryRate(device), collector_.callback());
  ASSERT_TRUE(collector_.await(5)) << first->statistics().problem;
  Collector second_collector;
  Driver second(atFactoryRate(device), second_collector.callback());
  ASSERT_TRUE(
      eventually([&] { return second.statistics().problem.find("in use") != std::string::npos; }));
  EXPECT_TRUE(collector_.await(20)) << "the first is not disturbed";
  EXPECT_EQ(first->statistics().connections, 1U);
  EXPECT_EQ(first->statistics().lost, 0U);
  first.reset();
  EXPECT_TRUE(second_collector.await(5)) << second.statistics().problem;
}

std::size_t entries(const char* folder) {
  std::size_t count = 0;
  DIR* directory = ::opendir(folder);
  while (::readdir(directory) != nullptr) ++count;
  ::closedir(directory);
  return count;
}

TEST_F(MtiDriver, StartAndStopLeakNothing) {
  EmulatedMti device(deviceOptions(), test::truthTrack());
  device.start();
  std::size_t descriptors = 0;
  std::size_t threads = 0;
  for (int i = 0; i < 6; ++i) {
    {
      Driver driver(atFactoryRate(device), collector_.callback());
      if (i % 2 == 0) {
        ASSERT_TRUE(collector_.await(3)) << driver.statistics().problem;
      }
    }
    if (i == 0) {
      descriptors = entries("/proc/self/fd");
      threads = entries("/proc/self/task");
    }
  }
  EXPECT_EQ(entries("/proc/self/fd"), descriptors);
  EXPECT_EQ(entries("/proc/self/task"), threads);
}

TEST_F(MtiDriver, StopsAtOnceWhateverItWaitsFor) {
  EmulatedMti device(deviceOptions(), test::truthTrack());
  device.setFaults({0.0, 0.0, false, true});
  DriverOptions options = optionsFor(device);
  options.answer_timeout_s = 10.0;
  options.retry_min_s = options.retry_max_s = 60.0;
  for (const std::string& port : {options.port, std::string("/nowhere/at/all")}) {
    options.port = port;
    const auto driver = std::make_unique<Driver>(options, collector_.callback());
    ASSERT_TRUE(eventually([&] {
      return port != device.path() ? !driver->statistics().problem.empty()
                                   : !driver->statistics().port.empty();
    }));
  }
  EXPECT_EQ(collector_.count(), 0U);
}

TEST_F(MtiDriver, ProbeLeavesTheDeviceMeasuring) {
  EmulatedMti device(deviceOptions(), test::truthTrack());
  device.start();
  {
    Driver driver(optionsFor(device), collector_.callback());
    ASSERT_TRUE(collector_.await(5)) << driver.statistics().problem;
  }
  const FoundDevice found = probe(device.path());
  EXPECT_EQ(found.problem, "");
  EXPECT_EQ(found.device_id, "00300123");
  EXPECT_EQ(found.firmware, "2.8.1");
  EXPECT_EQ(found.baud_rate, 460800);
  const std::uint64_t sent = device.statistics().messages_sent;
  Driver driver(
      [&] {
        DriverOptions options = optionsFor(device);
        options.configure = false;
        return options;
      }(),
      collector_.callback());
  EXPECT_TRUE(collector_.await(5));
  EXPECT_GT(device.statistics().messages_sent, sent);
  const FoundDevice busy = probe(device.path());
  EXPECT_NE(busy.problem.find("in use"), std::string::npos);
  EXPECT_FALSE(busy.device_id);
  const FoundDevice missing = probe("/nowhere/at/all");
  EXPECT_NE(missing.problem.find("no such port"), std::string::npos);
}

TEST(MtiDriverOptions, AreChecked) {
  const auto rejected = [](const std::function<void(DriverOptions&)>& spoil) {
    DriverOptions options;
    options.port = "/nowhere/at/all";
    spoil(options);
    EXPECT_THROW(Driver(options, [](const Sample&) {}), ConfigurationError);
  };
  rejected([](DriverOptions& o) { o.baud_rate = 100000; });
  rejected([](DriverOptions& o) { o.rate_hz = 0.0; });
  rejected([](DriverOptions& o) { o.rate_hz = std::nan(""); });
  rejected([](DriverOptions& o) { o.retry_min_s = 5.0; });
  rejected([](DriverOptions& o) { o.port = ""; });
  rejected([](DriverOptions& o) { o.answer_timeout_s = -1.0; });
  EXPECT_NO_THROW(validate(DriverOptions()));
}

}  // namespace
}  // namespace scanner::mti
