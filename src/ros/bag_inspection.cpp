#include "scanner/ros/bag_inspection.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "scanner/pipeline/config.h"
#include "scanner/ros/package_files.h"
#include "scanner/stereo/rectify.h"
#include "scanner/stereo/suitability.h"

namespace scanner::bridge {
namespace {

constexpr int kSaturated = 250;
constexpr int kBlack = 5;
constexpr double kMaxSaturatedShare = 0.1;
constexpr double kMaxBrightnessRatio = 1.3;
constexpr double kStandardGravity = 9.81;
constexpr double kMaxPlausibleRate = 12.0;  ///< rad/s, 690 deg/s: nobody scans that fast
constexpr double kRotationWindow_s = 0.5;
constexpr double kMinRotation_rad = 0.05;
constexpr double kMaxDelay_s = 0.5;
constexpr double kMinShare = 0.1;   ///< below: cannot be scanned with this configuration
constexpr double kGoodShare = 0.6;  ///< below: another one is worth a look
constexpr double kCoverage_s = 0.2;
constexpr std::size_t kSampledFrames = 3;

std::string number(double value, int digits) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(digits) << value;
  return out.str();
}

/// Running brightness statistics of one camera; every fourth row is enough.
class ExposureMeter {
 public:
  void add(const cv::Mat& image) {
    for (int y = 0; y < image.rows; y += 4) {
      const std::uint8_t* row = image.ptr(y);
      const int n = image.cols * image.channels();
      for (int x = 0; x < n; ++x) {
        sum_ += row[x];
        saturated_ += row[x] >= kSaturated;
        black_ += row[x] <= kBlack;
      }
      count_ += static_cast<std::size_t>(n);
    }
  }
  ExposureSummary summary() const {
    if (count_ == 0) return {};
    const auto n = static_cast<double>(count_);
    return {static_cast<double>(sum_) / n, static_cast<double>(saturated_) / n,
            static_cast<double>(black_) / n};
  }

 private:
  std::size_t sum_ = 0, saturated_ = 0, black_ = 0, count_ = 0;
};

/// Looks at the samples' magnitudes, and compares rates with orientations over short windows.
class InertialMeter {
 public:
  void add(const ImuSample& sample) {
    acceleration_sum_ += sample.linear_acceleration.norm();
    rates_.push_back(sample.angular_velocity.norm());
    compare(sample);
    newest_ = sample.stamp;
  }
  void frame(Time stamp) {
    if (newest_ && *newest_ >= stamp && toSeconds(*newest_ - stamp) < kCoverage_s) ++covered_;
  }
  InertialSummary summary(std::size_t oriented) const {
    InertialSummary s;
    s.frames_covered = covered_;
    if (rates_.empty()) return s;
    const auto n = static_cast<double>(rates_.size());
    s.mean_acceleration = acceleration_sum_ / n;
    std::vector<double> sorted = rates_;
    const auto at = static_cast<std::ptrdiff_t>(0.95 * (n - 1.0));
    std::nth_element(sorted.begin(), sorted.begin() + at, sorted.end());
    s.rate_percentile_95 = sorted[static_cast<std::size_t>(at)];
    s.oriented_share = static_cast<double>(oriented) / n;
    if (orientation_angle_ > 0.0) s.rate_scale = rate_angle_ / orientation_angle_;
    return s;
  }

 private:
  void compare(const ImuSample& sample) {
    if (!sample.orientation) return;
    if (!window_ || !newest_) {
      window_ = sample;
      return;
    }
    const double dt = toSeconds(sample.stamp - *newest_);
    turned_ += sample.angular_velocity * dt;
    if (toSeconds(sample.stamp - window_->stamp) < kRotationWindow_s) return;
    const double angle = angleBetween(*window_->orientation, *sample.orientation);
    if (angle > kMinRotation_rad) {
      orientation_angle_ += angle;
      rate_angle_ += turned_.norm();
    }
    window_ = sample;
    turned_.setZero();
  }

  double acceleration_sum_ = 0.0;
  std::vector<double> rates_;
  std::optional<Time> newest_;
  std::size_t covered_ = 0;
  std::optional<ImuSample> window_;
  Eigen::Vector3d turned_ = Eigen::Vector3d::Zero();
  double orientation_angle_ = 0.0, rate_angle_ = 0.0;
};

void judgeInertial(BagInspection& out) {
  const InertialSummary& s = out.inertial;
  if (out.statistics.imu.messages == 0) return;
  const double g = s.mean_acceleration;
  if (g > 0.5 && g < 1.5) {
    out.problems.push_back("inertial accelerations look like g, not m/s^2 (mean magnitude " +
                           number(g, 2) + ", gravity is 9.81)");
  } else if (std::abs(g - kStandardGravity) > 0.2 * kStandardGravity) {
    out.problems.push_back("inertial accelerations have a mean magnitude of " + number(g, 2) +
                           ", not gravity's 9.81 m/s^2");
  }
  if (s.rate_scale > 10.0 || (s.rate_scale == 0.0 && s.rate_percentile_95 > kMaxPlausibleRate)) {
    out.problems.push_back("inertial rates look like deg/s, not rad/s (95th percentile " +
                           number(s.rate_percentile_95, 1) + ")");
  }
  if (s.oriented_share == 0.0) {
    out.warnings.push_back("no orientation from the inertial sensor: heading comes from the gyro");
  }
  const std::size_t frames = out.statistics.frames;
  if (frames > 0 && s.frames_covered == 0) {
    out.problems.push_back("no pair lies within the time span of the inertial samples");
  } else if (s.frames_covered < frames) {
    out.warnings.push_back(std::to_string(frames - s.frames_covered) + " of " +
                           std::to_string(frames) +
                           " pairs have no inertial samples at their time");
  }
}

void judgeExposure(BagInspection& out) {
  for (const auto& [side, meter] : {std::pair("left", out.left), std::pair("right", out.right)}) {
    if (meter.saturated_share > kMaxSaturatedShare) {
      out.warnings.push_back(std::string(side) + " images are over-exposed: " +
                             number(100.0 * meter.saturated_share, 1) + " % of the pixels are " +
                             std::to_string(kSaturated) + " or brighter");
    }
  }
  const double low = std::min(out.left.mean, out.right.mean);
  const double high = std::max(out.left.mean, out.right.mean);
  if (high > kMaxBrightnessRatio * low + 1.0) {
    out.warnings.push_back("the two cameras are exposed differently: mean brightness " +
                           number(out.left.mean, 0) + " and " + number(out.right.mean, 0));
  }
}

void judgeTiming(BagInspection& out) {
  const BagStatistics& s = out.statistics;
  for (const TopicStatistics* topic : {&s.left, &s.right, &s.imu}) {
    if (std::abs(topic->max_delay_s) > kMaxDelay_s) {
      out.warnings.push_back(topic->topic + ": recorded up to " + number(topic->max_delay_s, 2) +
                             " s away from its stamps");
    }
  }
  if (s.frames == 0 && s.left.messages > 0 && s.right.messages > 0) {
    out.problems.push_back("no left and right image carry the same stamp");
  }
  for (const std::string& note : s.notes) out.warnings.push_back(note);
}

double share(const stereo::DisparityRange& scene, const stereo::DisparityRange& searched) {
  const double overlap =
      std::min(scene.max_px, searched.max_px) - std::max(scene.min_px, searched.min_px);
  return std::max(0.0, overlap) / std::max(1.0, scene.max_px - scene.min_px);
}

/// Disparities that all the sampled pairs show together, and trouble with the pictures.
std::optional<stereo::DisparityRange> measure(const std::vector<StereoFrame>& frames,
                                              const StereoCalibration& calibration, int threads,
                                              BagInspection& out) {
  std::optional<stereo::DisparityRange> all;
  const stereo::Rectifier rectifier(calibration);
  for (const StereoFrame& frame : frames) {
    const Result<stereo::RectifiedPair> pair = rectifier.rectify(frame);
    if (!pair) {
      out.warnings.push_back(pair.status().message());
      continue;
    }
    const std::string trouble = stereo::describeTrouble(*pair, threads);
    if (!trouble.empty()) out.warnings.push_back(trouble);
    const Result<stereo::DisparityRange> range = stereo::measureDisparities(*pair, threads);
    if (!range) continue;
    if (!all) all = *range;
    all->min_px = std::min(all->min_px, range->min_px);
    all->max_px = std::max(all->max_px, range->max_px);
  }
  return all;
}

SuitabilitySummary suitability(const std::string& name, const StereoCalibration& calibration,
                               const stereo::DisparityRange& scene) {
  const stereo::StereoOptions options = pipeline::loadConfig(configPath(name)).stereo;
  const stereo::DepthRange depths = stereo::workingRange(calibration, options);
  SuitabilitySummary s;
  s.config = name;
  s.min_depth_m = depths.min_depth_m;
  s.max_depth_m = depths.max_depth_m;
  s.share = share(scene, stereo::disparityRange(calibration, depths));
  return s;
}

void judgeSuitability(const std::vector<StereoFrame>& frames, const std::string& config,
                      int threads, BagInspection& out) {
  if (!out.calibration || frames.empty()) return;
  const StereoCalibration& calibration = *out.calibration;
  const auto scene = measure(frames, calibration, threads, out);
  if (!scene) {
    out.problems.push_back("almost nothing matches between left and right images");
    return;
  }
  const double fB = calibration.focalLength() * calibration.baseline();
  const double offset = calibration.disparityOffset();
  out.near_m = fB / std::max(1.0, scene->max_px - offset);
  out.far_m = fB / std::max(1.0, scene->min_px - offset);
  out.suitability.push_back(suitability(config, calibration, *scene));
  const SuitabilitySummary chosen = out.suitability.front();
  SuitabilitySummary best = chosen;
  for (const char* name : {"field", "thesis", "room"}) {
    if (name == config) continue;
    out.suitability.push_back(suitability(name, calibration, *scene));
    if (out.suitability.back().share > best.share) best = out.suitability.back();
  }
  if (chosen.share >= kGoodShare) return;
  std::string line = "configuration '" + config + "' searches " + number(chosen.min_depth_m, 2) +
                     ".." + number(chosen.max_depth_m, 2) + " m, the scene lies at " +
                     number(out.near_m, 2) + ".." + number(out.far_m, 2) + " m (" +
                     number(100.0 * chosen.share, 0) + " % of its disparities)";
  if (best.config != config) line += "; use --config " + best.config;
  (chosen.share < kMinShare ? out.problems : out.warnings).push_back(line);
}

}  // namespace

BagInspection inspectBag(const std::string& path, const std::string& config, int threads,
                         const Topics& topics) {
  const std::string config_file = configPath(config);
  pipeline::loadConfig(config_file);  // a bad configuration is found before minutes of reading
  BagInspection out;
  out.bag = path;
  Result<BagReader> bag = BagReader::open(path, topics);
  if (!bag) {
    out.problems.push_back(bag.status().message());
    return out;
  }
  if (const Status status = bag->checkScannable(); !status) {
    out.problems.push_back(status.message());
  }
  if (bag->calibration()) out.calibration = *bag->calibration();
  if (bag->rig()) out.rig = *bag->rig();
  if (!out.rig) out.warnings.push_back(bag->rig().status().message() + "; give --rig to scan_bag");

  ExposureMeter left, right;
  InertialMeter inertial;
  std::vector<StereoFrame> sampled;
  std::size_t seen = 0;
  const std::size_t stride = std::max<std::size_t>(1, bag->expectedFrames() / kSampledFrames);
  BagHandlers handlers;
  handlers.imu = [&](const ImuSample& sample) { return inertial.add(sample), true; };
  handlers.frame = [&](const StereoFrame& frame) {
    left.add(frame.left.data);
    right.add(frame.right.data);
    inertial.frame(frame.stamp);
    if (seen++ % stride == stride / 2 && sampled.size() < kSampledFrames) sampled.push_back(frame);
    return true;
  };
  out.statistics = bag->play(handlers);
  out.left = left.summary();
  out.right = right.summary();
  out.inertial = inertial.summary(out.statistics.imu_oriented);
  judgeTiming(out);
  judgeExposure(out);
  judgeInertial(out);
  judgeSuitability(sampled, config, threads, out);
  return out;
}

}  // namespace scanner::bridge
