#include "stereo/validate.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace scanner::stereo {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

/// Calls keep(x, y, disparity) on each pixel that has one and removes it on false.
template <typename Keep>
std::size_t removeUnless(cv::Mat& disparity, const Keep& keep) {
  std::size_t removed = 0;
  for (int y = 0; y < disparity.rows; ++y) {
    float* row = disparity.ptr<float>(y);
    for (int x = 0; x < disparity.cols; ++x) {
      if (std::isnan(row[x]) || keep(x, y, row[x])) continue;
      row[x] = kNan;
      ++removed;
    }
  }
  return removed;
}

}  // namespace

std::size_t removeOutside(double min_disparity, double max_disparity, int margin,
                          const cv::Mat& left_valid, const cv::Mat& right_valid,
                          cv::Mat& disparity) {
  const int last = disparity.cols - 1 - margin;
  return removeUnless(disparity, [&](int x, int y, float d) {
    if (d < min_disparity || d > max_disparity) return false;
    const int at = static_cast<int>(std::lround(static_cast<float>(x) - d));
    if (at < margin || at > last) return false;
    if (!left_valid.empty() && left_valid.at<std::uint8_t>(y, x) == 0) return false;
    return right_valid.empty() || right_valid.at<std::uint8_t>(y, at) != 0;
  });
}

std::size_t removeInconsistent(const cv::Mat& right_disparity, double tolerance,
                               cv::Mat& disparity) {
  return removeUnless(disparity, [&](int x, int y, float d) {
    const int at = static_cast<int>(std::lround(static_cast<float>(x) - d));
    if (at < 0 || at >= right_disparity.cols) return false;
    return std::abs(right_disparity.at<float>(y, at) - d) <= tolerance;  // false for NaN
  });
}

std::size_t removeImprecise(const cv::Mat& sigma, double max_sigma, cv::Mat& disparity) {
  return removeUnless(disparity,
                      [&](int x, int y, float) { return sigma.at<float>(y, x) <= max_sigma; });
}

std::size_t removeSmallSurfaces(double max_step, int min_size, cv::Mat& disparity) {
  const int width = disparity.cols, height = disparity.rows;
  const float step = static_cast<float>(max_step);
  std::vector<std::uint8_t> seen(disparity.total(), 0);
  std::vector<int> region;
  std::size_t removed = 0;
  float* const d = disparity.ptr<float>();
  for (int start = 0; start < width * height; ++start) {
    if (seen[static_cast<std::size_t>(start)] != 0 || std::isnan(d[start])) continue;
    region.assign(1, start);
    seen[static_cast<std::size_t>(start)] = 1;
    for (std::size_t i = 0; i < region.size(); ++i) {  // grows while it is read
      const int at = region[i], x = at % width;
      const std::array<int, 4> next{x > 0 ? at - 1 : -1, x + 1 < width ? at + 1 : -1, at - width,
                                    at + width < width * height ? at + width : -1};
      for (const int n : next) {
        if (n < 0 || seen[static_cast<std::size_t>(n)] != 0) continue;
        if (!(std::abs(d[n] - d[at]) <= step)) continue;  // NaN too
        seen[static_cast<std::size_t>(n)] = 1;
        region.push_back(n);
      }
    }
    if (static_cast<int>(region.size()) >= min_size) continue;
    removed += region.size();
    for (const int at : region) d[at] = kNan;
  }
  return removed;
}

}  // namespace scanner::stereo
