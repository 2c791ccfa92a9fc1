#include "mti/measurement.h"

#include <algorithm>
#include <cmath>

#include "scanner/mti/mt_data2.h"

namespace scanner::mti {
namespace {

constexpr double kComputingS = 1.97e-3;  ///< from sampling to the first bit on the line (MT0100P)
constexpr double kSettlingS = 0.2;       ///< of the clock model
constexpr double kRateWindowS = 2.0;
/// A counter that runs this far ahead of the time that passed has started anew.
constexpr double kCounterLead = 64.0;
const double kHalfSqrt2 = std::sqrt(0.5);

/// A legacy earth frame has its x axis to the (magnetic) north, ENU its y axis.
Eigen::Quaterniond toEnu(const Eigen::Quaterniond& R_nwu_sensor) {
  const Eigen::Quaterniond R_enu_nwu(kHalfSqrt2, 0.0, 0.0, kHalfSqrt2);
  return (R_enu_nwu * R_nwu_sensor).normalized();
}

}  // namespace

void Measurement::begin(const Output& output) {
  output_ = output;
  filter_.restart();
  sent_.clear();
  last_arrival_.reset();
  window_begin_.reset();
  epoch_began_ = false;
}

void Measurement::expectJump() { filter_.restart(); }

std::optional<Reading> Measurement::decode(const Incoming& incoming) {
  const Message& message = incoming.message;
  if (!message.is(output_.mt_data2 ? MessageId::kMtData2 : MessageId::kMtData)) return std::nullopt;
  Reading reading;
  reading.arrival = incoming.arrival;
  if (output_.mt_data2) {
    const Result<MtData2> data = decodeMtData2(message);
    if (data) {
      reading.data = toMtData(*data);
      reading.rotation_defect = data->rotationDefect();
      return reading;
    }
  } else if (Result<MtData> data = decodeMtData(message, output_.mode, output_.settings)) {
    reading.data = *std::move(data);
    reading.rotation_defect = rotationDefect(message, output_.mode, output_.settings);
    return reading;
  }
  ++undecodable_;
  return std::nullopt;
}

void Measurement::push(const Incoming& incoming) {
  std::optional<Reading> reading = decode(incoming);
  if (reading) {
    sent_.push_back(
        {incoming.arrival, reading->data.counter, incoming.length_s, incoming.first_bit});
  }
  filter_.push(incoming.message, std::move(reading), incoming.statistics);
}

void Measurement::flush() { filter_.flush(); }

std::optional<Measurement::Sent> Measurement::takeSent(const Reading& reading) {
  while (!sent_.empty()) {
    const Sent sent = sent_.front();
    sent_.pop_front();
    if (sent.arrival == reading.arrival && sent.counter == reading.data.counter) return sent;
  }
  return std::nullopt;
}

std::optional<Sample> Measurement::next() {
  while (const std::optional<Reading> reading = filter_.next()) {
    const std::optional<Sent> sent = takeSent(*reading);
    if (!sent) continue;
    if (std::optional<Sample> ready = sample(*reading, *sent)) return ready;
  }
  return std::nullopt;
}

void Measurement::beginEpoch() {
  clock_.restart();
  ++number_;
  epoch_number_ = number_;
  epoch_began_ = true;
}

/// Follows the counter; false for a sample that came before.
bool Measurement::count(const Reading& reading) {
  const std::optional<std::uint16_t> counter = reading.data.counter;
  const std::uint16_t before = counter_;
  if (counter) counter_ = *counter;
  if (!epoch_began_) {
    beginEpoch();
    return true;
  }
  if (!counter) {
    ++number_;
    return true;
  }
  const unsigned step = static_cast<std::uint16_t>(*counter - before);
  if (step == 0) {
    ++duplicates_;
    return false;
  }
  const double passed = last_arrival_ ? toSeconds(reading.arrival - *last_arrival_) : 0.0;
  if (step > kCounterLead + 2.0 * passed * output_.rate_hz) {
    beginEpoch();
    return true;
  }
  number_ += step;
  statistics_.lost += step - 1;
  return true;
}

Time Measurement::stamp(const Sent& sent) {
  const Duration computing = fromSeconds(kComputingS + extra_latency_s_);
  const Time arrival = sent.arrival - fromSeconds(sent.length_s) - computing;
  if (!output_.counter) return std::max(arrival, last_stamp_ + Duration(1));
  const double device_s = static_cast<double>(number_ - epoch_number_) / output_.rate_hz;
  ClockModel::Evidence evidence = sent.first_bit;
  if (evidence.latest != Time::max()) evidence.latest -= computing;
  if (evidence.earliest != Time::min()) evidence.earliest -= computing;
  return clock_.update(fromSeconds(device_s), arrival, evidence);
}

std::optional<Sample> Measurement::sample(const Reading& reading, const Sent& sent) {
  if (!count(reading)) return std::nullopt;
  last_arrival_ = reading.arrival;
  measureRate(reading.arrival);
  last_stamp_ = stamp(sent);
  if (output_.counter &&
      static_cast<double>(number_ - epoch_number_) < kSettlingS * output_.rate_hz) {
    return std::nullopt;
  }
  const MtData& data = reading.data;
  Sample sample;
  sample.stamp = last_stamp_;
  sample.arrival = reading.arrival;
  sample.number = number_;
  sample.angular_velocity = data.angular_velocity;
  sample.acceleration = data.acceleration;
  sample.magnetic_field = data.magnetic_field;
  sample.temperature_c = data.temperature_c;
  if (data.orientation) {
    // toMtData() has brought MTData2 to north-west-up.
    const bool ned = !output_.mt_data2 && (output_.settings & output_settings::kNorthEastDown) != 0;
    const Eigen::Quaterniond R_nwu_ned(0.0, 1.0, 0.0, 0.0);
    sample.orientation = toEnu(ned ? R_nwu_ned * *data.orientation : *data.orientation);
  }
  ++statistics_.samples;
  return sample;
}

void Measurement::measureRate(Time arrival) {
  if (!window_begin_) {
    window_begin_ = arrival;
    window_samples_ = 0;
    return;
  }
  ++window_samples_;
  const double passed = toSeconds(arrival - *window_begin_);
  if (passed < kRateWindowS) return;
  statistics_.rate_hz = static_cast<double>(window_samples_) / passed;
  window_begin_ = arrival;
  window_samples_ = 0;
}

Measurement::Statistics Measurement::statistics() const {
  Statistics all = statistics_;
  all.rejected = filter_.statistics().rejected() + undecodable_ + duplicates_;
  all.drift_ppm = clock_.driftPpm();
  all.arrival_jitter_s = clock_.arrivalJitter();
  return all;
}

}  // namespace scanner::mti
