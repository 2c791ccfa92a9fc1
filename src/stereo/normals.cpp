#include "scanner/stereo/normals.h"

#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "scanner/core/parallel.h"
#include "stereo/normals_simd.h"

namespace scanner::stereo {
namespace {

constexpr std::size_t kRowsPerChunk = 32;
static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float), "the kernels read packed points");

/// The rows of points round one row, taken apart; each is read from the cloud once per chunk.
class RowRing {
 public:
  RowRing(const OrganizedCloud& cloud, int radius)
      : cloud_(cloud),
        radius_(radius),
        slots_(2 * static_cast<std::size_t>(radius) + 1),
        stride_(static_cast<std::size_t>(cloud.width) + simd::kNormalPadding +
                simd::kNormalOverrun),
        storage_((4 * slots_ + 1) * stride_, 0.0f),
        window_(slots_) {}

  /// The rows v - radius .. v + radius. Call with v ascending by one.
  const simd::PointPlanes* around(int v) {
    if (next_ < v - radius_) next_ = v - radius_;
    for (; next_ <= v + radius_; ++next_) load(next_);
    for (int k = 0; k <= 2 * radius_; ++k) {
      window_[static_cast<std::size_t>(k)] = planes(v - radius_ + k);
    }
    return window_.data();
  }

 private:
  bool inside(int v) const { return v >= 0 && v < cloud_.height; }

  simd::PointPlanes planes(int v) {
    float* none = storage_.data() + 4 * slots_ * stride_ + simd::kNormalPadding;
    if (!inside(v)) return {none, none, none, none};
    const std::size_t slot = static_cast<std::size_t>(v) % slots_;
    float* x = storage_.data() + 4 * slot * stride_ + simd::kNormalPadding;
    return {x, x + stride_, x + 2 * stride_, x + 3 * stride_};
  }

  void load(int v) {
    if (!inside(v)) return;
    const auto width = static_cast<std::size_t>(cloud_.width);
    simd::splitPoints(cloud_.cloud.points[static_cast<std::size_t>(v) * width].data(), width,
                      planes(v));
  }

  const OrganizedCloud& cloud_;
  int radius_;
  std::size_t slots_, stride_;
  std::vector<float> storage_;
  std::vector<simd::PointPlanes> window_;
  int next_ = std::numeric_limits<int>::min();
};

}  // namespace

void estimateNormals(OrganizedCloud& cloud, const NormalOptions& options, int threads) {
  validate(options);
  const auto width = static_cast<std::size_t>(cloud.width);
  const auto height = static_cast<std::size_t>(cloud.height);
  if (cloud.cloud.points.size() != width * height) {
    throw std::invalid_argument("estimateNormals: cloud is not organised");
  }
  const int radius = options.window_px / 2;
  if (radius > simd::kMaxNormalRadius) {
    throw ConfigurationError("stereo.normals.window_px = " + std::to_string(options.window_px) +
                             " must be at most " + std::to_string(2 * simd::kMaxNormalRadius + 1));
  }
  std::vector<Eigen::Vector3f> normals(width * height);
  parallelFor(width == 0 ? 0 : height, kRowsPerChunk, threads,
              [&](std::size_t begin, std::size_t end) {
                RowRing ring(cloud, radius);
                simd::NormalRow row;
                row.radius = radius;
                row.min_points = static_cast<float>(options.min_points);
                row.max_step_ratio = static_cast<float>(options.max_step_ratio);
                row.max_step_sigmas = static_cast<float>(options.max_step_sigmas);
                for (std::size_t v = begin; v < end; ++v) {
                  row.rows = ring.around(static_cast<int>(v));
                  if (cloud.cloud.hasSigmas()) row.sigma = &cloud.cloud.sigmas[v * width];
                  row.normals = normals[v * width].data();
                  simd::normalRow(row, width);
                }
              });
  cloud.cloud.normals = std::move(normals);
}

}  // namespace scanner::stereo
