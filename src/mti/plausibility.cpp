#include "scanner/mti/plausibility.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "scanner/core/se3.h"

namespace scanner::mti {
namespace {

using Eigen::Vector3d;

/// Whole messages that must have come after one before it is judged, and one more when in doubt.
constexpr std::size_t kAhead = 2;
constexpr std::size_t kRemembered = 6;
/// Neighbours further away (in samples) tell nothing about a moving sensor.
constexpr std::int64_t kFar = 24;

enum Channel : std::size_t { kAcceleration, kRate, kField, kOrientation, kTemperature };
/// Differences below these are never a reason: m/s^2, rad/s, earth fields, rad, degrees.
constexpr std::array<double, 5> kHarmless = {0.05, 0.01, 0.01, 2e-4, 0.1};
/// Rounding of a rotation to single precision stays below. A recorded device reaches 5.3e-7, which
/// is why what is usual for the device counts, too.
constexpr double kRoundedRotation = 3e-7;
constexpr double kDefectFactor = 5.0;
constexpr double kRise = 1.0 / 8.0;
constexpr double kFall = 1.0 / 64.0;

/// `v` of `data`, turned into the sensor frame of `origin`: seen from the earth, gravity and the
/// magnetic field stay where they are however the sensor turns.
std::optional<Vector3d> seenFrom(const MtData& origin, const MtData& data,
                                 const std::optional<Vector3d>& v) {
  if (!v || !data.orientation || !origin.orientation || &origin == &data) return v;
  return origin.orientation->conjugate() * (*data.orientation * *v);
}

std::optional<Vector3d> channelOf(const MtData& data, std::size_t channel, const MtData& origin) {
  switch (channel) {
    case kAcceleration:
      return seenFrom(origin, data, data.acceleration);
    case kRate:
      return data.angular_velocity;
    case kField:
      return seenFrom(origin, data, data.magnetic_field);
    case kOrientation:
      if (!data.orientation || !origin.orientation) return std::nullopt;
      return logSo3(origin.orientation->conjugate() * *data.orientation);
    default:
      if (!data.temperature_c) return std::nullopt;
      return Vector3d(*data.temperature_c, 0.0, 0.0);
  }
}

/// Weights of the polynomial through `times` for its value at 0 (Lagrange).
std::vector<double> weightsAtZero(const std::vector<double>& times) {
  std::vector<double> weights(times.size(), 1.0);
  for (std::size_t i = 0; i < times.size(); ++i) {
    for (std::size_t j = 0; j < times.size(); ++j) {
      if (j != i) weights[i] *= times[j] / (times[j] - times[i]);
    }
  }
  return weights;
}

/// How far a prediction may be off compared with one from the four nearest samples: by the noise of
/// the neighbours, and by what the polynomial misses of the motion, which grows with their distance
/// (by less than the product of distances that smooth motion has: measured with hand-held motion).
std::array<double, 5> reach(const std::vector<double>& times, const std::vector<double>& weights) {
  constexpr std::array<double, 5> kGrowth = {0.3, 0.3, 0.0, 0.5, 0.0};
  double noise = 1.0;
  double distance = 1.0;
  for (std::size_t i = 0; i < times.size(); ++i) {
    noise += weights[i] * weights[i];
    distance *= std::abs(times[i]);
  }
  std::array<double, 5> reach{};
  for (std::size_t i = 0; i < reach.size(); ++i) {
    reach[i] = std::sqrt(noise) * std::max(1.0, std::pow(distance / 4.0, kGrowth[i]));
  }
  return reach;
}

}  // namespace

void PlausibilityFilter::push(const Message& message, std::optional<Reading> reading,
                              const MessageParser::Statistics& line) {
  const std::size_t header = message.data.size() < 255 ? 4 : 6;
  const auto bytes = static_cast<std::int64_t>(header + message.data.size() + 1);
  framed_bytes_ += bytes;
  noteDamage(line);
  const bool data = message.is(MessageId::kMtData) || message.is(MessageId::kMtData2);
  if (!reading) {
    if (data) watch_left_ = options_.watch_messages;
    return;
  }
  Entry entry{std::move(*reading), framed_bytes_ + static_cast<std::int64_t>(line.skipped_bytes),
              bytes};
  if (watch_left_ == 0 && pending_.empty()) return accept(std::move(entry));
  pending_.push_back(std::move(entry));
  ++statistics_.held;
  judgePending(watch_left_ == 0);
}

std::optional<Reading> PlausibilityFilter::next() {
  if (ready_.empty()) return std::nullopt;
  Reading reading = std::move(ready_.front());
  ready_.pop_front();
  return reading;
}

void PlausibilityFilter::flush() { judgePending(true); }

void PlausibilityFilter::restart() {
  line_.reset();
  framed_bytes_ = 0;
  watch_left_ = 0;
  pending_.clear();
  accepted_.clear();
  ready_.clear();
  scatter_ = {};
  usual_defect_ = 0.0;
}

void PlausibilityFilter::noteDamage(const MessageParser::Statistics& line) {
  // What was skipped before the first message is the middle of a message, no damage.
  const bool damaged = line_ && (line.checksum_errors != line_->checksum_errors ||
                                 line.skipped_bytes != line_->skipped_bytes);
  line_ = line;
  if (damaged) {
    watch_left_ = options_.watch_messages;
  } else if (watch_left_ > 0) {
    --watch_left_;
  }
}

void PlausibilityFilter::judgePending(bool all) {
  while (!pending_.empty() && (all || pending_.size() > kAhead)) {
    const bool last_word = all || pending_.size() > kAhead + 1;
    const Verdict verdict = judge(last_word);
    if (verdict == Verdict::kWait) return;
    Entry entry = std::move(pending_.front());
    pending_.pop_front();
    switch (verdict) {
      case Verdict::kCounter:
        ++statistics_.rejected_counter;
        break;
      case Verdict::kRotation:
        ++statistics_.rejected_rotation;
        break;
      case Verdict::kJump:
        ++statistics_.rejected_jump;
        break;
      default:
        accept(std::move(entry));
    }
  }
}

/// About the first of pending_. The samples after it are not judged yet: one of them may be the
/// damaged one, so it is enough when it fits with all but one of them.
PlausibilityFilter::Verdict PlausibilityFilter::judge(bool last_word) const {
  const Entry& entry = pending_.front();
  const double tolerance = std::max(kRoundedRotation, kDefectFactor * usual_defect_);
  if (entry.reading.rotation_defect > tolerance) return Verdict::kRotation;
  if (!counterFits(entry)) return last_word ? Verdict::kCounter : Verdict::kWait;
  const std::size_t after = pending_.size() - 1;
  for (std::size_t left_out = 0; left_out <= after; ++left_out) {
    if (fitsNeighbours(entry, neighboursOf(entry, left_out))) return Verdict::kAccept;
  }
  return last_word ? Verdict::kJump : Verdict::kWait;
}

namespace {

/// Samples from a to b by the device's counter, or by the bytes in between where there is none.
template <typename Entry>
std::int64_t stepsBetween(const Entry& a, const Entry& b) {
  const auto& from = a.reading.data.counter;
  const auto& to = b.reading.data.counter;
  if (from && to) return static_cast<std::int16_t>(static_cast<std::uint16_t>(*to - *from));
  return std::llround(static_cast<double>(b.position - a.position) / static_cast<double>(b.bytes));
}

/// A wrong counter is off by whole messages; lost bytes and short answers in between are less.
template <typename Entry>
bool agreeOnPlace(const Entry& a, const Entry& b) {
  const std::int64_t difference = b.position - a.position - stepsBetween(a, b) * b.bytes;
  return 2 * std::abs(difference) < b.bytes;
}

}  // namespace

bool PlausibilityFilter::counterFits(const Entry& entry) const {
  if (!entry.reading.data.counter) return true;
  const bool alone = accepted_.empty() && pending_.size() == 1;
  if (alone || (!accepted_.empty() && agreeOnPlace(accepted_.back(), entry))) return true;
  return std::any_of(pending_.begin() + 1, pending_.end(),
                     [&entry](const Entry& other) { return agreeOnPlace(entry, other); });
}

/// Two accepted samples before and two after, or more of one side where the other has fewer.
/// `left_out`: which of those after to do without; 0 is none of them.
std::vector<const PlausibilityFilter::Entry*> PlausibilityFilter::neighboursOf(
    const Entry& entry, std::size_t left_out) const {
  std::vector<const Entry*> after;
  for (std::size_t i = 1; i < pending_.size(); ++i) {
    const std::int64_t steps = stepsBetween(entry, pending_[i]);
    if (i != left_out && steps > 0 && steps <= kFar && agreeOnPlace(entry, pending_[i])) {
      after.push_back(&pending_[i]);
    }
  }
  std::vector<const Entry*> before;
  for (auto it = accepted_.rbegin(); it != accepted_.rend(); ++it) {
    const std::int64_t steps = stepsBetween(*it, entry);
    if (steps > 0 && steps <= kFar) before.push_back(&*it);
  }
  const std::size_t from_after = std::min(after.size(), before.size() < 2 ? 4 - before.size() : 2);
  const std::size_t from_before = std::min(before.size(), 4 - from_after);
  std::vector<const Entry*> neighbours(before.begin(),
                                       before.begin() + static_cast<std::ptrdiff_t>(from_before));
  neighbours.insert(neighbours.end(), after.begin(),
                    after.begin() + static_cast<std::ptrdiff_t>(from_after));
  return neighbours;
}

namespace {

/// Largest deviation over the axes of each channel from what the neighbours predict, in units of
/// reach(); negative where a channel is not there.
template <typename Entry>
std::array<double, 5> deviations(const Entry& entry, const std::vector<const Entry*>& neighbours) {
  std::vector<double> times;
  times.reserve(neighbours.size());
  for (const Entry* neighbour : neighbours) {
    times.push_back(static_cast<double>(stepsBetween(entry, *neighbour)));
  }
  const std::vector<double> weights = weightsAtZero(times);
  const std::array<double, 5> scale = reach(times, weights);
  std::array<double, 5> scores{};
  for (std::size_t channel = 0; channel < scores.size(); ++channel) {
    const MtData& data = entry.reading.data;
    const std::optional<Vector3d> value = channelOf(data, channel, data);
    Vector3d predicted = Vector3d::Zero();
    bool complete = value.has_value();
    for (std::size_t i = 0; complete && i < neighbours.size(); ++i) {
      const auto other = channelOf(neighbours[i]->reading.data, channel, data);
      complete = other.has_value();
      if (complete) predicted += weights[i] * *other;
    }
    scores[channel] = complete ? (*value - predicted).cwiseAbs().maxCoeff() / scale[channel] : -1.0;
  }
  return scores;
}

}  // namespace

bool PlausibilityFilter::fitsNeighbours(const Entry& entry,
                                        const std::vector<const Entry*>& neighbours) const {
  if (neighbours.empty()) return false;
  const Scores scores = deviations(entry, neighbours);
  for (std::size_t channel = 0; channel < kChannels; ++channel) {
    const double limit = std::max(options_.jump_threshold * scatter_[channel], kHarmless[channel]);
    if (scores[channel] > limit) return false;
  }
  return true;
}

void PlausibilityFilter::accept(Entry entry) {
  ++statistics_.accepted;
  const double defect = entry.reading.rotation_defect;
  usual_defect_ += (defect > usual_defect_ ? kRise : kFall) * (defect - usual_defect_);
  ready_.push_back(entry.reading);
  accepted_.push_back(std::move(entry));
  if (accepted_.size() > kRemembered) accepted_.pop_front();
  learn();
}

/// The scatter that is usual now: of the third sample from the end about the two on each side.
void PlausibilityFilter::learn() {
  if (accepted_.size() < 5) return;
  const std::size_t last = accepted_.size() - 1;
  const Entry& middle = accepted_[last - 2];
  const std::vector<const Entry*> neighbours = {&accepted_[last - 3], &accepted_[last - 4],
                                                &accepted_[last - 1], &accepted_[last]};
  for (std::size_t i = 0; i < neighbours.size(); ++i) {
    const std::int64_t steps = stepsBetween(middle, *neighbours[i]);
    if (steps == 0 || std::abs(steps) > kFar || (steps < 0) != (i < 2)) return;
  }
  if (stepsBetween(accepted_[last - 4], accepted_[last - 3]) <= 0) return;
  if (stepsBetween(accepted_[last - 1], accepted_[last]) <= 0) return;
  const Scores scores = deviations(middle, neighbours);
  for (std::size_t channel = 0; channel < kChannels; ++channel) {
    if (scores[channel] < 0.0) continue;
    const double rate = scores[channel] > scatter_[channel] ? kRise : kFall;
    scatter_[channel] += rate * (scores[channel] - scatter_[channel]);
  }
}

}  // namespace scanner::mti
