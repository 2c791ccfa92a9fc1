// Stamps of the MTi driver beside stamps on arrival, where an adapter delivers in bursts:
//
//     mti_stamps --seconds 120 --burst-ms 16 --clock-ppm 30 [--baud 460800] [--rate 100]
//
// The device is emulated on a pseudo-terminal, so that the true time of each sample is known. Exit
// 1 when the stamps scatter by 0.2 ms (RMS, without the mean) or more, or one does not increase.

#include <chrono>
#include <cstdio>
#include <exception>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "mti/mti_truth.h"

namespace {

using namespace scanner;  // NOLINT(google-build-using-namespace): a program of one file

constexpr double kPromisedJitterS = 0.2e-3;

struct Arguments {
  double seconds = 60.0;
  double burst_s = 0.016;
  double clock_ppm = 30.0;
  double rate_hz = 100.0;
  int baud_rate = 460800;
};

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i];
    const double value = std::stod(argv[i + 1]);
    if (name == "--seconds") {
      arguments.seconds = value;
    } else if (name == "--burst-ms") {
      arguments.burst_s = 1e-3 * value;
    } else if (name == "--clock-ppm") {
      arguments.clock_ppm = value;
    } else if (name == "--rate") {
      arguments.rate_hz = value;
    } else if (name == "--baud") {
      arguments.baud_rate = static_cast<int>(value);
    } else {
      throw ConfigurationError("unknown argument " + name);
    }
  }
  return arguments;
}

Time hostNow() { return Time(std::chrono::system_clock::now().time_since_epoch()); }

struct Row {
  double mean_s = 0.0, rms_s = 0.0, jitter_s = 0.0, percentile_95_s = 0.0, largest_s = 0.0;
  std::size_t duplicates = 0, backward = 0;
};

Row rate(const std::vector<mti::Sample>& samples, const test::TruthLine& line, Time zero,
         const std::function<Time(const mti::Sample&)>& stamp) {
  Row row;
  std::vector<double> errors;
  double squares = 0.0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double error = toSeconds(stamp(samples[i]) - zero) - line.at(samples[i]);
    row.mean_s += error / static_cast<double>(samples.size());
    squares += error * error;
    errors.push_back(std::abs(error));
    if (i == 0) continue;
    const Duration step = stamp(samples[i]) - stamp(samples[i - 1]);
    if (step == Duration(0)) ++row.duplicates;
    if (step < Duration(0)) ++row.backward;
  }
  std::sort(errors.begin(), errors.end());
  row.rms_s = std::sqrt(squares / static_cast<double>(errors.size()));
  row.jitter_s = std::sqrt(std::max(0.0, row.rms_s * row.rms_s - row.mean_s * row.mean_s));
  row.percentile_95_s = errors[errors.size() * 95 / 100];
  row.largest_s = errors.back();
  return row;
}

void print(const char* name, const Row& row) {
  std::printf("| %-10s | %8.3f | %8.3f | %8.3f | %8.3f | %8.3f | %5zu | %5zu |\n", name,
              1e3 * row.rms_s, 1e3 * row.mean_s, 1e3 * row.jitter_s, 1e3 * row.percentile_95_s,
              1e3 * row.largest_s, row.duplicates, row.backward);
}

int run(const Arguments& arguments) {
  simulation::EmulatedMti::Options emulated;
  emulated.burst_s = arguments.burst_s;
  emulated.clock_ppm = arguments.clock_ppm;
  simulation::EmulatedMti device(emulated, test::truthTrack());
  mti::DriverOptions options;
  options.port = device.path();
  options.baud_rate = arguments.baud_rate;
  options.rate_hz = arguments.rate_hz;
  std::vector<mti::Sample> samples;
  std::mutex mutex;
  const Time zero = hostNow();
  device.start();
  mti::DriverStatistics statistics;
  {
    mti::Driver driver(options, [&](const mti::Sample& sample) {
      const std::lock_guard<std::mutex> lock(mutex);
      samples.push_back(sample);
    });
    std::this_thread::sleep_for(std::chrono::duration<double>(arguments.seconds));
    statistics = driver.statistics();
  }
  if (samples.size() < 2) {
    std::printf("no samples: %s\n", statistics.problem.c_str());
    return 1;
  }
  const test::TruthLine line(samples,
                             1.0 / (arguments.rate_hz * (1.0 + 1e-6 * arguments.clock_ppm)));
  std::printf("%zu samples in bursts of %.1f ms at %d baud, device clock %+.1f ppm (found %+.2f)\n",
              samples.size(), 1e3 * arguments.burst_s, statistics.baud_rate, arguments.clock_ppm,
              statistics.drift_ppm);
  std::printf("errors in ms against the true time of sampling; jitter: RMS without the mean\n");
  std::printf(
      "| stamps     |      RMS |     mean |   jitter |     95 %% |      max | equal |  back |\n");
  std::printf(
      "|------------|----------|----------|----------|----------|----------|-------|-------|\n");
  const Row arrival = rate(samples, line, zero, [](const mti::Sample& s) { return s.arrival; });
  const Row ours = rate(samples, line, zero, [](const mti::Sample& s) { return s.stamp; });
  print("on arrival", arrival);
  print("ours", ours);
  const bool good = ours.jitter_s < kPromisedJitterS && ours.duplicates + ours.backward == 0;
  std::printf("%s\n", good ? "good" : "BROKEN");
  return good ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(parse(argc, argv));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "mti_stamps: %s\n", error.what());
    return 2;
  }
}
