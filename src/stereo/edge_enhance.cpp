#include "stereo/edge_enhance.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "scanner/core/parallel.h"

namespace scanner::stereo {
namespace {

constexpr std::size_t kRowsPerChunk = 64;
/// Whole grey levels are too coarse for faint texture. OpenCV's StereoBM has about the same gain,
/// so that settings mean the same.
constexpr int kBandPassGain = 4;

const std::uint8_t* rowAt(const cv::Mat& gray, int y) {
  return gray.ptr<std::uint8_t>(std::clamp(y, 0, gray.rows - 1));
}

void addRow(const std::uint8_t* in, const std::uint8_t* out, int width, int* sums) {
  for (int x = 0; x < width; ++x) sums[x] += in[x] - out[x];
}

/// `sums` are those of the mask's columns.
void bandPassRow(const std::uint8_t* gray, const int* sums, int width, int mask, int limit,
                 int* prefix, std::uint8_t* out) {
  const int radius = mask / 2;
  prefix[0] = 0;
  for (int i = 0; i < width + 2 * radius; ++i) {
    prefix[i + 1] = prefix[i] + sums[std::clamp(i - radius, 0, width - 1)];
  }
  // One product and one sum, so that no instruction set rounds otherwise.
  const int area = mask * mask;
  const float share = static_cast<float>(kBandPassGain) / static_cast<float>(area);
  const auto raise = static_cast<float>(limit) + 0.5F;
  const auto most = static_cast<float>(2 * limit);
  for (int x = 0; x < width; ++x) {
    const int above = gray[x] * area - (prefix[x + mask] - prefix[x]);
    const float value = static_cast<float>(above) * share + raise;
    out[x] = static_cast<std::uint8_t>(static_cast<int>(std::clamp(value, 0.0F, most)));
  }
}

void bandPass(const cv::Mat& gray, int mask, int limit, int begin, int end, cv::Mat& out) {
  const int width = gray.cols;
  const int radius = mask / 2;
  std::vector<int> sums(static_cast<std::size_t>(width), 0);
  std::vector<int> prefix(static_cast<std::size_t>(width + mask));
  const std::vector<std::uint8_t> zeros(static_cast<std::size_t>(width), 0);
  for (int y = begin - radius; y < begin + radius; ++y) {
    addRow(rowAt(gray, y), zeros.data(), width, sums.data());
  }
  for (int y = begin; y < end; ++y) {
    const std::uint8_t* leaving = y == begin ? zeros.data() : rowAt(gray, y - radius - 1);
    addRow(rowAt(gray, y + radius), leaving, width, sums.data());
    bandPassRow(rowAt(gray, y), sums.data(), width, mask, limit, prefix.data(),
                out.ptr<std::uint8_t>(y));
  }
}

void sobelRow(const cv::Mat& gray, int limit, int y, std::uint8_t* out) {
  const std::uint8_t* above = rowAt(gray, y - 1);
  const std::uint8_t* here = rowAt(gray, y);
  const std::uint8_t* below = rowAt(gray, y + 1);
  const auto sum = [&](int x) { return above[x] + 2 * here[x] + below[x]; };
  for (int x = 0; x < gray.cols; ++x) {
    const int gradient = sum(std::min(x + 1, gray.cols - 1)) - sum(std::max(x - 1, 0));
    out[x] = static_cast<std::uint8_t>(std::clamp(gradient, -limit, limit) + limit);
  }
}

}  // namespace

cv::Mat enhanceEdges(const cv::Mat& gray, const BlockMatcherOptions& options, int threads) {
  if (options.edge_enhancement == EdgeEnhancement::kNone) return gray;
  cv::Mat out(gray.size(), CV_8UC1);
  const auto filter = [&](std::size_t begin, std::size_t end) {
    const int first = static_cast<int>(begin);
    const int last = static_cast<int>(end);
    if (options.edge_enhancement == EdgeEnhancement::kBandPass) {
      bandPass(gray, options.edge_mask_px, options.edge_limit, first, last, out);
      return;
    }
    for (int y = first; y < last; ++y) {
      sobelRow(gray, options.edge_limit, y, out.ptr<std::uint8_t>(y));
    }
  };
  parallelFor(static_cast<std::size_t>(gray.rows), kRowsPerChunk, threads, filter);
  return out;
}

}  // namespace scanner::stereo
