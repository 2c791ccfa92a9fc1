#include <algorithm>
#include <limits>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "scanner/core/parallel.h"
#include "stereo/matcher.h"
#include "stereo/semi_global_strip.h"

namespace scanner::stereo {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
/// Window of the texture test.
constexpr int kTextureWindow = 9;

std::size_t asSize(int value) { return static_cast<std::size_t>(value); }

/// Removes pixels around which the grey hardly changes along the row: the mean over a window of
/// the absolute difference of the two neighbours, which is twice the slope. Returns how many.
std::size_t removeUntextured(const cv::Mat& left, double threshold, cv::Mat& disparity) {
  cv::Mat wide, change, sum;
  cv::copyMakeBorder(left, wide, 0, 0, 1, 1, cv::BORDER_REPLICATE);
  cv::absdiff(wide.colRange(2, wide.cols), wide.colRange(0, left.cols), change);
  cv::boxFilter(change, sum, CV_32S, cv::Size(kTextureWindow, kTextureWindow), cv::Point(-1, -1),
                false);
  const double least = threshold * kTextureWindow * kTextureWindow;
  std::size_t removed = 0;
  for (int y = 0; y < left.rows; ++y) {
    const int* texture = sum.ptr<int>(y);
    float* d = disparity.ptr<float>(y);
    for (int x = 0; x < left.cols; ++x) {
      if (texture[x] >= least || d[x] != d[x]) continue;
      d[x] = kNan;
      ++removed;
    }
  }
  return removed;
}

std::size_t removeAmbiguous(cv::Mat& disparity) {
  std::size_t removed = 0;
  for (int y = 0; y < disparity.rows; ++y) {
    float* d = disparity.ptr<float>(y);
    for (int x = 0; x < disparity.cols; ++x) {
      if (!(d[x] == SemiGlobalStrip::kAmbiguousDisparity)) continue;
      d[x] = kNan;
      ++removed;
    }
  }
  return removed;
}

class SemiGlobalMatcher final : public Matcher {
 public:
  explicit SemiGlobalMatcher(const MatcherOptions& options) : options_(options) {}

  Candidates match(const cv::Mat& left, const cv::Mat& right, DisparitySearch search,
                   int threads) const override;
  std::size_t workingMemory(cv::Size image, DisparitySearch search, int threads) const override;

 private:
  MatcherOptions options_;
};

Candidates SemiGlobalMatcher::match(const cv::Mat& left, const cv::Mat& right,
                                    DisparitySearch search, int threads) const {
  if (left.empty() || left.type() != CV_8UC1 || right.type() != CV_8UC1 ||
      left.size() != right.size()) {
    throw std::invalid_argument("semi-global matcher: needs two CV_8UC1 images of equal size");
  }
  if (search.min_px < 0 || search.max_px < search.min_px || search.max_px >= left.cols) {
    throw std::invalid_argument("semi-global matcher: disparities must lie in [0, width)");
  }
  const SemiGlobalOptions& o = options_.semi_global;
  const simd::CellLayout layout = makeLayout(left.cols, search);
  const SemiGlobalImages images(left, right, layout, o.window_px / 2);
  const int rows = stripRows(layout, left.rows, o);
  Candidates out;
  out.left.create(left.size(), CV_32FC1);
  out.right.create(left.size(), CV_16SC1);
  // A fresh piece of memory of this size costs more than the work that is done in it, so that
  // every thread keeps the one that it has for the next strip.
  std::mutex mutex;
  std::vector<std::unique_ptr<SemiGlobalStrip>> idle;
  const auto take = [&]() -> std::unique_ptr<SemiGlobalStrip> {
    {
      const std::lock_guard<std::mutex> lock(mutex);
      if (!idle.empty()) {
        auto strip = std::move(idle.back());
        idle.pop_back();
        return strip;
      }
    }
    return std::make_unique<SemiGlobalStrip>(layout, options_, rows);
  };
  parallelFor(asSize(left.rows), asSize(rows), threads, [&](std::size_t begin, std::size_t end) {
    auto strip = take();
    strip->match(images, static_cast<int>(begin), static_cast<int>(end), out);
    const std::lock_guard<std::mutex> lock(mutex);
    idle.push_back(std::move(strip));
  });
  const ValidationOptions& v = options_.validation;
  if (v.texture) out.untextured = removeUntextured(left, v.texture_threshold, out.left);
  out.ambiguous = removeAmbiguous(out.left);
  return out;
}

std::size_t SemiGlobalMatcher::workingMemory(cv::Size image, DisparitySearch search,
                                             int threads) const {
  const SemiGlobalOptions& o = options_.semi_global;
  const simd::CellLayout layout = makeLayout(image.width, search);
  const int rows = stripRows(layout, image.height, o);
  const std::size_t strips = chunkCount(asSize(image.height), asSize(rows));
  const std::size_t texture = 6 * asSize(image.area());  // of the texture test
  return SemiGlobalImages::bytes(image, layout, o.window_px / 2) + texture +
         std::min(strips, asSize(threads)) * SemiGlobalStrip::bytes(layout, o, rows);
}

}  // namespace

std::unique_ptr<Matcher> makeSemiGlobalMatcher(const MatcherOptions& options) {
  return std::make_unique<SemiGlobalMatcher>(options);
}

}  // namespace scanner::stereo
