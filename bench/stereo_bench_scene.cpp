#include "stereo_bench_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace scanner::bench {
namespace {

/// 0..1, the same for the same arguments.
double hashed(std::uint32_t x, std::uint32_t y, std::uint32_t seed) {
  std::uint32_t h = x * 0x9E3779B1U ^ y * 0x85EBCA77U ^ seed * 0xC2B2AE3DU;
  h = (h ^ (h >> 15U)) * 0x2C1B3C6DU;
  h = (h ^ (h >> 12U)) * 0x297A2D39U;
  return static_cast<double>(h ^ (h >> 15U)) / 4294967295.0;
}

/// Smooth noise of one scale, px.
double noise(double x, double y, double scale, std::uint32_t seed) {
  const double u = x / scale + 4096.0, v = y / scale + 4096.0;
  const auto i = static_cast<std::uint32_t>(u), k = static_cast<std::uint32_t>(v);
  const double a = u - i, b = v - k;
  const double above = (1.0 - a) * hashed(i, k, seed) + a * hashed(i + 1, k, seed);
  const double below = (1.0 - a) * hashed(i, k + 1, seed) + a * hashed(i + 1, k + 1, seed);
  return (1.0 - b) * above + b * below;
}

/// A surface: an ellipse of the left picture (shares of its size), or all of it.
struct Surface {
  double x, y, radius_x, radius_y;  ///< radius_x <= 0: everywhere
  double depth;                     ///< share of the range of disparities
  double slope_x, slope_y;          ///< of that share over the picture
};
/// Nearest first.
constexpr std::array<Surface, 6> kSurfaces{{{0.55, 0.75, 0.10, 0.20, 0.85, 0.05, 0.00},
                                            {0.75, 0.30, 0.12, 0.15, 0.72, 0.00, 0.10},
                                            {0.48, 0.35, 0.16, 0.25, 0.58, 0.15, -0.05},
                                            {0.85, 0.75, 0.14, 0.22, 0.45, -0.10, 0.00},
                                            {0.65, 0.55, 0.30, 0.40, 0.33, 0.05, 0.10},
                                            {0.50, 0.50, 0.00, 0.00, 0.20, 0.08, 0.05}}};

class Scene {
 public:
  Scene(cv::Size size, int low, int high) : size_(size), low_(low), range_(high - low) {}

  double left(int x, int y) const {
    for (std::size_t i = 0; i < kSurfaces.size(); ++i) {
      if (covers(kSurfaces[i], x, y)) return texture(i, x, y);
    }
    return 0.0;
  }
  /// The disparity is linear along a row, so where the ray of a right pixel meets a surface is
  /// known.
  double right(int x, int y) const {
    for (std::size_t i = 0; i < kSurfaces.size(); ++i) {
      const double slope = range_ * kSurfaces[i].slope_x / size_.width;
      const double at = (x + disparity(kSurfaces[i], 0.0, y)) / (1.0 - slope);
      if (covers(kSurfaces[i], at, y)) return texture(i, at, y);
    }
    return 0.0;
  }

 private:
  double disparity(const Surface& s, double x, double y) const {
    return low_ + range_ * (s.depth + s.slope_x * (x / size_.width - s.x) +
                            s.slope_y * (y / size_.height - s.y));
  }
  bool covers(const Surface& s, double x, double y) const {
    if (s.radius_x <= 0.0) return true;
    const double u = (x / size_.width - s.x) / s.radius_x;
    const double v = (y / size_.height - s.y) / s.radius_y;
    return u * u + v * v <= 1.0;
  }
  double texture(std::size_t surface, double x, double y) const {
    const auto seed = static_cast<std::uint32_t>(17 * surface);
    return 40.0 + 90.0 * noise(x, y, 31.0, seed) + 60.0 * noise(x, y, 7.0, seed + 1) +
           40.0 * noise(x, y, 2.5, seed + 2);
  }

  cv::Size size_;
  double low_, range_;
};

}  // namespace

BenchPair makeBenchPair(cv::Size size, int min_disparity_px, int max_disparity_px) {
  const Scene scene(size, min_disparity_px, max_disparity_px);
  BenchPair pair{cv::Mat(size, CV_8UC1), cv::Mat(size, CV_8UC1)};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const auto u = static_cast<std::uint32_t>(x), v = static_cast<std::uint32_t>(y);
      const double grain = 4.0;  // about one grey level of standard deviation
      pair.left.at<std::uint8_t>(y, x) =
          cv::saturate_cast<std::uint8_t>(scene.left(x, y) + grain * (hashed(u, v, 91) - 0.5));
      pair.right.at<std::uint8_t>(y, x) =
          cv::saturate_cast<std::uint8_t>(scene.right(x, y) + grain * (hashed(u, v, 92) - 0.5));
    }
  }
  return pair;
}

}  // namespace scanner::bench
