// Soak of the MTi driver against the emulated device on a pseudo-terminal:
//
//     mti_soak --seconds 600 --rate 100 [--corrupt 0.01] [--burst-ms 16] [--port PATH]
//
// Compares every sample with what the device measured at its number and every stamp with the true
// time. With --port a real device is driven instead, and only what needs no truth is printed. Exit
// 1 when a sample is lost on a clean line, or a wrong one is given away, or a stamp does not
// increase.

#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <exception>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "mti/mti_truth.h"

namespace {

using namespace scanner;  // NOLINT(google-build-using-namespace): a program of one file

struct Arguments {
  double seconds = 60.0;
  double rate_hz = 100.0;
  double corrupt = 0.0;
  double burst_s = 0.0;
  int baud_rate = 460800;
  std::string port;
};

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i];
    const std::string value = argv[i + 1];
    if (name == "--seconds") {
      arguments.seconds = std::stod(value);
    } else if (name == "--rate") {
      arguments.rate_hz = std::stod(value);
    } else if (name == "--corrupt") {
      arguments.corrupt = std::stod(value);
    } else if (name == "--burst-ms") {
      arguments.burst_s = 1e-3 * std::stod(value);
    } else if (name == "--baud") {
      arguments.baud_rate = std::stoi(value);
    } else if (name == "--port") {
      arguments.port = value;
    } else {
      throw ConfigurationError("unknown argument " + name);
    }
  }
  return arguments;
}

double cpuSeconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

Time hostNow() { return Time(std::chrono::system_clock::now().time_since_epoch()); }

struct Recording {
  std::vector<mti::Sample> samples;
  mti::DriverStatistics statistics;
  Time zero;
  double cpu_share = 0.0;
};

Recording record(const Arguments& arguments) {
  std::unique_ptr<simulation::EmulatedMti> device;
  mti::DriverOptions options;
  options.rate_hz = arguments.rate_hz;
  options.baud_rate = arguments.baud_rate;
  options.port = arguments.port;
  if (arguments.port.empty()) {
    simulation::EmulatedMti::Options emulated;
    emulated.burst_s = arguments.burst_s;
    device = std::make_unique<simulation::EmulatedMti>(emulated, test::truthTrack());
    options.port = device->path();
  }
  Recording recording;
  recording.zero = hostNow();
  if (device) device->start();
  std::mutex mutex;
  mti::Driver driver(options, [&](const mti::Sample& sample) {
    const std::lock_guard<std::mutex> lock(mutex);
    recording.samples.push_back(sample);
  });
  // The damage begins when the device measures: it is about the stream.
  for (int i = 0; i < 100 && driver.statistics().state != mti::DriverState::kMeasuring; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  simulation::MtiFaults faults;
  faults.corrupt_bytes = arguments.corrupt;
  if (device) device->setFaults(faults);
  const double cpu = cpuSeconds();
  std::this_thread::sleep_for(std::chrono::duration<double>(arguments.seconds));
  recording.cpu_share = (cpuSeconds() - cpu) / arguments.seconds;
  recording.statistics = driver.statistics();
  const std::lock_guard<std::mutex> lock(mutex);
  return recording;
}

struct Verdict {
  std::size_t wrong = 0;    ///< different from the device's value by more than rounding
  std::size_t far_off = 0;  ///< by more than what could be noise
  double largest = 0.0;     ///< difference
  std::size_t not_increasing = 0;
  double mean_s = 0.0, rms_s = 0.0, largest_s = 0.0;
};

Verdict judge(const Recording& recording, double rate_hz) {
  Verdict verdict;
  const test::TruthLine line(recording.samples, 1.0 / rate_hz);
  Time last = Time::min();
  double sum = 0.0;
  double squares = 0.0;
  for (const mti::Sample& sample : recording.samples) {
    const double time_s = line.at(sample);
    const double off = test::differenceFromTruth(sample, time_s);
    if (!(off < test::kTruthTolerance)) ++verdict.wrong;
    if (!(off < 0.05)) ++verdict.far_off;
    verdict.largest = std::max(verdict.largest, off);
    if (sample.stamp <= last) ++verdict.not_increasing;
    last = sample.stamp;
    const double error = toSeconds(sample.stamp - recording.zero) - time_s;
    sum += error;
    squares += error * error;
    verdict.largest_s = std::max(verdict.largest_s, std::abs(error));
  }
  const auto count = static_cast<double>(recording.samples.size());
  verdict.mean_s = sum / count;
  verdict.rms_s = std::sqrt(squares / count);
  return verdict;
}

int run(const Arguments& arguments) {
  const Recording recording = record(arguments);
  const mti::DriverStatistics& statistics = recording.statistics;
  std::printf("state            %s %s\n", toString(statistics.state), statistics.problem.c_str());
  std::printf("line             %d baud, %s\n", statistics.baud_rate, statistics.notes.c_str());
  std::printf("samples          %zu at %.2f Hz\n", recording.samples.size(), statistics.rate_hz);
  std::printf("lost             %llu\n", static_cast<unsigned long long>(statistics.lost));
  std::printf("rejected         %llu (checksum errors %llu)\n",
              static_cast<unsigned long long>(statistics.rejected),
              static_cast<unsigned long long>(statistics.checksum_errors));
  std::printf("connections      %llu\n", static_cast<unsigned long long>(statistics.connections));
  std::printf("drift            %.2f ppm\n", statistics.drift_ppm);
  std::printf("CPU share        %.2f %%%s\n", 100.0 * recording.cpu_share,
              arguments.port.empty() ? ", emulator included" : "");
  if (recording.samples.empty()) return 1;
  bool good = statistics.connections == 1 && (arguments.corrupt > 0.0 || statistics.lost == 0);
  if (arguments.port.empty()) {
    const Verdict verdict = judge(recording, arguments.rate_hz);
    std::printf("wrong            %zu, of them by more than 0.05: %zu, largest %.3g\n",
                verdict.wrong, verdict.far_off, verdict.largest);
    std::printf("not increasing   %zu\n", verdict.not_increasing);
    std::printf(
        "stamp error      RMS %.3f ms, without the mean %.3f ms, mean %.3f ms, max %.3f ms\n",
        1e3 * verdict.rms_s,
        1e3 * std::sqrt(
                  std::max(0.0, verdict.rms_s * verdict.rms_s - verdict.mean_s * verdict.mean_s)),
        1e3 * verdict.mean_s, 1e3 * verdict.largest_s);
    good = good && verdict.wrong == 0 && verdict.not_increasing == 0;
  }
  std::printf("%s\n", good ? "good" : "BROKEN");
  return good ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(parse(argc, argv));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "mti_soak: %s\n", error.what());
    return 2;
  }
}
