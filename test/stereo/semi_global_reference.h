#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "stereo/matcher.h"
#include "stereo/semi_global_strip.h"

/// Semi-global matching in the plainest way, one strip after the other, all costs at once.
namespace scanner::stereo::testing {

/// Costs or sums of a strip: [row][column][disparity].
struct Volume {
  int rows, columns, count;
  std::vector<int> cells;
  Volume(int r, int c, int n, int value)
      : rows(r), columns(c), count(n), cells(static_cast<std::size_t>(r * c * n), value) {}
  int* at(int y, int x) { return &cells[static_cast<std::size_t>((y * columns + x) * count)]; }
};

class PlainSemiGlobal {
 public:
  PlainSemiGlobal(const cv::Mat& left, const cv::Mat& right, DisparitySearch search,
                  const MatcherOptions& options)
      : left_(left), right_(right), search_(search), options_(options) {
    left.convertTo(half_left_, CV_8U, 0.5);
    right.convertTo(half_right_, CV_8U, 0.5);
    slope_left_ = slope(left);
    slope_right_ = slope(right);
  }

  Candidates run() {
    Candidates out;
    out.left.create(left_.size(), CV_32FC1);
    out.right.create(left_.size(), CV_16SC1);
    const int rows = stripRows(makeLayout(left_.cols, search_), left_.rows, options_.semi_global);
    for (int y = 0; y < left_.rows; y += rows) strip(y, std::min(left_.rows, y + rows), out);
    return out;
  }

 private:
  static constexpr int kMissing = 255;
  static constexpr int kOutside = 15;
  static constexpr int kWarmUp = 32;

  static cv::Mat slope(const cv::Mat& image) {
    cv::Mat gradient, out;
    cv::Sobel(image, gradient, CV_16S, 1, 0);
    gradient.convertTo(out, CV_8U, 0.25, 128.0);
    return out;
  }

  static int clamped(const cv::Mat& image, int y, int x) {
    return image.at<std::uint8_t>(std::clamp(y, 0, image.rows - 1),
                                  std::clamp(x, 0, image.cols - 1));
  }

  int cost(int y, int x, int d) const {
    const int other = x - d, r = options_.semi_global.window_px / 2;
    if (other < 0) return kOutside;
    int sum = 0;
    for (int dy = -r; dy <= r; ++dy) {
      for (int dx = -r; dx <= r; ++dx) {
        const bool a = clamped(left_, y + dy, x + dx) < clamped(left_, y, x);
        const bool b = clamped(right_, y + dy, other + dx) < clamped(right_, y, other);
        sum += a != b ? 1 : 0;
      }
    }
    const auto cut = [&](const cv::Mat& l, const cv::Mat& g, int limit) {
      return std::min(limit, std::abs(clamped(l, y, x) - clamped(g, y, other)));
    };
    return sum + cut(half_left_, half_right_, options_.semi_global.gray_limit) +
           cut(slope_left_, slope_right_, options_.semi_global.gradient_limit);
  }

  int largeStep(int y, int x, int y0, int x0) const {
    const SemiGlobalOptions& o = options_.semi_global;
    const int change = std::abs(clamped(left_, y, x) - clamped(left_, y0, x0));
    return std::max(o.large_step_penalty - o.large_step_penalty * change / o.edge_contrast,
                    std::min(o.edge_step_penalty, o.large_step_penalty));
  }

  /// Adds the paths in direction (dy, dx) over rows [top, bottom) of the image to `sums`.
  void addPaths(int top, int bottom, int dy, int dx, Volume& costs, Volume& sums) const {
    const int n = search_.count(), small = options_.semi_global.small_step_penalty;
    Volume paths(bottom - top, left_.cols, n, kMissing);
    for (int i = 0; i < bottom - top; ++i) {
      const int y = dy >= 0 ? i : bottom - top - 1 - i;
      for (int j = 0; j < left_.cols; ++j) {
        const int x = dx >= 0 ? j : left_.cols - 1 - j;
        const int y0 = y - dy, x0 = x - dx;
        const bool inside = y0 >= 0 && y0 < bottom - top && x0 >= 0 && x0 < left_.cols;
        for (int d = 0; d < n; ++d) {
          int step = 0;
          if (inside) {
            const int* before = paths.at(y0, x0);
            const int least = *std::min_element(before, before + n);
            int best = std::min(before[d], least + largeStep(top + y, x, top + y0, x0));
            if (d > 0) best = std::min(best, before[d - 1] + small);
            if (d + 1 < n) best = std::min(best, before[d + 1] + small);
            step = std::min(best, kMissing) - least;
          }
          paths.at(y, x)[d] = std::min(kMissing, costs.at(y, x)[d] + step);
          sums.at(y, x)[d] += paths.at(y, x)[d];
        }
      }
    }
  }

  void strip(int begin, int end, Candidates& out) const {
    const bool eight = options_.semi_global.paths == SemiGlobalPaths::kEight;
    const int top = std::max(0, begin - kWarmUp);
    const int bottom = eight ? std::min(left_.rows, end + kWarmUp) : end;
    const int n = search_.count();
    Volume costs(bottom - top, left_.cols, n, 0), sums(bottom - top, left_.cols, n, 0);
    for (int y = top; y < bottom; ++y) {
      for (int x = 0; x < left_.cols; ++x) {
        for (int d = 0; d < n; ++d) costs.at(y - top, x)[d] = cost(y, x, search_.min_px + d);
      }
    }
    const int directions[8][2] = {{0, 1},  {0, -1}, {1, 0},  {1, 1},
                                  {1, -1}, {-1, 0}, {-1, 1}, {-1, -1}};
    const int paths = eight ? 8 : 5;
    for (int p = 0; p < paths; ++p) {
      addPaths(top, bottom, directions[p][0], directions[p][1], costs, sums);
    }
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < left_.cols; ++x) selectLeft(sums.at(y - top, x), paths, y, x, out);
      for (int x = 0; x < left_.cols; ++x) selectRight(sums, y - top, paths, y, x, out);
    }
  }

  void selectLeft(const int* sums, int paths, int y, int x, Candidates& out) const {
    const int n = search_.count(), nothing = paths * kMissing;
    float& result = out.left.at<float>(y, x);
    result = std::numeric_limits<float>::quiet_NaN();
    const int best = static_cast<int>(std::min_element(sums, sums + n) - sums);
    const int least = sums[best];
    if (least >= nothing || search_.min_px + best > x) return;
    if (options_.validation.uniqueness) {
      const int percent = static_cast<int>(std::lround(options_.validation.uniqueness_percent));
      for (int d = 0; d < n; ++d) {
        if (std::abs(d - best) <= 1 || sums[d] >= nothing) continue;
        if (sums[d] <= least * (100 + percent) / 100) {
          ++out.ambiguous;
          return;
        }
      }
    }
    const int before = best > 0 ? sums[best - 1] : nothing;
    const bool last = best + 1 == n || search_.min_px + best == x;
    const int after = last ? nothing : sums[best + 1];
    const int highest = std::max(before, after);
    float fraction = 0.0F;
    if (highest < nothing && highest > least) {
      fraction = static_cast<float>(before - after) / static_cast<float>(2 * (highest - least));
    }
    result = static_cast<float>(search_.min_px + best) + fraction;
  }

  /// Of equal sums the one of the largest disparity.
  void selectRight(Volume& sums, int row, int paths, int y, int x, Candidates& out) const {
    short& result = out.right.at<short>(y, x);
    result = kNoDisparity;
    int least = paths * kMissing;
    for (int d = search_.count() - 1; d >= 0; --d) {
      const int from = x + search_.min_px + d;
      if (from >= left_.cols || sums.at(row, from)[d] >= least) continue;
      least = sums.at(row, from)[d];
      result = static_cast<short>(search_.min_px + d);
    }
  }

  cv::Mat left_, right_, half_left_, half_right_, slope_left_, slope_right_;
  DisparitySearch search_;
  MatcherOptions options_;
};

inline Candidates plainSemiGlobal(const cv::Mat& left, const cv::Mat& right, DisparitySearch search,
                                  const MatcherOptions& options) {
  return PlainSemiGlobal(left, right, search, options).run();
}

}  // namespace scanner::stereo::testing
