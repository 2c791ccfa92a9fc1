#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "scanner/stereo/options.h"
#include "stereo/synthetic.h"

/// Scenes for the refinement, and the refinement in plain double precision.
namespace scanner::stereo::testing {

using Shape = std::function<double(double x, double y)>;

/// Grey levels as they are (no rounding), the exact disparity, and a start as a matcher gives it:
/// some tenths of a pixel off, pulled towards whole pixels.
struct Scene {
  cv::Mat left, right, truth, start;
};

/// Noise of a Bayer camera after the binomial that makes grey of the mosaic (Rectifier).
inline cv::Mat cameraNoise(int width, int height, double sigma, std::mt19937_64& generator) {
  std::normal_distribution<double> normal(0.0, sigma);
  cv::Mat noise(height, width, CV_32FC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) noise.at<float>(y, x) = static_cast<float>(normal(generator));
  }
  cv::GaussianBlur(noise, noise, cv::Size(3, 3), 0.0);
  // Its standard deviation is 6/16 of what it was.
  return noise * (16.0 / 6.0);
}

/// `noise`: grey levels, each eye. The shape may not hide parts of itself.
inline Scene makeScene(int width, int height, const Shape& shape, double noise = 0.0) {
  std::mt19937_64 generator(11);
  std::normal_distribution<double> normal(0.0, 1.0);
  Scene scene;
  for (cv::Mat* m : {&scene.left, &scene.right, &scene.truth, &scene.start}) {
    m->create(height, width, CV_32FC1);
  }
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double d = shape(x, y);
      double left_x = x + d;  // of the point that right pixel x shows
      for (int i = 0; i < 50; ++i) left_x = x + shape(left_x, y);
      scene.left.at<float>(y, x) = static_cast<float>(texture(x, y));
      scene.right.at<float>(y, x) = static_cast<float>(texture(left_x, y));
      scene.truth.at<float>(y, x) = static_cast<float>(d);
      const double pulled = d - 0.08 * std::sin(2.0 * CV_PI * d) + 0.1 * normal(generator);
      scene.start.at<float>(y, x) = static_cast<float>(pulled);
    }
  }
  if (noise > 0.0) {
    scene.left += cameraNoise(width, height, noise, generator);
    scene.right += cameraNoise(width, height, noise, generator);
  }
  return scene;
}

/// The formulas of refine.h, pixel by pixel, without the tests that give pixels up.
class Reference {
 public:
  Reference(const Scene& scene, const RefinementOptions& options) : s_(scene), o_(options) {}

  void run(cv::Mat& disparity, cv::Mat& sigma) const {
    cv::Mat solved, variance, steps;
    s_.start.convertTo(solved, CV_64F);
    for (int i = 0; i < o_.iterations; ++i) {
      const cv::Mat from = smooth(solved, o_.smoothing_px / 2);
      step(from, solved, variance, steps);
    }
    disparity = smooth(solved, o_.final_smoothing_px / 2);
    sigma = cv::Mat(disparity.size(), CV_64F, cv::Scalar(NAN));
    for (int y = 0; y < sigma.rows; ++y) {
      for (int x = 0; x < sigma.cols; ++x) {
        double n = 0.0, step2 = 0.0, change2 = 0.0;
        window(y, x, [&](int v, int u) {
          const double moved = steps.at<double>(v, u);
          const double change = disparity.at<double>(v, u) - solved.at<double>(v, u);
          if (std::isnan(moved) || std::isnan(change)) return;
          n += 1.0;
          step2 += moved * moved;
          change2 += change * change;
        });
        const double fitted =
            o_.noise_gain * variance.at<double>(y, x) +
            (o_.step_gain * step2 + o_.roughness_gain * change2) / std::max(n, 1.0) +
            o_.floor_px * o_.floor_px;
        sigma.at<double>(y, x) = std::sqrt(fitted * (1.0 + fitted / (o_.tail_px * o_.tail_px)));
      }
    }
  }

 private:
  template <typename Visit>
  void window(int y, int x, const Visit& visit) const {
    const int r = o_.window_px / 2;
    for (int v = std::max(0, y - r); v <= std::min(s_.left.rows - 1, y + r); ++v) {
      for (int u = std::max(0, x - r); u <= std::min(s_.left.cols - 1, x + r); ++u) visit(v, u);
    }
  }

  static cv::Mat smooth(const cv::Mat& in, int radius) {
    return smoothLine(smoothLine(in, radius, 0, 1), radius, 1, 0);
  }

  static cv::Mat smoothLine(const cv::Mat& in, int radius, int dy, int dx) {
    cv::Mat out = in.clone();
    const cv::Rect inside(0, 0, in.cols, in.rows);
    for (int y = 0; y < in.rows; ++y) {
      for (int x = 0; x < in.cols; ++x) {
        const double centre = in.at<double>(y, x);
        double sum = 0.0, pairs = 0.0;
        for (int k = 1; k <= radius; ++k) {
          const cv::Point a(x - k * dx, y - k * dy), b(x + k * dx, y + k * dy);
          if (!inside.contains(a) || !inside.contains(b)) continue;
          const double before = in.at<double>(a), after = in.at<double>(b);
          const double bend = before + after - 2.0 * centre;
          if (!(std::abs(bend) <= 2.0 && std::abs(before - after) <= 6.0)) continue;
          sum += bend;
          pairs += 1.0;
        }
        out.at<double>(y, x) = centre + sum / (2.0 * pairs + 2.0);
      }
    }
    return out;
  }

  /// Gradient, right grey and difference; false where the match lies outside.
  bool warp(const cv::Mat& d, int y, int x, cv::Vec3d& out) const {
    const double at = x - d.at<double>(y, x);
    const int width = d.cols;
    if (!(at >= 1.0 && at < width - 2 && x >= 2 && x < width - 2)) return false;
    const int x0 = static_cast<int>(at);
    const double t = at - x0;
    double p[4];
    for (int i = 0; i < 4; ++i) p[i] = static_cast<double>(s_.right.at<float>(y, x0 - 1 + i));
    const double c1 = 0.5 * (p[2] - p[0]), c2 = p[0] - 2.5 * p[1] + 2.0 * p[2] - 0.5 * p[3];
    const double c3 = 0.5 * (p[3] - p[0]) + 1.5 * (p[1] - p[2]);
    const double value = p[1] + t * (c1 + t * (c2 + t * c3));
    const auto left = [&](int u) { return static_cast<double>(s_.left.at<float>(y, u)); };
    const double left_slope =
        (left(x + 1) - left(x - 1)) * 2.0 / 3.0 - (left(x + 2) - left(x - 2)) / 12.0;
    const double rise = d.at<double>(y, x + 1) - d.at<double>(y, x - 1);
    const double stretch = std::abs(rise) <= 1.4 ? 1.0 - 0.5 * rise : 1.0;
    out = {-left_slope / stretch, value, left(x) - value};
    return true;
  }

  void step(const cv::Mat& from, cv::Mat& next, cv::Mat& variance, cv::Mat& steps) const {
    next = cv::Mat(from.size(), CV_64F, cv::Scalar(NAN));
    variance = next.clone();
    steps = next.clone();
    for (int y = 0; y < from.rows; ++y) {
      for (int x = 0; x < from.cols; ++x) {
        std::vector<cv::Vec3d> rows;
        cv::Vec3d mean(0, 0, 0), row;
        window(y, x, [&](int v, int u) {
          if (!warp(from, v, u, row)) return;
          rows.push_back(row);
          mean += row;
        });
        const double n = static_cast<double>(rows.size());
        if (n < 0.3 * o_.window_px * o_.window_px || std::isnan(from.at<double>(y, x))) continue;
        cv::Matx33d m = cv::Matx33d::zeros();
        for (cv::Vec3d& r : rows) {
          r -= mean / n;
          m += r * r.t();
        }
        const double gain_g = m(0, 1) / m(1, 1), gain_e = m(2, 1) / m(1, 1);
        const double gg = m(0, 0) - gain_g * m(0, 1), ge = m(0, 2) - gain_g * m(2, 1);
        const double ee = m(2, 2) - gain_e * m(2, 1), delta = ge / gg;
        const double residual = std::max(0.0, ee - delta * ge) / std::max(1.0, n - 3.0);
        steps.at<double>(y, x) = std::min(std::max(delta, -0.5), 0.5);
        next.at<double>(y, x) = from.at<double>(y, x) + steps.at<double>(y, x);
        variance.at<double>(y, x) = std::max(residual, o_.image_noise * o_.image_noise) / gg;
      }
    }
  }

  const Scene& s_;
  const RefinementOptions& o_;
};

}  // namespace scanner::stereo::testing
