#include "scanner/stereo/fill.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

#include "scanner/core/parallel.h"

namespace scanner::stereo {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr std::size_t kRowsPerChunk = 16;
/// Window of the weighted median; also how near a step is "near".
constexpr int kRadius = 7;
constexpr int kPasses = 2;
/// Difference of colour, summed over the channels, at which a neighbour's weight has sunk to 1/e.
constexpr float kColorScale = 15.0F;
constexpr float kLeastWeight = 1e-3F;
/// Neighbouring surfaces further apart are a step of depth.
constexpr float kStepPx = 1.0F;

/// Window of the plane that goes on into a hole.
constexpr int kPlaneRadius = 10;
/// Disparities of that window which belong to the surface of its centre: the difference that is let
/// through there, more per pixel of distance, and the most.
constexpr float kSurfaceStepPx = 1.0F, kSurfaceSlope = 0.1F, kMaxSurfaceStepPx = 3.0F;
/// Draws the slope of what few pixels show towards 0, px^2.
constexpr double kSlopeRidge = 300.0;
constexpr double kMaxSlope = 0.5;
/// What a filled pixel counts in the median, beside a matched one.
constexpr float kFilledWeight = 0.3F;

/// Disparity along a row: value at a pixel, and change per column.
struct Slope {
  float value, per_column;
};

/// Sums of a least-squares plane.
struct PlaneSums {
  double n = 0, x = 0, y = 0, z = 0, xx = 0, xy = 0, yy = 0, xz = 0, yz = 0;

  void add(double u, double v, double w) {
    n += 1.0;
    x += u;
    y += v;
    z += w;
    xx += u * u;
    xy += u * v;
    yy += v * v;
    xz += u * w;
    yz += v * w;
  }
  /// Value at the origin, and change along x.
  std::pair<double, double> solve() const {
    const double a = xx - x * x / n + kSlopeRidge, b = xy - x * y / n;
    const double c = yy - y * y / n + kSlopeRidge;
    const double e = xz - x * z / n, f = yz - y * z / n;
    const double determinant = a * c - b * b;
    const double along_x = (e * c - f * b) / determinant;
    const double along_y = (a * f - b * e) / determinant;
    return {(z - along_x * x - along_y * y) / n, along_x};
  }
};

/// The surface at a pixel that has a disparity.
Slope surfaceAt(const cv::Mat& disparity, int x, int y) {
  const float here = disparity.at<float>(y, x);
  PlaneSums sums;
  const int top = std::max(0, y - kPlaneRadius);
  const int bottom = std::min(disparity.rows - 1, y + kPlaneRadius);
  const int first = std::max(0, x - kPlaneRadius);
  const int last = std::min(disparity.cols - 1, x + kPlaneRadius);
  for (int v = top; v <= bottom; ++v) {
    const float* d = disparity.ptr<float>(v);
    for (int u = first; u <= last; ++u) {
      const int distance = std::max(std::abs(u - x), std::abs(v - y));
      const float allowed = std::min(kMaxSurfaceStepPx,
                                     kSurfaceStepPx + kSurfaceSlope * static_cast<float>(distance));
      if (!(std::abs(d[u] - here) <= allowed)) continue;  // NaN too
      sums.add(u - x, v - y, static_cast<double>(d[u]) - static_cast<double>(here));
    }
  }
  const auto [offset, slope] = sums.solve();
  return {here + static_cast<float>(offset),
          static_cast<float>(std::clamp(slope, -kMaxSlope, kMaxSlope))};
}

/// Fills one row from the surfaces that border on its holes, up to disparity `most`; false when it
/// has no disparity. `disparity` is the map before filling.
bool fillRow(const cv::Mat& disparity, int y, float most, float* row) {
  const int width = disparity.cols;
  bool any = false;
  for (int x = 0; x < width;) {
    if (!std::isnan(row[x])) {
      any = true;
      ++x;
      continue;
    }
    int end = x;
    while (end < width && std::isnan(row[end])) ++end;
    const Slope before = x > 0 ? surfaceAt(disparity, x - 1, y) : Slope{kNan, 0.0F};
    const Slope after = end < width ? surfaceAt(disparity, end, y) : Slope{kNan, 0.0F};
    for (int u = x; u < end; ++u) {
      const float a = before.value + before.per_column * static_cast<float>(u - x + 1);
      const float b = after.value + after.per_column * static_cast<float>(u - end);
      const float behind = std::fmin(a, b);  // of one alone: that one
      row[u] = std::isnan(behind) ? kNan : std::clamp(behind, 0.0F, most);
    }
    x = end;
  }
  return any;
}

/// Rows without any disparity copy the nearest row that has some, the upper one of two.
void fillEmptyRows(const std::vector<bool>& known, cv::Mat& disparity) {
  const int rows = disparity.rows;
  std::vector<int> source(static_cast<std::size_t>(rows), -1);
  int last = -1;
  for (int y = 0; y < rows; ++y) {
    if (known[static_cast<std::size_t>(y)]) last = y;
    source[static_cast<std::size_t>(y)] = last;
  }
  last = -1;
  for (int y = rows - 1; y >= 0; --y) {
    if (known[static_cast<std::size_t>(y)]) last = y;
    int& from = source[static_cast<std::size_t>(y)];
    if (from < 0 || (last >= 0 && last - y < y - from)) from = last;
    if (from >= 0 && from != y) disparity.row(from).copyTo(disparity.row(y));
  }
}

int colorDistance(const std::uint8_t* a, const std::uint8_t* b, int channels) {
  int sum = 0;
  for (int c = 0; c < channels; ++c) sum += std::abs(a[c] - b[c]);
  return sum;
}

/// Weight of a difference of colour, for one picture's number of channels.
std::vector<float> weights(int channels) {
  std::vector<float> table(static_cast<std::size_t>(255 * channels + 1));
  // A grey picture's difference counts as that of three equal channels.
  const float scale = 3.0F / static_cast<float>(channels) / kColorScale;
  for (std::size_t i = 0; i < table.size(); ++i) {
    table[i] = std::exp(-static_cast<float>(i) * scale);
  }
  return table;
}

class WeightedMedian {
 public:
  /// `holes`: 255 where the disparity was filled.
  WeightedMedian(const cv::Mat& disparity, const cv::Mat& guide, const cv::Mat& holes)
      : disparity_(disparity), guide_(guide), holes_(holes), table_(weights(guide.channels())) {}

  /// `samples` is scratch.
  float at(int x, int y, std::vector<std::pair<float, float>>& samples) const {
    const int channels = guide_.channels();
    const std::uint8_t* centre = guide_.ptr<std::uint8_t>(y, x);
    samples.clear();
    float total = 0.0F;
    for (int v = std::max(0, y - kRadius); v <= std::min(disparity_.rows - 1, y + kRadius); ++v) {
      const float* d = disparity_.ptr<float>(v);
      const std::uint8_t* filled = holes_.ptr<std::uint8_t>(v);
      for (int u = std::max(0, x - kRadius); u <= std::min(disparity_.cols - 1, x + kRadius); ++u) {
        const int distance = colorDistance(centre, guide_.ptr<std::uint8_t>(v, u), channels);
        const float weight =
            table_[static_cast<std::size_t>(distance)] * (filled[u] != 0 ? kFilledWeight : 1.0F);
        if (weight < kLeastWeight) continue;
        samples.emplace_back(d[u], weight);
        total += weight;
      }
    }
    std::sort(samples.begin(), samples.end());
    float sum = 0.0F;
    for (const auto& [value, weight] : samples) {
      sum += weight;
      if (sum >= 0.5F * total) return value;
    }
    return disparity_.at<float>(y, x);
  }

 private:
  const cv::Mat& disparity_;
  const cv::Mat& guide_;
  const cv::Mat& holes_;
  std::vector<float> table_;
};

cv::Mat nearSteps(const cv::Mat& disparity) {
  const cv::Mat window = cv::Mat::ones(2 * kRadius + 1, 2 * kRadius + 1, CV_8U);
  cv::Mat most, least;
  cv::dilate(disparity, most, window);
  cv::erode(disparity, least, window);
  return (most - least) > kStepPx;
}

cv::Mat sharpened(const cv::Mat& disparity, const cv::Mat& guide, const cv::Mat& holes,
                  int threads) {
  cv::Mat out = disparity.clone();
  const cv::Mat chosen = holes | nearSteps(disparity);
  const WeightedMedian median(disparity, guide, holes);
  parallelFor(static_cast<std::size_t>(disparity.rows), kRowsPerChunk, threads,
              [&](std::size_t begin, std::size_t end) {
                std::vector<std::pair<float, float>> samples;
                for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
                  const std::uint8_t* wanted = chosen.ptr<std::uint8_t>(y);
                  float* to = out.ptr<float>(y);
                  for (int x = 0; x < out.cols; ++x) {
                    if (wanted[x] != 0) to[x] = median.at(x, y, samples);
                  }
                }
              });
  return out;
}

}  // namespace

cv::Mat fill(const cv::Mat& disparity, const cv::Mat& guide, int threads) {
  if (disparity.type() != CV_32FC1 || guide.size() != disparity.size() ||
      (guide.type() != CV_8UC1 && guide.type() != CV_8UC3)) {
    throw std::invalid_argument(
        "fill: needs a CV_32FC1 disparity and an 8-bit picture of the same size");
  }
  const cv::Mat holes = ~(disparity == disparity);  // OpenCV: NaN != NaN is not always true
  cv::Mat filled = disparity.clone();
  if (cv::countNonZero(holes) == static_cast<int>(holes.total())) return filled;
  double most = 0.0;
  cv::minMaxLoc(disparity, nullptr, &most, nullptr, nullptr, ~holes);
  std::vector<bool> known;
  known.reserve(static_cast<std::size_t>(filled.rows));
  for (int y = 0; y < filled.rows; ++y) {
    known.push_back(fillRow(disparity, y, static_cast<float>(most), filled.ptr<float>(y)));
  }
  fillEmptyRows(known, filled);
  for (int pass = 0; pass < kPasses; ++pass) {
    filled = sharpened(filled, guide, holes, threads);
  }
  return filled;
}

std::size_t interpolate(const cv::Mat& guide, const InterpolationOptions& options, int threads,
                        cv::Mat& disparity, cv::Mat& sigma) {
  const cv::Mat filled = fill(disparity, guide, threads);
  const cv::Mat holes = ~(disparity == disparity);
  cv::Mat distance;
  cv::distanceTransform(holes, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  const cv::Mat wanted = holes & (distance <= options.reach_px) & (filled == filled);
  filled.copyTo(disparity, wanted);
  cv::Mat doubt = distance * options.sigma_px;
  doubt.copyTo(sigma, wanted);
  return static_cast<std::size_t>(cv::countNonZero(wanted));
}

}  // namespace scanner::stereo
