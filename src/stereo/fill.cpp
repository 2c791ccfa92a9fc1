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

/// Fills one row from what borders on its holes; false when it has no disparity.
bool fillRow(float* row, int width) {
  bool any = false;
  for (int x = 0; x < width;) {
    if (!std::isnan(row[x])) {
      any = true;
      ++x;
      continue;
    }
    int end = x;
    while (end < width && std::isnan(row[end])) ++end;
    const float before = x > 0 ? row[x - 1] : kNan;
    const float after = end < width ? row[end] : kNan;
    std::fill(row + x, row + end, std::fmin(before, after));  // fmin: the one that is known
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
  WeightedMedian(const cv::Mat& disparity, const cv::Mat& guide)
      : disparity_(disparity), guide_(guide), table_(weights(guide.channels())) {}

  /// `samples` is scratch.
  float at(int x, int y, std::vector<std::pair<float, float>>& samples) const {
    const int channels = guide_.channels();
    const std::uint8_t* centre = guide_.ptr<std::uint8_t>(y, x);
    samples.clear();
    float total = 0.0F;
    for (int v = std::max(0, y - kRadius); v <= std::min(disparity_.rows - 1, y + kRadius); ++v) {
      const float* d = disparity_.ptr<float>(v);
      for (int u = std::max(0, x - kRadius); u <= std::min(disparity_.cols - 1, x + kRadius); ++u) {
        const int distance = colorDistance(centre, guide_.ptr<std::uint8_t>(v, u), channels);
        const float weight = table_[static_cast<std::size_t>(distance)];
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
  std::vector<float> table_;
};

cv::Mat nearSteps(const cv::Mat& disparity) {
  const cv::Mat window = cv::Mat::ones(2 * kRadius + 1, 2 * kRadius + 1, CV_8U);
  cv::Mat most, least;
  cv::dilate(disparity, most, window);
  cv::erode(disparity, least, window);
  return (most - least) > kStepPx;
}

cv::Mat sharpened(const cv::Mat& disparity, const cv::Mat& guide, const cv::Mat& chosen,
                  int threads) {
  cv::Mat out = disparity.clone();
  const WeightedMedian median(disparity, guide);
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
  std::vector<bool> known;
  known.reserve(static_cast<std::size_t>(filled.rows));
  for (int y = 0; y < filled.rows; ++y) known.push_back(fillRow(filled.ptr<float>(y), filled.cols));
  if (std::none_of(known.begin(), known.end(), [](bool k) { return k; })) return filled;
  fillEmptyRows(known, filled);
  for (int pass = 0; pass < kPasses; ++pass) {
    filled = sharpened(filled, guide, holes | nearSteps(filled), threads);
  }
  return filled;
}

}  // namespace scanner::stereo
