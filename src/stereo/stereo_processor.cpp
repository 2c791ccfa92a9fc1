#include "scanner/stereo/stereo_processor.h"

#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "scanner/core/parallel.h"
#include "scanner/core/se3.h"
#include "scanner/stereo/normals.h"
#include "scanner/stereo/triangulate.h"

namespace scanner::stereo {
namespace {

/// Pairs of which less matches are looked at for trouble.
constexpr double kSuspiciousShare = 0.25;
constexpr std::size_t kPointsPerChunk = 16384;

/// No disparity anywhere.
DisparityImage nothingOf(const RectifiedPair& pair) {
  const cv::Mat nan(pair.left_gray.size(), CV_32FC1,
                    cv::Scalar(std::numeric_limits<float>::quiet_NaN()));
  return {pair.stamp, nan, nan.clone(), 0.0, 0.0};
}

/// Seconds since the last call.
class Stopwatch {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

struct Sums {
  std::size_t points = 0, normals = 0;
  double sigma_px = 0.0, sigma_m = 0.0;
};

void summarize(const PointCloud& cloud, const DisparityImage& disparity, int threads,
               StereoStatistics& s) {
  const float* sigmas_px = disparity.sigma_px.ptr<float>();
  std::vector<Sums> chunks(chunkCount(cloud.size(), kPointsPerChunk));
  parallelFor(cloud.size(), kPointsPerChunk, threads, [&](std::size_t begin, std::size_t end) {
    Sums sums;
    for (std::size_t i = begin; i < end; ++i) {
      if (std::isnan(cloud.points[i].z())) continue;
      ++sums.points;
      sums.sigma_px += static_cast<double>(sigmas_px[i]);
      sums.sigma_m += static_cast<double>(cloud.sigmas[i]);
      if (!std::isnan(cloud.normals[i].z())) ++sums.normals;
    }
    chunks[begin / kPointsPerChunk] = sums;
  });
  Sums all;
  for (const Sums& chunk : chunks) {
    all.points += chunk.points;
    all.normals += chunk.normals;
    all.sigma_px += chunk.sigma_px;
    all.sigma_m += chunk.sigma_m;
  }
  s.points = all.points;
  s.normals = all.normals;
  if (s.points == 0) return;
  const auto n = static_cast<double>(s.points);
  s.density = n / static_cast<double>(cloud.size());
  s.mean_sigma_px = all.sigma_px / n;
  s.mean_sigma_m = all.sigma_m / n;
}

}  // namespace

StereoProcessor::StereoProcessor(const StereoCalibration& calibration, const StereoOptions& options,
                                 int threads)
    : rectifier_(calibration), options_(options), threads_(threads) {
  validate(options);
  if (threads < 1) {
    throw ConfigurationError("threads = " + std::to_string(threads) + " must be at least 1");
  }
  if (options.matcher.max_disparity_px >= calibration.left.width) {
    throw ConfigurationError(
        "stereo.matcher.max_disparity_px = " + std::to_string(options.matcher.max_disparity_px) +
        " must be below the image's width " + std::to_string(calibration.left.width));
  }
}

RangeTracker StereoProcessor::makeRangeTracker() const {
  const MatcherOptions& m = options_.matcher;
  return RangeTracker(options_.range, {m.min_disparity_px, m.max_disparity_px},
                      m.validation.surface_size_px);
}

Result<StereoProcessor::Output> StereoProcessor::process(const StereoFrame& frame,
                                                         RangeTracker* tracker) const {
  Stopwatch watch;
  Result<RectifiedPair> rectified = rectifier_.rectify(frame, threads_);
  if (!rectified) return rectified.status();
  Output out;
  StereoStatistics& s = out.statistics;
  out.rectified = std::move(rectified).value();
  s.rectify_s = watch.lap();
  out.trouble = inspectRaw(frame);
  if (!out.trouble) out.trouble = inspectBrightness(out.rectified);
  if (out.trouble.hopeless) {
    out.disparity = nothingOf(out.rectified);
  } else {
    out.disparity = search(out.rectified, tracker, s.match);
    const auto pixels = static_cast<double>(s.match.pixels);
    if (static_cast<double>(s.match.valid) < kSuspiciousShare * pixels) {
      const Trouble found = inspectPair(out.rectified, threads_);
      if (found) out.trouble = found;
      if (found.hopeless) out.disparity = nothingOf(out.rectified);
    }
  }
  s.match_s = watch.lap();
  out.cloud =
      triangulate(out.disparity, out.rectified.left_color, calibration(), options_.depth, threads_);
  s.triangulate_s = watch.lap();
  estimateNormals(out.cloud, options_.normals, threads_);
  s.normals_s = watch.lap();
  summarize(out.cloud.cloud, out.disparity, threads_, s);
  return out;
}

DisparityImage StereoProcessor::search(const RectifiedPair& pair, RangeTracker* tracker,
                                       MatchStatistics& statistics) const {
  MatcherOptions options = options_.matcher;
  if (tracker != nullptr) {
    const SearchRange range = tracker->choose(pair, threads_);
    options.min_disparity_px = range.min_px;
    options.max_disparity_px = range.max_px;
  }
  DisparityImage found = match(pair, options, threads_, &statistics);
  if (tracker != nullptr) tracker->update(found.disparity_px);
  return found;
}

Result<View> makeView(int index, const OrganizedCloud& cloud,
                      const Eigen::Isometry3d& T_base_optical,
                      const Eigen::Isometry3d& T_world_base, const ConditioningOptions& options,
                      ConditioningStatistics* statistics) {
  if (!isFinite(T_base_optical) || !isFinite(T_world_base)) {
    return Status(StatusCode::kInvalidInput,
                  "view " + std::to_string(index) + ": pose of the camera is not finite");
  }
  View view;
  view.index = index;
  view.stamp = cloud.stamp;
  view.cloud = transformed(finitePoints(cloud.cloud, true), T_base_optical);
  const Conditioned conditioned = condition(transformed(view.cloud, T_world_base), options);
  if (statistics != nullptr) *statistics = conditioned.statistics;
  if (conditioned.kept.size() < static_cast<std::size_t>(options.min_points)) {
    return Status(StatusCode::kNotEnoughData,
                  "view " + std::to_string(index) + ": " + std::to_string(conditioned.kept.size()) +
                      " of " + std::to_string(conditioned.statistics.points) +
                      " points remain, stereo.conditioning.min_points is " +
                      std::to_string(options.min_points));
  }
  view.cloud = subset(view.cloud, conditioned.kept);
  return view;
}

}  // namespace scanner::stereo
