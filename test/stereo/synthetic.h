#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <random>

#include "scanner/core/camera.h"
#include "scanner/stereo/rectify.h"

/// Synthetic pairs with exact disparity.
namespace scanner::stereo::testing {

/// Smooth random grey, defined at any real coordinate: lattice noise of 4 px under a cubic B-spline
/// (band-limited, so that sampling it is all a camera does).
inline double texture(double x, double y) {
  constexpr double kCell = 4.0;
  const auto lattice = [](std::int64_t i, std::int64_t j) {
    std::uint64_t h = static_cast<std::uint64_t>(i) * 0x9E3779B97F4A7C15ULL ^
                      static_cast<std::uint64_t>(j) * 0xC2B2AE3D27D4EB4FULL;
    h ^= h >> 29;
    h *= 0xBF58476D1CE4E5B9ULL;
    h ^= h >> 32;
    return static_cast<double>(h & 0xFFFFFFU) / 16777215.0 - 0.5;
  };
  const auto weights = [](double t, double w[4]) {
    w[0] = (1 - t) * (1 - t) * (1 - t) / 6;
    w[1] = (3 * t * t * t - 6 * t * t + 4) / 6;
    w[2] = (-3 * t * t * t + 3 * t * t + 3 * t + 1) / 6;
    w[3] = t * t * t / 6;
  };
  const double u = x / kCell, v = y / kCell;
  const double iu = std::floor(u), iv = std::floor(v);
  double wu[4], wv[4], sum = 0.0;
  weights(u - iu, wu);
  weights(v - iv, wv);
  for (int j = 0; j < 4; ++j) {
    for (int i = 0; i < 4; ++i) {
      sum += wu[i] * wv[j] *
             lattice(static_cast<std::int64_t>(iu) + i, static_cast<std::int64_t>(iv) + j);
    }
  }
  return 120.0 + 240.0 * sum;
}

/// Disparity of the left pixel (x, y): d = d0 + a x + b y.
struct DisparityPlane {
  double d0 = 0.0, a = 0.0, b = 0.0;
  double at(double x, double y) const { return d0 + a * x + b * y; }
  /// Left x of the point seen at right x.
  double leftX(double right_x, double y) const { return (right_x + d0 + b * y) / (1.0 - a); }
};

struct PairNoise {
  double sigma = 0.0;  ///< grey levels, each eye
  double gain = 1.0;   ///< of the right eye
  double offset = 0.0;
};

inline std::uint8_t toGray(double value) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
}

/// A textured plane seen by a rectified pair.
inline RectifiedPair makePair(int width, int height, const DisparityPlane& plane,
                              const PairNoise& noise = {}) {
  std::mt19937_64 generator(7);
  std::normal_distribution<double> normal(0.0, 1.0);
  RectifiedPair pair;
  pair.stamp = fromNanoseconds(42);
  pair.left_gray.create(height, width, CV_8UC1);
  pair.right_gray.create(height, width, CV_8UC1);
  pair.left_color.create(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double left = texture(x, y) + noise.sigma * normal(generator);
      const double right = noise.gain * texture(plane.leftX(x, y), y) + noise.offset +
                           noise.sigma * normal(generator);
      pair.left_gray.at<std::uint8_t>(y, x) = toGray(left);
      pair.right_gray.at<std::uint8_t>(y, x) = toGray(right);
      pair.left_color.at<cv::Vec3b>(y, x) = cv::Vec3b(10, 20, static_cast<std::uint8_t>(x % 256));
    }
  }
  return pair;
}

/// An ideal pair: no distortion, no rotation.
inline StereoCalibration idealCalibration(int width, int height, double focal_px,
                                          double baseline_m) {
  StereoCalibration c;
  for (CameraModel* camera : {&c.left, &c.right}) {
    camera->width = width;
    camera->height = height;
    camera->K << focal_px, 0, width / 2.0 - 0.5, 0, focal_px, height / 2.0 - 0.5, 0, 0, 1;
    camera->P.leftCols<3>() = camera->K;
  }
  c.right.P(0, 3) = -focal_px * baseline_m;
  return c;
}

inline bool sameBytes(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != b.type()) return false;
  return std::equal(a.datastart, a.dataend, b.datastart, b.dataend);
}

}  // namespace scanner::stereo::testing
