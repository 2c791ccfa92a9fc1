/// The Aravis transport beside an emulated camera in a process of its own, for as long as wanted:
///
///     aravis_stream --seconds 300 --rate 15 --lost-packets 0.01
///
/// Every whole frame is compared byte by byte with what the camera took. Exit code 1 when a frame
/// is lost although no packet is, when a loss is not counted (whole + incomplete + gaps of the
/// counter differ from the frames that the camera took), when a whole frame is wrong, or when
/// stamps are not strictly increasing.
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "bumblebee/transports.h"
#include "scanner/simulation/emulated_bumblebee.h"
#include "support/camera_port_lock.h"

namespace {

using namespace scanner;  // NOLINT(google-build-using-namespace)
using Steady = std::chrono::steady_clock;

struct Options {
  double seconds = 60.0;
  double rate_hz = 15.0;
  double lost_packets = 0.0;
  int width_px = 1024;
  int height_px = 768;
};

Options parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    const double value = i + 1 < argc ? std::atof(argv[++i]) : -1.0;
    if (value < 0.0) throw std::runtime_error("option " + name + " needs a value");
    if (name == "--seconds") {
      options.seconds = value;
    } else if (name == "--rate") {
      options.rate_hz = value;
    } else if (name == "--lost-packets") {
      options.lost_packets = value;
    } else if (name == "--width") {
      options.width_px = static_cast<int>(value);
    } else if (name == "--height") {
      options.height_px = static_cast<int>(value);
    } else {
      throw std::runtime_error("unknown option " + name +
                               " (--seconds --rate --lost-packets --width --height)");
    }
  }
  return options;
}

/// Both eyes different and without symmetry; the first eight pixels carry the frame's number.
cv::Mat picture(const Options& options, int eye) {
  cv::Mat image(options.height_px, options.width_px, CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(7 * x + 13 * y + 101 * eye);
    }
  }
  return image;
}

void writeNumber(cv::Mat& image, std::uint64_t number) {
  std::memcpy(image.ptr<std::uint8_t>(0), &number, sizeof(number));
}

/// The camera's process: ready, then the number of frames taken when asked, then the end.
int serve(const Options& options, int from_client, int to_client) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  cv::Mat left = picture(options, 0);
  cv::Mat right = picture(options, 1);
  simulation::EmulatedBumblebee::Options camera_options;
  camera_options.width_px = options.width_px;
  camera_options.height_px = options.height_px;
  camera_options.rate_hz = options.rate_hz;
  camera_options.lost_packets = options.lost_packets;
  simulation::EmulatedBumblebee camera(
      camera_options, [&](std::uint64_t number, const simulation::Exposure&) {
        writeNumber(left, number);
        writeNumber(right, number);
        return StereoFrame{{}, {left, PixelFormat::kMono8}, {right, PixelFormat::kMono8}};
      });
  std::uint64_t taken = 0;
  for (char command = 0;;) {
    if (::write(to_client, &taken, sizeof(taken)) != sizeof(taken)) return 1;
    if (::read(from_client, &command, 1) != 1) return 0;
    taken = camera.framesTaken();
  }
}

class CameraProcess {
 public:
  explicit CameraProcess(const Options& options) {
    if (::pipe(down_.data()) != 0 || ::pipe(up_.data()) != 0) throw std::runtime_error("pipe");
    process_ = ::fork();  // before this process has any thread
    if (process_ < 0) throw std::runtime_error("fork");
    if (process_ == 0) {
      ::close(down_[1]);
      ::close(up_[0]);
      int code = 1;
      try {
        code = serve(options, down_[0], up_[1]);
      } catch (const std::exception& e) {
        std::cerr << e.what() << '\n';
      }
      std::_Exit(code);
    }
    ::close(down_[0]);
    ::close(up_[1]);
    receive();
  }
  ~CameraProcess() {
    ::close(down_[1]);
    ::close(up_[0]);
    ::waitpid(process_, nullptr, 0);
  }
  CameraProcess(const CameraProcess&) = delete;
  CameraProcess& operator=(const CameraProcess&) = delete;

  std::uint64_t framesTaken() {
    const char command = '?';
    if (::write(down_[1], &command, 1) != 1) throw std::runtime_error("camera process is gone");
    return receive();
  }

 private:
  std::uint64_t receive() {
    std::uint64_t number = 0;
    if (::read(up_[0], &number, sizeof(number)) != sizeof(number)) {
      throw std::runtime_error("camera process did not start");
    }
    return number;
  }

  std::array<int, 2> down_{}, up_{};
  pid_t process_ = -1;
};

double cpuSeconds(clockid_t clock) {
  timespec time{};
  ::clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct Tally {
  std::uint64_t whole = 0, incomplete = 0, gaps = 0, wrong = 0, backward = 0, unnumbered = 0;
  std::uint64_t next = 0;  ///< number that is expected
  std::optional<std::uint64_t> last_counter;
  std::optional<Duration> first_stamp, last_stamp;
  std::uint64_t stamps = 0;
  std::vector<double> latency_s;
};

/// Number of the frame since power-on. The emulated camera counts from 65401.
std::uint64_t unwrap(const bumblebee::RawFrame& frame, Tally& tally) {
  const std::uint64_t period = frame.counter_max - frame.counter_first + 1;
  const std::uint64_t before = tally.last_counter ? *tally.last_counter : std::uint64_t{65401} - 1;
  const std::uint64_t step = (*frame.counter + period - before) % period;
  tally.last_counter = frame.counter;
  return tally.next + step - 1;
}

void add(const bumblebee::RawFrame& frame, const std::vector<std::uint8_t>& expected,
         std::uint64_t end, Tally& tally) {
  if (!frame.counter) {
    ++tally.unnumbered;
    return;
  }
  const std::uint64_t number = unwrap(frame, tally);
  tally.gaps += std::min(number, end) - std::min(tally.next, end);
  tally.next = number + 1;
  if (number >= end) return;  // after the count
  ++(frame.status ? tally.whole : tally.incomplete);
  if (frame.device_time) {
    if (tally.last_stamp && *frame.device_time <= *tally.last_stamp) ++tally.backward;
    if (!tally.first_stamp) tally.first_stamp = frame.device_time;
    tally.last_stamp = frame.device_time;
    ++tally.stamps;
    tally.latency_s.push_back(toSeconds(frame.arrival.time_since_epoch() - *frame.device_time));
  }
  if (!frame.status) return;
  std::vector<std::uint8_t> head(16);
  for (std::size_t i = 0; i < 16; ++i) {
    head[i] = static_cast<std::uint8_t>(number >> (8 * (i / 2)));
  }
  const std::vector<std::uint8_t>& bytes = *frame.bytes;
  const bool right = bytes.size() == expected.size() &&
                     std::equal(head.begin(), head.end(), bytes.begin()) &&
                     std::memcmp(bytes.data() + 16, expected.data() + 16, bytes.size() - 16) == 0;
  if (!right) ++tally.wrong;
}

std::vector<std::uint8_t> interleaved(const Options& options) {
  const cv::Mat both = simulation::interleave(picture(options, 0), picture(options, 1));
  return {both.datastart, both.dataend};
}

struct Outcome {
  Tally tally;
  std::uint64_t taken = 0;
  double cpu_share = 0.0, seconds = 0.0;
  bumblebee::TransportStatistics statistics;
};

Outcome stream(const Options& options, CameraProcess& process) {
  auto opened = bumblebee::openAravis("127.0.0.1", {});
  if (!opened) throw std::runtime_error(opened.status().message());
  bumblebee::StereoCamera& camera = **opened;
  bumblebee::Controls controls;
  controls.rate_hz = options.rate_hz;
  if (const auto format = camera.configure(0, 0, controls); !format) {
    throw std::runtime_error(format.status().message());
  }
  if (const Status status = camera.start(); !status) throw std::runtime_error(status.message());
  const std::vector<std::uint8_t> expected = interleaved(options);
  Outcome outcome;
  std::uint64_t end = ~std::uint64_t{0};
  double checking_s = 0.0;
  const double cpu_before = cpuSeconds(CLOCK_PROCESS_CPUTIME_ID);
  const Steady::time_point begin = Steady::now();
  const auto elapsed = [begin] {
    return std::chrono::duration<double>(Steady::now() - begin).count();
  };
  while (outcome.tally.next < end) {
    if (end == ~std::uint64_t{0} && elapsed() >= options.seconds) {
      outcome.seconds = elapsed();
      const double cpu = cpuSeconds(CLOCK_PROCESS_CPUTIME_ID) - cpu_before - checking_s;
      outcome.cpu_share = cpu / outcome.seconds;
      end = outcome.taken = process.framesTaken();
      continue;
    }
    const auto frame = camera.grab(std::chrono::seconds(2));
    if (!frame && frame.status().code() != StatusCode::kOutOfRange) {
      throw std::runtime_error(frame.status().message());
    }
    if (!frame) continue;
    const double before = cpuSeconds(CLOCK_THREAD_CPUTIME_ID);
    add(*frame, expected, end, outcome.tally);
    checking_s += cpuSeconds(CLOCK_THREAD_CPUTIME_ID) - before;
  }
  outcome.statistics = camera.statistics();
  return outcome;
}

int report(const Options& options, Outcome outcome) {
  Tally& tally = outcome.tally;
  std::sort(tally.latency_s.begin(), tally.latency_s.end());
  const auto quantile = [&tally](double q) {
    if (tally.latency_s.empty()) return 0.0;
    return 1e3 * tally.latency_s[static_cast<std::size_t>(
                     q * static_cast<double>(tally.latency_s.size() - 1))];
  };
  const double span_s = tally.first_stamp ? toSeconds(*tally.last_stamp - *tally.first_stamp) : 0.0;
  const double rate_hz = span_s > 0.0 ? static_cast<double>(tally.next - 1) / span_s : 0.0;
  const auto row = [](const char* name, const std::string& value) {
    std::printf("%-34s %s\n", name, value.c_str());
  };
  const auto number = [](double value, int digits) {
    char text[32];
    std::snprintf(text, sizeof(text), "%.*f", digits, value);
    return std::string(text);
  };
  row("seconds", number(outcome.seconds, 1));
  row("packets lost on purpose, %", number(100.0 * options.lost_packets, 2));
  row("frames the camera took", std::to_string(outcome.taken));
  row("whole frames", std::to_string(tally.whole));
  row("incomplete frames", std::to_string(tally.incomplete));
  row("gaps of the counter", std::to_string(tally.gaps));
  row("wrong frames", std::to_string(tally.wrong));
  row("backward or duplicate stamps", std::to_string(tally.backward));
  row("packets counted as lost", std::to_string(outcome.statistics.lost_packets));
  row("overruns", std::to_string(outcome.statistics.overruns));
  row("rate, Hz", number(rate_hz, 3));
  row("exposure start to arrival, ms", number(quantile(0.5), 2) +
                                           " (99 %: " + number(quantile(0.99), 2) + ", worst " +
                                           number(quantile(1.0), 2) + ")");
  row("CPU share of the client, %", number(100.0 * outcome.cpu_share, 2));
  bool good = true;
  const auto expect = [&good](bool met, const char* broken) {
    if (!met) std::printf("BROKEN: %s\n", broken);
    good = good && met;
  };
  expect(tally.whole + tally.incomplete + tally.gaps == outcome.taken,
         "whole + incomplete + gaps are not the frames that the camera took");
  expect(options.lost_packets > 0.0 || tally.whole == outcome.taken,
         "frames were lost although no packet was");
  expect(tally.backward == 0 && tally.unnumbered == 0, "stamps or numbers do not increase");
  expect(tally.wrong == 0, "a whole frame was not what the camera took");
  expect(tally.stamps >= tally.whole, "a frame has no stamp of the camera");
  return good ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const Options options = parse(argc, argv);
    const test::CameraPortLock lock;
    CameraProcess process(options);
    return report(options, stream(options, process));
  } catch (const std::exception& e) {
    std::cerr << "aravis_stream: " << e.what() << '\n';
    return 1;
  }
}
