#include "stereo/refine.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "scanner/core/parallel.h"
#include "stereo/refine_simd.h"

namespace scanner::stereo {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr std::size_t kRowsPerChunk = 48;
/// The linearisation holds within about this step.
constexpr float kMaxStepPx = 0.5f;
/// Part of the window that must hold a disparity.
constexpr double kMinWindowShare = 0.3;
/// Residual variance that noise alone may make, in units of image_noise^2.
constexpr double kNoiseMargin = 3.0;
/// Taken off the grey levels: sums of products stay small enough for single precision.
constexpr float kMiddleGray = 128.0f;
/// The widest vector that a kernel writes past the end of a row.
constexpr int kMaxLanes = 16;

/// Rows of floats with room on both sides for the kernels. The room and every row outside hold
/// `fill`; what is inside must be written before it is read.
class Plane {
 public:
  Plane(int width, int height, float fill)
      : width_(width),
        height_(height),
        fill_(fill),
        stride_(static_cast<std::size_t>((width + kMaxLanes - 1) / kMaxLanes * kMaxLanes +
                                         2 * simd::kRowPad)),
        data_(new float[stride_ * static_cast<std::size_t>(height + 1)]) {
    for (int y = 0; y < height; ++y) {
      float* start = row(y);
      std::fill(start - simd::kRowPad, start, fill);
      std::fill(start + width, start - simd::kRowPad + stride_, fill);
    }
    std::fill_n(row(height) - simd::kRowPad, stride_, fill);
  }
  int width() const { return width_; }
  int height() const { return height_; }
  float* row(int y) { return data_.get() + offset(y); }
  const float* row(int y) const { return data_.get() + offset(y); }
  /// To be called after a kernel has written row y: it may have written past the end.
  void close(int y) { std::fill_n(row(y) + width_, kMaxLanes, fill_); }

 private:
  std::size_t offset(int y) const {
    const int at = y < 0 || y >= height_ ? height_ : y;
    return static_cast<std::size_t>(at) * stride_ + simd::kRowPad;
  }
  int width_, height_;
  float fill_;
  std::size_t stride_;
  std::unique_ptr<float[]> data_;  // NOLINT(modernize-avoid-c-arrays): a vector would be filled
};

template <typename Visit>
void eachRow(int height, int threads, const Visit& visit) {
  parallelFor(static_cast<std::size_t>(height), kRowsPerChunk, threads,
              [&](std::size_t begin, std::size_t end) {
                for (std::size_t y = begin; y < end; ++y) visit(static_cast<int>(y));
              });
}

/// The rows of a window that moves down the image, `terms` floats a pixel.
class RowRing {
 public:
  RowRing(int width, int terms, int window, float fill)
      : terms_(terms),
        window_(window),
        plane_(width, terms * window, fill),
        pointers_(static_cast<std::size_t>(terms)),
        rows_(static_cast<std::size_t>(terms) * static_cast<std::size_t>(window)) {}

  /// Where the terms of image row y go.
  float* const* slot(int y) {
    for (int k = 0; k < terms_; ++k) {
      pointers_[static_cast<std::size_t>(k)] = plane_.row(index(k, y));
    }
    return pointers_.data();
  }
  void close(int y) {
    for (int k = 0; k < terms_; ++k) plane_.close(index(k, y));
  }
  /// The rows of the window centred on y, term by term, from the top.
  const float* const* around(int y) {
    std::size_t next = 0;
    for (int k = 0; k < terms_; ++k) {
      for (int i = 0; i < window_; ++i) {
        rows_[next++] = plane_.row(index(k, y - window_ / 2 + i));
      }
    }
    return rows_.data();
  }

 private:
  int index(int term, int y) const { return term * window_ + (y + window_) % window_; }
  int terms_, window_;
  Plane plane_;
  std::vector<float*> pointers_;
  std::vector<const float*> rows_;
};

/// Fills a ring row by row, so that `visit(y)` finds the window of each row of a chunk in it.
template <typename Fill, typename Visit>
void forEachRow(int height, int window, int threads, const Fill& fill, const Visit& visit) {
  parallelFor(static_cast<std::size_t>(height), kRowsPerChunk, threads,
              [&](std::size_t chunk_begin, std::size_t chunk_end) {
                const int begin = static_cast<int>(chunk_begin), end = static_cast<int>(chunk_end);
                auto state = fill.make();
                for (int y = begin - window / 2; y < begin + window / 2; ++y) fill(state, y);
                for (int y = begin; y < end; ++y) {
                  fill(state, y + window / 2);
                  visit(state, y);
                }
              });
}

/// Sums of a window that moves down the image.
struct WindowSums {
  WindowSums(int width, int term_count, int window_px)
      : terms(term_count),
        window(window_px),
        ring(width, term_count, window_px, 0.0f),
        sums(width, term_count, 0.0f),
        pointers(static_cast<std::size_t>(term_count)) {
    for (int k = 0; k < terms; ++k) pointers[static_cast<std::size_t>(k)] = sums.row(k);
  }
  const float* const* at(int y) {
    simd::sumAcross(ring.around(y), terms, window, sums.width(), pointers.data());
    for (int k = 0; k < terms; ++k) sums.close(k);
    return pointers.data();
  }
  int terms, window;
  RowRing ring;
  Plane sums;
  std::vector<float*> pointers;
};

struct SmoothFill {
  const Plane& in;
  int radius;
  RowRing make() const { return {in.width(), 1, 2 * radius + 1, kNan}; }
  void operator()(RowRing& ring, int y) const {
    simd::smoothAlong(in.row(y), in.width(), radius, *ring.slot(y));
  }
};

void smooth(const Plane& in, int window, int threads, Plane& out) {
  if (window <= 1) {
    eachRow(in.height(), threads, [&](int y) { std::copy_n(in.row(y), in.width(), out.row(y)); });
    return;
  }
  const SmoothFill fill{in, window / 2};
  forEachRow(in.height(), window, threads, fill, [&](RowRing& ring, int y) {
    simd::smoothAcross(ring.around(y), in.width(), window / 2, out.row(y));
    out.close(y);
  });
}

struct WarpFill {
  const Plane& disparity;
  const Plane& left;
  const Plane& right;
  int window;
  WindowSums make() const { return {left.width(), simd::kRefineTerms, window}; }
  void operator()(WindowSums& state, int y) const {
    simd::warpRow(disparity.row(y), left.row(y), right.row(y), left.width(), state.ring.slot(y));
    state.ring.close(y);
  }
};

struct RoughnessFill {
  const Plane& step;
  const Plane& before;
  const Plane& after;
  int window;
  WindowSums make() const { return {step.width(), simd::kRoughnessTerms, window}; }
  void operator()(WindowSums& state, int y) const {
    simd::roughnessRow(step.row(y), before.row(y), after.row(y), step.width(), state.ring.slot(y));
    state.ring.close(y);
  }
};

/// Grey levels for the kernels; NaN where the mask (may be empty) is 0.
Plane grayPlane(const cv::Mat& image, const cv::Mat& mask, int threads) {
  Plane out(image.cols, image.rows, kNan);
  eachRow(image.rows, threads, [&](int y) {
    const float* from = image.ptr<float>(y);
    float* to = out.row(y);
    for (int x = 0; x < image.cols; ++x) to[x] = from[x] - kMiddleGray;
    if (mask.empty()) return;
    const std::uint8_t* valid = mask.ptr<std::uint8_t>(y);
    for (int x = 0; x < image.cols; ++x) to[x] = valid[x] != 0 ? to[x] : kNan;
  });
  return out;
}

Plane disparityPlane(const cv::Mat& disparity, int threads) {
  Plane out(disparity.cols, disparity.rows, kNan);
  eachRow(disparity.rows, threads,
          [&](int y) { std::copy_n(disparity.ptr<float>(y), disparity.cols, out.row(y)); });
  return out;
}

struct Precision {
  Plane variance, step;
};

/// One least-squares step of every pixel; the last one tells how good it is.
void step(const WarpFill& warp, const RefinementOptions& o, double max_residual_share, int threads,
          Precision* precision, Plane& next) {
  const double noise_variance = o.image_noise * o.image_noise;
  forEachRow(next.height(), o.window_px, threads, warp, [&](WindowSums& state, int y) {
    simd::SolveRow row;
    row.sums = state.at(y);
    row.disparity = warp.disparity.row(y);
    row.width = next.width();
    row.window = o.window_px;
    row.min_count = static_cast<float>(kMinWindowShare * o.window_px * o.window_px);
    row.max_step = kMaxStepPx;
    row.noise_variance = static_cast<float>(noise_variance);
    row.max_residual = static_cast<float>(kNoiseMargin * noise_variance);
    // Finite, so that a window without contrast does not make NaN of it.
    row.max_residual_share = static_cast<float>(std::min(max_residual_share, 1e6));
    row.next = next.row(y);
    if (precision != nullptr) {
      row.variance = precision->variance.row(y);
      row.step = precision->step.row(y);
    }
    simd::solveRow(row);
    next.close(y);
    if (precision == nullptr) return;
    precision->variance.close(y);
    precision->step.close(y);
  });
}

/// Result and sigma from the last step (`solved`), its smoothed copy and the start.
void finish(const RoughnessFill& roughness, const Precision& precision, const Plane& start,
            const RefinementOptions& o, int threads, cv::Mat& disparity, cv::Mat& sigma) {
  const int width = start.width();
  forEachRow(start.height(), o.window_px, threads, roughness, [&](WindowSums& state, int y) {
    Plane out(width, 2, kNan);
    simd::FinishRow row;
    row.sums = state.at(y);
    row.variance = precision.variance.row(y);
    row.start = start.row(y);
    row.refined = roughness.after.row(y);
    row.width = width;
    row.window = o.window_px;
    row.noise_gain = static_cast<float>(o.noise_gain);
    row.step_gain = static_cast<float>(o.step_gain);
    row.roughness_gain = static_cast<float>(o.roughness_gain);
    row.floor_variance = static_cast<float>(o.floor_px * o.floor_px);
    row.inverse_tail = static_cast<float>(1.0 / (o.tail_px * o.tail_px));
    row.max_correction = static_cast<float>(o.max_correction_px);
    row.disparity = out.row(0);
    row.sigma = out.row(1);
    simd::finishRow(row);
    std::copy_n(out.row(0), width, disparity.ptr<float>(y));
    std::copy_n(out.row(1), width, sigma.ptr<float>(y));
  });
}

std::size_t countDisparities(const cv::Mat& disparity) {
  return static_cast<std::size_t>(cv::countNonZero(disparity == disparity));
}

}  // namespace

std::size_t refineByGradient(const cv::Mat& left, const cv::Mat& right, const cv::Mat& right_valid,
                             const RefinementOptions& options, double max_residual_share,
                             int threads, cv::Mat& disparity, cv::Mat& sigma) {
  const int width = disparity.cols, height = disparity.rows;
  const Plane left_gray = grayPlane(left, {}, threads);
  const Plane right_gray = grayPlane(right, right_valid, threads);
  const Plane start = disparityPlane(disparity, threads);
  Plane solved(width, height, kNan), smoothed(width, height, kNan);
  Precision precision{Plane(width, height, kNan), Plane(width, height, kNan)};
  const WarpFill warp{smoothed, left_gray, right_gray, options.window_px};
  for (int i = 0; i < options.iterations; ++i) {
    smooth(i == 0 ? start : solved, options.smoothing_px, threads, smoothed);
    step(warp, options, max_residual_share, threads,
         i + 1 == options.iterations ? &precision : nullptr, solved);
  }
  smooth(solved, options.final_smoothing_px, threads, smoothed);
  const std::size_t before = countDisparities(disparity);
  disparity = cv::Mat(height, width, CV_32FC1);
  sigma = cv::Mat(height, width, CV_32FC1);
  finish({precision.step, solved, smoothed, options.window_px}, precision, start, options, threads,
         disparity, sigma);
  return before - countDisparities(disparity);
}

}  // namespace scanner::stereo
