#include "simulation/mti_state.h"

#include <cmath>
#include <limits>

#include "scanner/core/se3.h"
#include "scanner/core/status.h"
#include "scanner/mti/bytes.h"

namespace scanner::simulation {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using mti::ByteReader;
using mti::ByteWriter;
using mti::ErrorCode;
using mti::Message;
using mti::MessageId;

constexpr double kWakeUpS = 0.5;
constexpr double kLatencyS = 1.97e-3;  ///< from sampling to the first bit on the line (MT0100P)
constexpr double kPeriodHz = 115200.0;
constexpr std::uint16_t kShortestPeriod = 225;  ///< 512 Hz
constexpr std::uint16_t kOnRequest = 0xFFFF;    ///< skip factor: data only when asked for
constexpr std::uint16_t kLastErrorMode = 3;
constexpr std::uint8_t kStatusGood = 0x03;  ///< self-test passed, filter valid
constexpr std::size_t kLongestRequest = 254;
constexpr double kPi = 3.14159265358979323846;

Quaterniond yaw(double angle) { return Quaterniond(Eigen::AngleAxisd(angle, Vector3d::UnitZ())); }

/// Direction of the x axis in the horizontal plane; 0 when it is vertical.
double headingOf(const Quaterniond& orientation) {
  const Vector3d x = orientation * Vector3d::UnitX();
  return x.head<2>().norm() > 1e-9 ? std::atan2(x.y(), x.x()) : 0.0;
}

double infinity() { return std::numeric_limits<double>::infinity(); }

}  // namespace

int mtiBaudRate(std::uint8_t identifier) {
  switch (identifier) {
    case 0x80:
      return 921600;
    case 0x00:
      return 460800;
    case 0x01:
      return 230400;
    case 0x02:
      return 115200;
    case 0x03:
      return 76800;
    case 0x04:
      return 57600;
    case 0x05:
      return 38400;
    case 0x06:
      return 28800;
    case 0x07:
      return 19200;
    case 0x08:
      return 14400;
    case 0x09:
      return 9600;
    default:
      return 0;
  }
}

MtiState::MtiState(std::uint32_t device_id, double clock_ppm, MtiTrack track)
    : device_id_(device_id),
      clock_ppm_(clock_ppm),
      track_(std::move(track)),
      zero_s_(infinity()),
      parser_(kLongestRequest) {}

void MtiState::powerOn(double now_s) {
  active_ = stored_;
  active_baud_rate_ = stored_.baud_rate;
  state_ = State::kWakeUp;
  wake_up_end_s_ = now_s + kWakeUpS;
  send(MessageId::kWakeUp, {}, now_s);
}

void MtiState::receive(const std::vector<std::uint8_t>& bytes, double now_s) {
  advance(now_s);
  parser_.push(bytes.data(), bytes.size());
  while (const std::optional<Message> message = parser_.next()) handle(*message, now_s);
}

void MtiState::advance(double now_s) {
  if (state_ == State::kWakeUp && now_s >= wake_up_end_s_) goToMeasurement(wake_up_end_s_);
  while (state_ == State::kMeasurement && sampleTime(next_sample_) <= now_s) {
    sendSample(next_sample_++);
  }
}

double MtiState::nextEvent() const {
  if (state_ == State::kWakeUp) return wake_up_end_s_;
  return state_ == State::kMeasurement ? sampleTime(next_sample_) : infinity();
}

std::vector<MtiState::Outgoing> MtiState::takeOutgoing() {
  std::vector<Outgoing> taken;
  taken.swap(outgoing_);
  return taken;
}

double MtiState::samplePeriod() const {
  return active_.period / kPeriodHz / (1.0 + 1e-6 * clock_ppm_);
}

double MtiState::sampleTime(std::uint64_t index) const {
  return measurement_start_s_ + static_cast<double>(index) * samplePeriod();
}

void MtiState::goToMeasurement(double now_s) {
  state_ = State::kMeasurement;
  measurement_start_s_ = now_s;
  next_sample_ = 1;  // a sample is the end of its interval
  counter_ = 0;
}

void MtiState::sendSample(std::uint64_t index) {
  if (active_.skip_factor == kOnRequest || index % (active_.skip_factor + 1U) != 0) return;
  const double time_s = sampleTime(index);
  const Message data = encodeMtData(measure(time_s), active_.mode, active_.settings);
  send(MessageId::kMtData, data.data, time_s + kLatencyS);
}

MtiReading MtiState::readingAt(double time_s) const {
  return std::isfinite(zero_s_) ? track_.at(time_s - zero_s_) : track_.waiting(time_s);
}

Quaterniond MtiState::sensorInEarth(double time_s) const {
  return yaw(-kPi / 2.0) * readingAt(time_s).orientation;
}

/// The data of one message; the counter counts messages (MT0100P 4.7).
mti::MtData MtiState::measure(double time_s) {
  const MtiReading reading = readingAt(time_s);
  Quaterniond orientation = active_.earth * sensorInEarth(time_s) * active_.object.conjugate();
  if ((active_.settings & mti::output_settings::kNorthEastDown) != 0) {
    orientation = Quaterniond(0.0, 1.0, 0.0, 0.0) * orientation;  // half a turn about north
  }
  mti::MtData data;
  data.temperature_c = reading.temperature_c;
  data.acceleration = active_.object * reading.linear_acceleration;
  data.angular_velocity = active_.object * reading.angular_velocity;
  data.magnetic_field = active_.object * reading.magnetic_field;
  data.orientation = orientation.normalized();
  data.analog_in_1 = std::uint16_t{0};
  data.analog_in_2 = std::uint16_t{0};
  data.status = kStatusGood;
  data.counter = counter_++;
  return data;
}

void MtiState::send(MessageId id, std::vector<std::uint8_t> data, double ready_s) {
  outgoing_.push_back({{static_cast<std::uint8_t>(id), std::move(data)}, ready_s, baudRate()});
}

void MtiState::acknowledge(const Message& message, std::vector<std::uint8_t> data, double now_s) {
  send(static_cast<MessageId>(message.id + 1), std::move(data), now_s);
}

void MtiState::refuse(ErrorCode code, double now_s) {
  ++bad_requests_;
  send(MessageId::kError, {static_cast<std::uint8_t>(code)}, now_s);
}

void MtiState::handle(const Message& message, double now_s) {
  if (message.is(MessageId::kWakeUpAck)) {
    if (state_ == State::kWakeUp) state_ = State::kConfig;
    return;
  }
  ++requests_;
  if (answer_errors_) return refuse(ErrorCode::kMessage, now_s);
  if (handleAnywhere(message, now_s)) return;
  if (state_ == State::kConfig) return handleInConfig(message, now_s);
  if (message.is(MessageId::kReqData)) return sendLatest(message, now_s);
  refuse(ErrorCode::kMessage, now_s);
}

bool MtiState::handleAnywhere(const Message& message, double now_s) {
  switch (static_cast<MessageId>(message.id)) {
    case MessageId::kGoToConfig:
      state_ = State::kConfig;
      acknowledge(message, {}, now_s);
      return true;
    case MessageId::kReset:
      acknowledge(message, {}, now_s);
      powerOn(now_s);
      return true;
    case MessageId::kResetOrientation:
      resetOrientation(message, now_s);
      return true;
    default:
      return false;
  }
}

void MtiState::handleInConfig(const Message& message, double now_s) {
  switch (static_cast<MessageId>(message.id)) {
    case MessageId::kGoToMeasurement:
      if (mti::mtDataSize(active_.mode, active_.settings) == 0) {
        return refuse(ErrorCode::kParameter, now_s);
      }
      acknowledge(message, {}, now_s);
      return goToMeasurement(now_s);
    case MessageId::kReqDid: {
      ByteWriter out;
      out.u32(device_id_);
      return acknowledge(message, out.bytes(), now_s);
    }
    case MessageId::kReqFirmwareRevision:
      return acknowledge(message, {2, 8, 1}, now_s);
    case MessageId::kReqConfiguration:
      return sendConfiguration(now_s);
    case MessageId::kSetPeriod:
      return setNumber(
          message, &MtiSettings::period, [](auto period) { return period >= kShortestPeriod; },
          now_s, ErrorCode::kPeriod);
    case MessageId::kSetOutputSkipFactor:
      return setNumber(
          message, &MtiSettings::skip_factor, [](auto) { return true; }, now_s);
    case MessageId::kSetOutputMode:
      return setNumber(
          message, &MtiSettings::mode, [](auto mode) { return mti::mtDataSize(mode, 0) > 0; },
          now_s);
    case MessageId::kSetOutputSettings:
      return setNumber(
          message, &MtiSettings::settings,
          [](auto bits) { return mti::mtDataSize(mti::output_mode::kOrientation, bits) > 0; },
          now_s);
    case MessageId::kSetErrorMode:
      return setNumber(
          message, &MtiSettings::error_mode, [](auto mode) { return mode <= kLastErrorMode; },
          now_s);
    case MessageId::kSetBaudRate:
      return setNumber(
          message, &MtiSettings::baud_rate, [](auto rate) { return mtiBaudRate(rate) > 0; }, now_s,
          ErrorCode::kBaudRate);
    case MessageId::kSetHeading:
      return setHeading(message, now_s);
    case MessageId::kSetObjectAlignment:
      return setObjectAlignment(message, now_s);
    default:
      refuse(ErrorCode::kMessage, now_s);
  }
}

/// An unsigned number of its own width: asked for without data, else set when accepted.
template <typename T, typename Accept>
void MtiState::setNumber(const Message& message, T MtiSettings::*field, Accept accept, double now_s,
                         ErrorCode refusal) {
  if (message.data.empty()) {
    ByteWriter out;
    for (std::size_t i = sizeof(T); i-- > 0;) {
      out.u8(static_cast<std::uint8_t>((active_.*field >> (8U * i)) & 0xFFU));
    }
    return acknowledge(message, out.bytes(), now_s);
  }
  if (message.data.size() != sizeof(T)) return refuse(ErrorCode::kParameter, now_s);
  std::uint32_t value = 0;
  for (const std::uint8_t byte : message.data) value = (value << 8U) | byte;
  if (!accept(static_cast<T>(value))) return refuse(refusal, now_s);
  keep(field, static_cast<T>(value));
  acknowledge(message, {}, now_s);
}

template <typename T>
void MtiState::keep(T MtiSettings::*field, const T& value) {
  active_.*field = value;
  stored_.*field = value;
}

void MtiState::setHeading(const Message& message, double now_s) {
  ByteWriter current;
  current.f32(active_.heading);
  if (message.data.empty()) return acknowledge(message, current.bytes(), now_s);
  if (message.data.size() != 4) return refuse(ErrorCode::kParameter, now_s);
  const double heading = ByteReader(message.data).f32();
  if (!(std::abs(heading) <= static_cast<double>(static_cast<float>(kPi)))) {
    return refuse(ErrorCode::kParameter, now_s);
  }
  keep(&MtiSettings::heading, heading);
  keep(&MtiSettings::earth, yaw(heading));
  acknowledge(message, {}, now_s);
}

void MtiState::setObjectAlignment(const Message& message, double now_s) {
  if (message.data.empty()) {
    ByteWriter out;
    const Eigen::Matrix3d m = active_.object.toRotationMatrix();
    for (int i = 0; i < 9; ++i) out.f32(m(i / 3, i % 3));
    return acknowledge(message, out.bytes(), now_s);
  }
  if (message.data.size() != 36) return refuse(ErrorCode::kParameter, now_s);
  ByteReader in(message.data);
  Eigen::Matrix3d m;
  for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = in.f32();
  if (!m.isUnitary(1e-3) || !(m.determinant() > 0.0)) return refuse(ErrorCode::kParameter, now_s);
  keep(&MtiSettings::object, Quaterniond(nearestRotation(m)));
  acknowledge(message, {}, now_s);
}

void MtiState::resetOrientation(const Message& message, double now_s) {
  enum Code : std::uint16_t { kStore, kHeading, kGlobal, kObject, kAlign };
  if (message.data.size() != 2) return refuse(ErrorCode::kParameter, now_s);
  const std::uint16_t code = ByteReader(message.data).u16();
  if (code > kAlign) return refuse(ErrorCode::kParameter, now_s);
  const Quaterniond sensor = sensorInEarth(now_s);
  if (code == kStore) {
    if (state_ != State::kConfig) return refuse(ErrorCode::kMessage, now_s);
    stored_.heading = active_.heading;
    stored_.earth = active_.earth;
    stored_.object = active_.object;
  }
  if (code == kObject || code == kAlign) {
    active_.object = yaw(headingOf(sensor)).conjugate() * sensor;
  }
  if (code == kGlobal) {
    active_.earth = (sensor * active_.object.conjugate()).conjugate();
  }
  if (code == kHeading || code == kAlign) {
    active_.heading = -headingOf(sensor * active_.object.conjugate());
    active_.earth = yaw(active_.heading);
  }
  acknowledge(message, {}, now_s);
}

/// ReqData: the newest sample, when data are sent on request only.
void MtiState::sendLatest(const Message& message, double now_s) {
  const bool measuring = state_ == State::kMeasurement && active_.skip_factor == kOnRequest;
  if (!measuring || !message.data.empty()) return refuse(ErrorCode::kMessage, now_s);
  const double done = std::floor((now_s - kLatencyS - measurement_start_s_) / samplePeriod());
  const double time_s = sampleTime(static_cast<std::uint64_t>(std::max(done, 0.0)));
  const Message data = encodeMtData(measure(time_s), active_.mode, active_.settings);
  send(MessageId::kMtData, data.data, now_s);
}

/// Configuration: 98 bytes about the (only) master, 20 about the sensor.
void MtiState::sendConfiguration(double now_s) {
  ByteWriter out;
  out.u32(device_id_);
  out.u16(active_.period);
  out.u16(active_.skip_factor);
  out.zeros(2 + 2 + 4);  // synchronisation input: off
  out.zeros(8 + 8);      // date and time: not set
  out.zeros(32 + 32);    // reserved for host and client
  out.u16(1);            // devices
  out.u32(device_id_);
  out.u16(static_cast<std::uint16_t>(mti::mtDataSize(active_.mode, active_.settings)));
  out.u16(active_.mode);
  out.u32(active_.settings);
  out.zeros(8);
  send(MessageId::kConfiguration, out.bytes(), now_s);
}

}  // namespace scanner::simulation
