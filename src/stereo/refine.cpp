#include "stereo/refine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "scanner/core/parallel.h"

namespace scanner::stereo {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr std::size_t kRowsPerChunk = 48;
/// Neighbours this far from the centre's disparity belong to another surface.
constexpr float kSameSurfacePx = 1.5f;
/// The linearisation holds within about this step.
constexpr double kMaxStepPx = 0.5;
/// Part of the window that must hold a disparity.
constexpr double kMinWindowShare = 0.3;
/// Residual variance that noise alone may make, in units of image_noise^2.
constexpr double kNoiseMargin = 3.0;

/// Terms of the normal equations, as sums over a window.
enum Term { kCount, kG, kR, kE, kGG, kGR, kRR, kGE, kRE, kEE, kTerms };
using Sums = std::array<double, kTerms>;

/// Per pixel: gradient, warped right image and difference. weight 0 where undefined.
struct WarpedPixel {
  float weight = 0.0f, g = 0.0f, r = 0.0f, e = 0.0f;
};

inline void accumulate(const WarpedPixel& p, double sign, Sums& s) {
  if (p.weight == 0.0f) return;
  const double g = p.g, r = p.r, e = p.e;
  s[kCount] += sign;
  s[kG] += sign * g;
  s[kR] += sign * r;
  s[kE] += sign * e;
  s[kGG] += sign * (g * g);
  s[kGR] += sign * (g * r);
  s[kRR] += sign * (r * r);
  s[kGE] += sign * (g * e);
  s[kRE] += sign * (r * e);
  s[kEE] += sign * (e * e);
}

/// Mean of the pairs of valid pixels of the same surface that lie opposite each other round (x, y).
float pairMean(const cv::Mat& disparity, int x, int y, int radius) {
  const float centre = disparity.at<float>(y, x);
  float sum = 0.0f;
  int pairs = 0;
  for (int dy = 0; dy <= radius; ++dy) {
    if (y - dy < 0 || y + dy >= disparity.rows) break;
    const float* up = disparity.ptr<float>(y - dy);
    const float* down = disparity.ptr<float>(y + dy);
    for (int dx = dy == 0 ? 1 : -radius; dx <= radius; ++dx) {
      if (x - std::abs(dx) < 0 || x + std::abs(dx) >= disparity.cols) continue;
      const float a = up[x - dx] - centre, b = down[x + dx] - centre;
      // False for NaN as well.
      if (!(std::abs(a + b) <= kSameSurfacePx && std::abs(a - b) <= 4.0f * kSameSurfacePx))
        continue;
      sum += 0.5f * (a + b);
      ++pairs;
    }
  }
  return centre + sum / static_cast<float>(pairs + 1);
}

cv::Mat smoothed(const cv::Mat& disparity, int radius, int threads) {
  cv::Mat out(disparity.size(), CV_32FC1, cv::Scalar(kNan));
  parallelFor(static_cast<std::size_t>(disparity.rows), kRowsPerChunk, threads,
              [&](std::size_t begin, std::size_t end) {
                for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
                  for (int x = 0; x < disparity.cols; ++x) {
                    if (std::isnan(disparity.at<float>(y, x))) continue;
                    out.at<float>(y, x) = pairMean(disparity, x, y, radius);
                  }
                }
              });
  return out;
}

/// Cubic convolution of one row at x, and its derivative.
inline void sampleRow(const float* row, float x, float& value, float& slope) {
  const int x0 = static_cast<int>(x);
  const float t = x - static_cast<float>(x0);
  const float a = row[x0 - 1], b = row[x0], c = row[x0 + 1], d = row[x0 + 2];
  const float c1 = 0.5f * (c - a);
  const float c2 = a - 2.5f * b + 2.0f * c - 0.5f * d;
  const float c3 = 0.5f * (d - a) + 1.5f * (b - c);
  value = b + t * (c1 + t * (c2 + t * c3));
  slope = c1 + t * (2.0f * c2 + t * 3.0f * c3);
}

struct Problem {
  const cv::Mat& left;
  const cv::Mat& right;
  const cv::Mat& right_valid;
  const RefinementOptions& options;
  double max_residual_share;
  int threads;
};

std::vector<WarpedPixel> warp(const Problem& p, const cv::Mat& disparity) {
  const int width = disparity.cols;
  std::vector<WarpedPixel> warped(disparity.total());
  parallelFor(
      static_cast<std::size_t>(disparity.rows), kRowsPerChunk, p.threads,
      [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
          const float* d = disparity.ptr<float>(y);
          const float* l = p.left.ptr<float>(y);
          const float* r = p.right.ptr<float>(y);
          const std::uint8_t* valid =
              p.right_valid.empty() ? nullptr : p.right_valid.ptr<std::uint8_t>(y);
          WarpedPixel* out = warped.data() + static_cast<std::size_t>(y) * disparity.step1();
          for (int x = 1; x + 1 < width; ++x) {
            const float at = static_cast<float>(x) - d[x];
            if (!(at >= 1.0f && at < static_cast<float>(width - 2))) continue;  // NaN too
            const int nearest = static_cast<int>(std::lround(at));
            if (valid != nullptr && valid[nearest] == 0) continue;
            float value = 0.0f, slope = 0.0f;
            sampleRow(r, at, value, slope);
            out[x] = {1.0f, -0.5f * (slope + 0.5f * (l[x + 1] - l[x - 1])), value, l[x] - value};
          }
        }
      });
  return warped;
}

struct Solution {
  double delta = 0.0;              ///< px
  double information = 0.0;        ///< reduced normal matrix, 1 / px^2 at unit noise
  double residual_variance = 0.0;  ///< of L - R after the step, grey levels^2
  double contrast = 0.0;           ///< variance of R
};

/// The window's solution; false when it holds too little.
bool solve(const Sums& s, double min_count, Solution& solution) {
  const double n = s[kCount];
  if (n < min_count) return false;
  double gg = s[kGG] - s[kG] * s[kG] / n;
  double ge = s[kGE] - s[kG] * s[kE] / n;
  double ee = s[kEE] - s[kE] * s[kE] / n;
  const double rr = s[kRR] - s[kR] * s[kR] / n;
  const double gr = s[kGR] - s[kG] * s[kR] / n;
  const double re = s[kRE] - s[kR] * s[kE] / n;
  if (rr > n) {  // a gain is only visible in a window with contrast
    gg -= gr * gr / rr;
    ge -= gr * re / rr;
    ee -= re * re / rr;
  }
  if (!(gg > 1e-6 * n)) return false;
  solution.delta = ge / gg;
  solution.information = gg;
  solution.residual_variance = std::max(0.0, ee - solution.delta * ge) / std::max(1.0, n - 3.0);
  solution.contrast = std::max(0.0, rr) / n;
  return true;
}

/// Rolls the window sums down the rows of one chunk and calls `visit(x, y, sums)` for each pixel.
template <typename Visit>
void forEachWindow(const std::vector<WarpedPixel>& warped, int width, int height, int radius,
                   int y_begin, int y_end, const Visit& visit) {
  std::vector<Sums> columns(static_cast<std::size_t>(width), Sums{});
  const auto add_row = [&](int y, double sign) {
    if (y < 0 || y >= height) return;
    const WarpedPixel* row = warped.data() + static_cast<std::size_t>(y) * columns.size();
    for (std::size_t x = 0; x < columns.size(); ++x) accumulate(row[x], sign, columns[x]);
  };
  for (int y = y_begin - radius; y < y_begin + radius; ++y) add_row(y, 1.0);
  for (int y = y_begin; y < y_end; ++y) {
    add_row(y + radius, 1.0);
    Sums window{};
    const auto add_column = [&](int x, double sign) {
      if (x < 0 || x >= width) return;
      const Sums& c = columns[static_cast<std::size_t>(x)];
      for (std::size_t k = 0; k < kTerms; ++k) window[k] += sign * c[k];
    };
    for (int x = -radius; x < radius; ++x) add_column(x, 1.0);
    for (int x = 0; x < width; ++x) {
      add_column(x + radius, 1.0);
      visit(x, y, window);
      add_column(x - radius, -1.0);
    }
    add_row(y - radius, -1.0);
  }
}

void step(const Problem& p, bool last, cv::Mat& disparity, cv::Mat& sigma) {
  const std::vector<WarpedPixel> warped = warp(p, disparity);
  const int radius = p.options.window_px / 2;
  const double min_count = kMinWindowShare * p.options.window_px * p.options.window_px;
  const double floor2 = p.options.floor_px * p.options.floor_px;
  const double noise2 = p.options.image_noise * p.options.image_noise;
  cv::Mat next(disparity.size(), CV_32FC1, cv::Scalar(kNan));
  const auto solve_pixel = [&](int x, int y, const Sums& sums) {
    const float d = disparity.at<float>(y, x);
    Solution s;
    if (std::isnan(d) || !solve(sums, min_count, s)) return;
    if (last) {
      if (s.residual_variance > kNoiseMargin * noise2 + p.max_residual_share * s.contrast) return;
      const double variance =
          p.options.noise_correlation * std::max(s.residual_variance, noise2) / s.information;
      sigma.at<float>(y, x) = static_cast<float>(std::sqrt(variance + floor2));
    }
    next.at<float>(y, x) = d + static_cast<float>(std::clamp(s.delta, -kMaxStepPx, kMaxStepPx));
  };
  parallelFor(static_cast<std::size_t>(disparity.rows), kRowsPerChunk, p.threads,
              [&](std::size_t begin, std::size_t end) {
                forEachWindow(warped, disparity.cols, disparity.rows, radius,
                              static_cast<int>(begin), static_cast<int>(end), solve_pixel);
              });
  disparity = next;
}

}  // namespace

std::size_t refineByGradient(const cv::Mat& left, const cv::Mat& right, const cv::Mat& right_valid,
                             const RefinementOptions& options, double max_residual_share,
                             int threads, cv::Mat& disparity, cv::Mat& sigma) {
  const Problem problem{left, right, right_valid, options, max_residual_share, threads};
  const cv::Mat start = disparity;
  sigma = cv::Mat(start.size(), CV_32FC1, cv::Scalar(kNan));
  for (int i = 0; i < options.iterations; ++i) {
    disparity = smoothed(disparity, options.smoothing_px / 2, threads);
    step(problem, i + 1 == options.iterations, disparity, sigma);
  }
  disparity = smoothed(disparity, options.final_smoothing_px / 2, threads);
  std::size_t given_up = 0;
  for (int y = 0; y < start.rows; ++y) {
    for (int x = 0; x < start.cols; ++x) {
      const float before = start.at<float>(y, x);
      float& after = disparity.at<float>(y, x);
      if (std::isnan(before)) continue;
      if (std::abs(after - before) <= static_cast<float>(options.max_correction_px)) continue;
      after = kNan;
      sigma.at<float>(y, x) = kNan;
      ++given_up;
    }
  }
  return given_up;
}

}  // namespace scanner::stereo
