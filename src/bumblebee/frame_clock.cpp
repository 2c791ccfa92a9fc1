#include "bumblebee/frame_clock.h"

#include <algorithm>
#include <cmath>

namespace scanner::bumblebee {
namespace {

constexpr Duration kSmallestStep = std::chrono::microseconds(1);

/// The period that a camera is set to is not kept as a crystal keeps its frequency.
ClockModel::Options counterOptions() {
  ClockModel::Options options;
  options.max_drift_ppm = 20000.0;
  return options;
}

}  // namespace

const char* toString(StampSource source) {
  switch (source) {
    case StampSource::kDeviceClock:
      return "device clock";
    case StampSource::kCounter:
      return "frame counter";
    case StampSource::kArrival:
      return "arrival";
  }
  return "unknown";
}

double assumedLatency(const CameraIdentity& camera, const FrameFormat& format,
                      const TransportOptions& bus) {
  constexpr double kGigabitBps = 125e6;
  constexpr double kUsb2Bps = 40e6;
  constexpr double kCycle_s = 125e-6;
  const double bytes = 2.0 * format.width_px * format.height_px;
  switch (camera.transport) {
    case Transport::kAravis:
      return camera.vendor == "Aravis" ? 0.0 : bytes / kGigabitBps;
    case Transport::kUsb:
      return bytes / kUsb2Bps;
    case Transport::kDc1394:
      return std::ceil(bytes / (10.24 * std::max(bus.iso_speed_mbps, 100))) * kCycle_s;
    case Transport::kFile:
      break;
  }
  return 0.0;
}

FrameClock::FrameClock() : counter_(counterOptions()) {}

void FrameClock::restart(double latency_s) {
  device_.restart();
  counter_.restart();
  latency_s_ = latency_s;
  counted_ = Duration(0);
  frames_ = 0;
}

double FrameClock::shortestExposure(double exposure_s) {
  if (frames_ == 0) exposures_.fill(exposure_s);
  exposures_[frames_++ % kUnsettledFrames] = exposure_s;
  return *std::min_element(exposures_.begin(), exposures_.end());
}

Time FrameClock::stamp(const RawFrame& frame, const Input& input) {
  const double shortest_s = shortestExposure(input.exposure_s);
  double to_middle_s = -0.5 * input.exposure_s - latency_s_;
  Time end = frame.arrival;
  if (frame.device_time) {
    source_ = StampSource::kDeviceClock;
    Duration device_time = *frame.device_time;
    if (frame.moment == StampMoment::kStartOfExposure) {
      device_time += fromSeconds(shortest_s);
      to_middle_s = 0.5 * input.exposure_s - shortest_s - latency_s_;
    }
    end = device_.update(device_time, frame.arrival);
  } else if (input.counted) {
    source_ = StampSource::kCounter;
    counted_ += fromSeconds(static_cast<double>(input.advance) * input.period_s);
    end = counter_.update(counted_, frame.arrival);
  } else {
    source_ = StampSource::kArrival;
  }
  last_ = std::max(end + fromSeconds(to_middle_s), last_ + kSmallestStep);
  return last_;
}

const ClockModel& FrameClock::model() const {
  return source_ == StampSource::kDeviceClock ? device_ : counter_;
}

double FrameClock::driftPpm() const {
  return source_ == StampSource::kArrival ? 0.0 : model().driftPpm();
}

double FrameClock::arrivalJitter() const {
  return source_ == StampSource::kArrival ? 0.0 : model().arrivalJitter();
}

}  // namespace scanner::bumblebee
