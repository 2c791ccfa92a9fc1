#include "scanner/core/clock_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <optional>
#include <vector>

#include "core/envelope_line.h"
#include "scanner/core/status.h"

namespace scanner {
namespace {

constexpr double kBinS = 1.0;            ///< of device time; a bin keeps its tightest bounds
constexpr std::size_t kLowerRank = 4;    ///< the lower bound used is this one from the top of a bin
constexpr std::size_t kArrivals = 512;   ///< kept to see how arrivals scatter
constexpr double kStartS = 5.0;          ///< while the fit is young it is renewed more often
constexpr double kStartFitEveryS = 0.1;  ///< then
constexpr double kFitEveryS = 1.0;       ///< later
constexpr double kLateForS = 1.0;
constexpr double kReadyS = 10.0;
constexpr double kReadyPpm = 100.0;
/// Lower bounds may be above upper ones by this: both carry the delays of reading.
constexpr double kContradictionS = 0.3e-3;
constexpr int kOutliersPerFit = 4;
constexpr std::size_t kFewestBins = 8;
constexpr double kUpperWindowS = 60.0;  ///< of the fit to upper bounds alone
/// Lower bounds count when they leave less room than this share of the median latency, and do not
/// lower the line by more than the other.
constexpr double kInformativeShare = 0.5;
constexpr double kShareOfLatency = 0.25;
constexpr double kSteeringS = 0.5;        ///< time constant
constexpr double kYoungSteeringS = 0.05;  ///< within the first second, when the line moves most
constexpr double kYoungS = 1.0;
constexpr double kSteeringShare = 0.1;  ///< of the interval, at most
constexpr double kSteeringFastS = 1.0;  ///< more than this to make up:
constexpr double kSteeringFastShare = 0.5;
constexpr Duration kLeastStep{1000};

/// The tightest bounds of a stretch of device time.
struct Bin {
  double begin = 0.0;
  EnvelopePoint upper;
  /// Highest first. A late reader makes lower bounds too high, so that the highest ones of a bin
  /// are no good.
  std::array<EnvelopePoint, kLowerRank> lower{};
  std::size_t lower_count = 0;

  void addLower(const EnvelopePoint& point, double slope) {
    const auto height = [slope](const EnvelopePoint& p) { return p.y - slope * p.x; };
    std::size_t i = lower_count;
    while (i > 0 && height(lower[i - 1]) < height(point)) --i;
    if (i == kLowerRank) return;
    lower_count = std::min(lower_count + 1, kLowerRank);
    for (std::size_t j = lower_count - 1; j > i; --j) lower[j] = lower[j - 1];
    lower[i] = point;
  }
};

}  // namespace

/// Coordinates: x = device time since the first sample of this fit, y = host's time since then
/// minus x; both in seconds.
class ClockModel::Impl {
 public:
  explicit Impl(const Options& options) : options_(options) {
    if (!(options.window_s > 0.0 && options.max_drift_ppm > 0.0 && options.step_s > 0.0 &&
          options.wander_ppm_per_s >= 0.0)) {
      throw ConfigurationError("clock model: window, drift and step must be positive");
    }
  }

  Time update(Duration device_time, Time arrival, const Evidence& evidence);
  void restart();

  bool ready() const { return age_ >= kReadyS && slope_uncertainty_ * 1e6 < kReadyPpm; }
  double driftPpm() const { return ready() ? -1e6 * line_.slope : 0.0; }
  double arrivalJitter() const;
  std::uint64_t restarts() const { return restarts_; }

 private:
  double hostOffset(Time host, double x) const { return toSeconds(host - origin_host_) - x; }
  void begin(Duration device_time, Time arrival);
  bool isStep(double x, double y);
  void gather(double x, double arrival_y, const Evidence& evidence);
  void fit(double x);
  EnvelopeProblem problem(double x) const;
  EnvelopeFit upperFit(double x) const;
  EnvelopeFit twoSidedFit(double x, std::vector<std::size_t>* lower_bins) const;
  std::optional<EnvelopeFit> consistentFit(double x);
  double medianLatency(const EnvelopeLine& line) const;
  Time stamp(double x);

  const Options options_;
  bool started_ = false;
  Duration origin_device_{};
  Time origin_host_{};
  Duration last_device_{};
  std::optional<Time> last_stamp_;
  std::deque<Bin> bins_;
  std::vector<EnvelopePoint> arrivals_;  ///< ring
  std::size_t next_arrival_ = 0;
  EnvelopeLine line_;
  double prior_slope_ = 0.0;
  double slope_uncertainty_ = std::numeric_limits<double>::infinity();
  double age_ = 0.0;
  double next_fit_ = 0.0;
  double last_x_ = 0.0;
  bool stamped_ = false;   ///< since the origin was set
  double steering_ = 0.0;  ///< what stamps are off the line, and lose by and by
  std::optional<double> late_since_;
  std::uint64_t restarts_ = 0;
};

void ClockModel::Impl::restart() {
  if (ready()) prior_slope_ = line_.slope;
  started_ = false;
  bins_.clear();
  arrivals_.clear();
  next_arrival_ = 0;
  age_ = 0.0;
  slope_uncertainty_ = std::numeric_limits<double>::infinity();
  late_since_.reset();
}

void ClockModel::Impl::begin(Duration device_time, Time arrival) {
  started_ = true;
  origin_device_ = device_time;
  origin_host_ = arrival;
  line_ = {0.0, 0.0, prior_slope_};
  next_fit_ = 0.0;
  last_x_ = 0.0;
  stamped_ = false;
  // Stamps go on above the last one; they may jump forward, not back.
  steering_ = 0.0;
  if (last_stamp_) steering_ = std::max(0.0, toSeconds(*last_stamp_ + kLeastStep - arrival));
}

Time ClockModel::Impl::update(Duration device_time, Time arrival, const Evidence& evidence) {
  if (started_ && device_time <= last_device_) return *last_stamp_;
  last_device_ = device_time;
  if (!started_) begin(device_time, arrival);
  double x = toSeconds(device_time - origin_device_);
  double y = hostOffset(arrival, x);
  if (isStep(x, y)) {
    ++restarts_;
    restart();
    begin(device_time, arrival);
    x = y = 0.0;
  }
  age_ = x;
  gather(x, y, evidence);
  const bool young = x < kStartS;
  const bool above_bound = bins_.back().upper.y < line_.at(bins_.back().upper.x);
  if (x >= next_fit_ || (young && above_bound)) fit(x);
  last_stamp_ = stamp(x);
  return *last_stamp_;
}

bool ClockModel::Impl::isStep(double x, double y) {
  const double off = y - line_.at(x);
  if (off < -options_.step_s) return true;
  if (off < options_.step_s) {
    late_since_.reset();
    return false;
  }
  if (!late_since_) late_since_ = x;
  return x - *late_since_ >= kLateForS;
}

void ClockModel::Impl::gather(double x, double arrival_y, const Evidence& evidence) {
  if (arrivals_.size() < kArrivals) {
    arrivals_.push_back({x, arrival_y});
  } else {
    arrivals_[next_arrival_] = {x, arrival_y};
    next_arrival_ = (next_arrival_ + 1) % kArrivals;
  }
  double upper_y = arrival_y;
  if (evidence.latest != Time::max()) upper_y = std::min(upper_y, hostOffset(evidence.latest, x));
  if (bins_.empty() || x >= bins_.back().begin + kBinS) {
    bins_.push_back({});
    bins_.back().begin = x;
    bins_.back().upper = {x, upper_y};
    while (bins_.front().begin < x - options_.window_s) bins_.pop_front();
  }
  Bin& bin = bins_.back();
  if (upper_y - line_.at(x) < bin.upper.y - line_.at(bin.upper.x)) bin.upper = {x, upper_y};
  if (evidence.earliest != Time::min()) {
    bin.addLower({x, hostOffset(evidence.earliest, x)}, line_.slope);
  }
}

EnvelopeProblem ClockModel::Impl::problem(double x) const {
  EnvelopeProblem problem;
  problem.x = x;
  problem.prior_slope = prior_slope_;
  problem.max_slope = 1e-6 * options_.max_drift_ppm;
  return problem;
}

EnvelopeFit ClockModel::Impl::upperFit(double x) const {
  EnvelopeProblem upper_only = problem(x);
  for (const Bin& bin : bins_) {
    if (bin.upper.x >= x - kUpperWindowS) upper_only.upper.push_back(bin.upper);
  }
  return fitEnvelope(upper_only);
}

EnvelopeFit ClockModel::Impl::twoSidedFit(double x, std::vector<std::size_t>* lower_bins) const {
  EnvelopeProblem both = problem(x);
  const double wander = 0.5e-6 * options_.wander_ppm_per_s;
  for (std::size_t i = 0; i < bins_.size(); ++i) {
    const Bin& bin = bins_[i];
    const double slack = wander * (x - bin.begin) * (x - bin.begin);
    both.upper.push_back({bin.upper.x, bin.upper.y + slack});
    if (bin.lower_count == 0) continue;
    const EnvelopePoint& lower = bin.lower[bin.lower_count - 1];
    both.lower.push_back({lower.x, lower.y - slack});
    lower_bins->push_back(i);
  }
  return fitEnvelope(both);
}

/// Lower bounds that contradict the upper ones are left out when they are few; else the clocks have
/// changed, and the oldest bins go.
std::optional<EnvelopeFit> ClockModel::Impl::consistentFit(double x) {
  while (true) {
    for (int i = 0; i <= kOutliersPerFit; ++i) {
      std::vector<std::size_t> lower_bins;
      const EnvelopeFit fit = twoSidedFit(x, &lower_bins);
      if (fit.room > -kContradictionS) return fit;
      if (i < kOutliersPerFit) bins_[lower_bins[fit.binding_lower]].lower_count = 0;
    }
    if (bins_.size() <= kFewestBins) return std::nullopt;
    bins_.erase(bins_.begin(), bins_.begin() + static_cast<std::ptrdiff_t>(bins_.size() / 4));
  }
}

void ClockModel::Impl::fit(double x) {
  next_fit_ = x + (x < kStartS ? kStartFitEveryS : kFitEveryS);
  EnvelopeFit best = upperFit(x);
  const double latency = std::max(0.0, medianLatency(best.line));
  // Where arrivals are prompt the smallest latency is none, and lower bounds have nothing to add.
  const std::optional<EnvelopeFit> both = consistentFit(x);
  if (both && both->room < kInformativeShare * latency) {
    best = *both;
    best.line.y -= std::clamp(0.5 * best.room, 0.0, kShareOfLatency * latency);
  }
  if (stamped_) steering_ += line_.at(last_x_) - best.line.at(last_x_);
  line_ = best.line;
  slope_uncertainty_ = best.slope_uncertainty;
}

double ClockModel::Impl::medianLatency(const EnvelopeLine& line) const {
  std::vector<double> latencies;
  latencies.reserve(arrivals_.size());
  for (const EnvelopePoint& p : arrivals_) latencies.push_back(p.y - line.at(p.x));
  const auto middle = latencies.begin() + static_cast<std::ptrdiff_t>(latencies.size() / 2);
  std::nth_element(latencies.begin(), middle, latencies.end());
  return *middle;
}

double ClockModel::Impl::arrivalJitter() const {
  if (arrivals_.size() < 2) return 0.0;
  double mean = 0.0;
  for (const EnvelopePoint& p : arrivals_) mean += p.y - line_.at(p.x);
  mean /= static_cast<double>(arrivals_.size());
  double squares = 0.0;
  for (const EnvelopePoint& p : arrivals_) {
    const double off = p.y - line_.at(p.x) - mean;
    squares += off * off;
  }
  return std::sqrt(squares / static_cast<double>(arrivals_.size() - 1));
}

Time ClockModel::Impl::stamp(double x) {
  const double interval = x - last_x_;
  const bool young = x < kYoungS;
  const bool fast = young || std::abs(steering_) > kSteeringFastS;
  const double share = fast ? kSteeringFastShare : kSteeringShare;
  const double time_constant = young ? kYoungSteeringS : kSteeringS;
  const double wanted = std::abs(steering_) * (1.0 - std::exp(-interval / time_constant));
  steering_ -= std::copysign(std::min(wanted, share * interval), steering_);
  last_x_ = x;
  stamped_ = true;
  const Time on_line = origin_host_ + fromSeconds(x + line_.at(x) + steering_);
  return last_stamp_ ? std::max(on_line, *last_stamp_ + Duration(1)) : on_line;
}

ClockModel::ClockModel() : ClockModel(Options()) {}
ClockModel::ClockModel(const Options& options) : impl_(std::make_unique<Impl>(options)) {}
ClockModel::~ClockModel() = default;
ClockModel::ClockModel(ClockModel&&) noexcept = default;
ClockModel& ClockModel::operator=(ClockModel&&) noexcept = default;

Time ClockModel::update(Duration device_time, Time arrival) {
  return impl_->update(device_time, arrival, {});
}
Time ClockModel::update(Duration device_time, Time arrival, const Evidence& evidence) {
  return impl_->update(device_time, arrival, evidence);
}
void ClockModel::restart() { impl_->restart(); }
bool ClockModel::ready() const { return impl_->ready(); }
double ClockModel::driftPpm() const { return impl_->driftPpm(); }
double ClockModel::arrivalJitter() const { return impl_->arrivalJitter(); }
std::uint64_t ClockModel::restarts() const { return impl_->restarts(); }

}  // namespace scanner
