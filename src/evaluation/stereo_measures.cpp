#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "scanner/evaluation/stereo_evaluation.h"

namespace scanner::evaluation {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kRounding = 1e-4;
constexpr double kInlier = 1.0;

void requireMaps(const cv::Mat& truth, const cv::Mat& region,
                 const std::vector<const cv::Mat*>& maps) {
  bool ok = truth.type() == CV_32FC1 && region.type() == CV_8UC1 && region.size() == truth.size();
  for (const cv::Mat* map : maps) {
    ok = ok && map->type() == CV_32FC1 && map->size() == truth.size();
  }
  if (!ok) throw std::invalid_argument("stereo measures: maps of equal size and CV_32FC1 needed");
}

bool isBad(double error, double threshold) { return std::abs(error) > threshold + kRounding; }

double share(std::size_t part, std::size_t whole) {
  return whole == 0 ? kNan : static_cast<double>(part) / static_cast<double>(whole);
}

/// Counts of one region while it is gone through.
struct Counts {
  std::array<std::size_t, kBadThresholds.size()> bad_valid{}, bad_filled{};
  std::vector<double> errors;  ///< absolute, of the valid pixels

  void addValid(double error) {
    errors.push_back(std::abs(error));
    for (std::size_t i = 0; i < kBadThresholds.size(); ++i) {
      if (isBad(error, kBadThresholds[i])) ++bad_valid[i];
    }
  }
  void addFilled(double error) {
    for (std::size_t i = 0; i < kBadThresholds.size(); ++i) {
      // A pixel that filling left empty is bad too.
      if (std::isnan(error) || isBad(error, kBadThresholds[i])) ++bad_filled[i];
    }
  }
};

double inlierRms(const std::vector<double>& errors) {
  double squares = 0.0;
  std::size_t count = 0;
  for (const double error : errors) {
    if (error >= kInlier) continue;
    squares += error * error;
    ++count;
  }
  return count == 0 ? kNan : std::sqrt(squares / static_cast<double>(count));
}

double median(std::vector<double> values) {
  if (values.empty()) return kNan;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

/// Mean of `figure` over the scenes where it is known.
template <typename Figure>
double meanOf(const std::vector<RegionMeasures>& scenes, const Figure& figure) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const RegionMeasures& scene : scenes) {
    const double value = figure(scene);
    if (std::isnan(value)) continue;
    sum += value;
    ++count;
  }
  return count == 0 ? kNan : sum / static_cast<double>(count);
}

}  // namespace

RegionMeasures measureDisparity(const cv::Mat& truth, const cv::Mat& region,
                                const cv::Mat& disparity, const cv::Mat& filled) {
  requireMaps(truth, region, {&disparity});
  if (!filled.empty()) requireMaps(truth, region, {&filled});
  RegionMeasures out;
  Counts counts;
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      const double t = truth.at<float>(y, x);
      if (region.at<std::uint8_t>(y, x) == 0 || std::isnan(t)) continue;
      ++out.pixels;
      const double d = disparity.at<float>(y, x);
      if (!std::isnan(d)) counts.addValid(d - t);
      if (!filled.empty()) counts.addFilled(filled.at<float>(y, x) - t);
    }
  }
  out.valid = counts.errors.size();
  out.density = share(out.valid, out.pixels);
  for (std::size_t i = 0; i < kBadThresholds.size(); ++i) {
    out.bad_valid[i] = share(counts.bad_valid[i], out.valid);
    out.bad_all[i] = share(counts.bad_valid[i] + (out.pixels - out.valid), out.pixels);
    out.bad_filled[i] = filled.empty() ? kNan : share(counts.bad_filled[i], out.pixels);
  }
  out.inlier_rms_px = inlierRms(counts.errors);
  out.median_px = median(std::move(counts.errors));
  return out;
}

RegionMeasures meanMeasures(const std::vector<RegionMeasures>& scenes) {
  RegionMeasures out;
  for (const RegionMeasures& scene : scenes) {
    out.pixels += scene.pixels;
    out.valid += scene.valid;
  }
  using Measures = RegionMeasures;
  out.density = meanOf(scenes, [](const Measures& m) { return m.density; });
  for (std::size_t i = 0; i < kBadThresholds.size(); ++i) {
    out.bad_valid[i] = meanOf(scenes, [i](const Measures& m) { return m.bad_valid[i]; });
    out.bad_all[i] = meanOf(scenes, [i](const Measures& m) { return m.bad_all[i]; });
    out.bad_filled[i] = meanOf(scenes, [i](const Measures& m) { return m.bad_filled[i]; });
  }
  out.inlier_rms_px = meanOf(scenes, [](const Measures& m) { return m.inlier_rms_px; });
  out.median_px = meanOf(scenes, [](const Measures& m) { return m.median_px; });
  return out;
}

double badShareOfBest(const cv::Mat& truth, const cv::Mat& region, const cv::Mat& disparity,
                      const cv::Mat& sigma, std::size_t count, double threshold_px) {
  requireMaps(truth, region, {&disparity, &sigma});
  struct Pixel {
    float sigma;
    bool bad;
  };
  std::vector<Pixel> pixels;
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      const float t = truth.at<float>(y, x), d = disparity.at<float>(y, x);
      if (region.at<std::uint8_t>(y, x) == 0 || std::isnan(t) || std::isnan(d)) continue;
      const float s = sigma.at<float>(y, x);
      pixels.push_back({std::isnan(s) ? std::numeric_limits<float>::infinity() : s,
                        isBad(static_cast<double>(d) - static_cast<double>(t), threshold_px)});
    }
  }
  if (count == 0 || pixels.size() < count) return kNan;
  std::stable_sort(pixels.begin(), pixels.end(),
                   [](const Pixel& a, const Pixel& b) { return a.sigma < b.sigma; });
  const auto end = pixels.begin() + static_cast<std::ptrdiff_t>(count);
  return share(static_cast<std::size_t>(
                   std::count_if(pixels.begin(), end, [](const Pixel& p) { return p.bad; })),
               count);
}

}  // namespace scanner::evaluation
