#include "stereo/validate.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numeric>
#include <vector>

#include "scanner/core/parallel.h"
#include "stereo/matcher.h"

namespace scanner::stereo {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr std::size_t kRowsPerChunk = 64;

/// Calls `clean(y)`, which returns how many pixels of row y it removed, for every row.
template <typename CleanRow>
std::size_t sumOverRows(int rows, int threads, const CleanRow& clean) {
  const auto n = static_cast<std::size_t>(rows);
  std::vector<std::size_t> removed(chunkCount(n, kRowsPerChunk), 0);
  parallelFor(n, kRowsPerChunk, threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) {
      removed[begin / kRowsPerChunk] += clean(static_cast<int>(y));
    }
  });
  return std::accumulate(removed.begin(), removed.end(), std::size_t{0});
}

/// Nearest column of the right image; -1 when it lies to the left of it. No NaN, please.
inline int matchColumn(int x, float d) {
  const float at = static_cast<float>(x) - d + 0.5f;
  return at < 0.0f ? -1 : static_cast<int>(at);
}

/// Columns [begin, end) of a row.
struct Columns {
  int begin = 0, end = 0;
  bool whole = true;  ///< nothing between is left out
};

/// Where a mask is not 0.
Columns validColumns(const std::uint8_t* mask, int width) {
  Columns c{0, width};
  while (c.begin < width && mask[c.begin] == 0) ++c.begin;
  while (c.end > c.begin && mask[c.end - 1] == 0) --c.end;
  c.whole = c.begin == c.end ||
            std::memchr(mask + c.begin, 0, static_cast<std::size_t>(c.end - c.begin)) == nullptr;
  return c;
}

/// Pixels [begin, end) that are masked.
std::size_t removeMasked(const std::uint8_t* mask, int begin, int end, float* d) {
  std::size_t removed = 0;
  for (int x = begin; x < end; ++x) {
    if (std::isnan(d[x]) || mask[x] != 0) continue;
    d[x] = kNan;
    ++removed;
  }
  return removed;
}

/// Pixels whose match is masked.
std::size_t removeMaskedMatches(const std::uint8_t* mask, int width, float* d) {
  std::size_t removed = 0;
  for (int x = 0; x < width; ++x) {
    if (std::isnan(d[x])) continue;
    const int at = matchColumn(x, d[x]);
    if (at < 0 || at >= width || mask[at] != 0) continue;
    d[x] = kNan;
    ++removed;
  }
  return removed;
}

/// Disparities outside [low, high], and those whose nearest column is not one of `right`. No
/// branches: the processor would guess wrong at the edges of surfaces, and the compiler makes
/// vectors of it.
std::size_t removeBeyond(float low, float high, const Columns& right, int width, float* d) {
  const float first = static_cast<float>(right.begin), end = static_cast<float>(right.end);
  unsigned removed = 0;
  for (int x = 0; x < width; ++x) {
    const float value = d[x], at = static_cast<float>(x) - value + 0.5f;
    const bool keep = (value >= low) & (value <= high) & (at >= first) & (at < end);
    removed += static_cast<unsigned>(!keep & (value == value));
    d[x] = keep ? value : kNan;
  }
  return removed;
}

/// T: pixel type of the right map. A pixel that has none is far from every disparity.
template <typename T>
std::size_t removeInconsistentOf(const cv::Mat& right, float tolerance, cv::Mat& disparity,
                                 int threads) {
  return sumOverRows(disparity.rows, threads, [&](int y) {
    float* d = disparity.ptr<float>(y);
    const T* back = right.ptr<T>(y);
    std::size_t removed = 0;
    for (int x = 0; x < disparity.cols; ++x) {
      if (std::isnan(d[x])) continue;
      const int at = matchColumn(x, d[x]);
      const bool inside = at >= 0 && at < right.cols;
      if (inside && back[at] >= T{0} &&
          std::abs(static_cast<float>(back[at]) - d[x]) <= tolerance) {
        continue;
      }
      d[x] = kNan;
      ++removed;
    }
    return removed;
  });
}

/// Pixels [begin, end) of one row that hang together.
struct Run {
  int begin = 0, end = 0;
};

/// Union-find over the runs of an image. The root of a set is its smallest member, so the result
/// does not depend on the order of the unions.
class Surfaces {
 public:
  Surfaces(const cv::Mat& disparity, float max_step, int threads)
      : disparity_(disparity), max_step_(max_step), row_start_(rows() + 1, 0) {
    collectRuns(threads);
    parent_.resize(runs_.size());
    std::iota(parent_.begin(), parent_.end(), 0);
    // Strips touch only their own runs; the seams between them come after.
    parallelFor(rows(), kRowsPerChunk, threads, [&](std::size_t begin, std::size_t end) {
      for (std::size_t y = begin + 1; y < end; ++y) joinRows(y);
    });
    for (std::size_t y = kRowsPerChunk; y < rows(); y += kRowsPerChunk) joinRows(y);
    sizes_.assign(runs_.size(), 0);
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      parent_[i] = parent_[index(parent_[i])];  // a root, since parents come first
      sizes_[index(parent_[i])] += runs_[i].end - runs_[i].begin;
    }
  }

  /// Calls visit(run, size of its surface) for the runs of row y.
  template <typename Visit>
  void forRow(int y, const Visit& visit) const {
    const auto row = static_cast<std::size_t>(y);
    for (std::size_t i = row_start_[row]; i < row_start_[row + 1]; ++i) {
      visit(runs_[i], sizes_[index(parent_[i])]);
    }
  }

 private:
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  std::size_t rows() const { return static_cast<std::size_t>(disparity_.rows); }

  void collectRuns(int threads) {
    std::vector<std::vector<Run>> strips(chunkCount(rows(), kRowsPerChunk));
    parallelFor(rows(), kRowsPerChunk, threads, [&](std::size_t begin, std::size_t end) {
      std::vector<Run>& strip = strips[begin / kRowsPerChunk];
      for (std::size_t y = begin; y < end; ++y) {
        const std::size_t before = strip.size();
        appendRuns(disparity_.ptr<float>(static_cast<int>(y)), strip);
        row_start_[y + 1] = strip.size() - before;
      }
    });
    for (const std::vector<Run>& strip : strips) {
      runs_.insert(runs_.end(), strip.begin(), strip.end());
    }
    std::partial_sum(row_start_.begin(), row_start_.end(), row_start_.begin());
  }

  void appendRuns(const float* d, std::vector<Run>& runs) const {
    const int width = disparity_.cols;
    for (int x = 0; x < width;) {
      if (std::isnan(d[x])) {
        ++x;
        continue;
      }
      Run run{x, x + 1};
      while (run.end < width && std::abs(d[run.end] - d[run.end - 1]) <= max_step_) ++run.end;
      runs.push_back(run);
      x = run.end;
    }
  }

  void joinRows(std::size_t y) {
    const float* above = disparity_.ptr<float>(static_cast<int>(y) - 1);
    const float* here = disparity_.ptr<float>(static_cast<int>(y));
    std::size_t i = row_start_[y - 1], j = row_start_[y];
    while (i < row_start_[y] && j < row_start_[y + 1]) {
      const Run a = runs_[i], b = runs_[j];
      const int end = std::min(a.end, b.end);
      for (int x = std::max(a.begin, b.begin); x < end; ++x) {
        if (!(std::abs(above[x] - here[x]) <= max_step_)) continue;
        join(static_cast<int>(i), static_cast<int>(j));
        break;
      }
      if (a.end <= b.end) ++i;
      if (b.end <= a.end) ++j;
    }
  }

  int root(int i) {
    while (parent_[index(i)] != i) {
      parent_[index(i)] = parent_[index(parent_[index(i)])];
      i = parent_[index(i)];
    }
    return i;
  }

  void join(int a, int b) {
    a = root(a);
    b = root(b);
    if (a != b) parent_[index(std::max(a, b))] = std::min(a, b);
  }

  const cv::Mat& disparity_;
  float max_step_;
  std::vector<std::size_t> row_start_;
  std::vector<Run> runs_;
  std::vector<int> parent_, sizes_;
};

}  // namespace

std::size_t removeOutside(double min_disparity, double max_disparity, int margin,
                          const cv::Mat& left_valid, const cv::Mat& right_valid, cv::Mat& disparity,
                          int threads) {
  const int width = disparity.cols;
  const float low = static_cast<float>(min_disparity), high = static_cast<float>(max_disparity);
  const Columns allowed{std::max(margin, 0), width - std::max(margin, 0)};
  return sumOverRows(disparity.rows, threads, [&](int y) {
    float* d = disparity.ptr<float>(y);
    std::size_t removed = 0;
    if (!left_valid.empty()) {
      const std::uint8_t* mask = left_valid.ptr<std::uint8_t>(y);
      const Columns valid = validColumns(mask, width);
      removed += removeMasked(mask, 0, valid.begin, d);
      removed += removeMasked(mask, valid.end, width, d);
      if (!valid.whole) removed += removeMasked(mask, valid.begin, valid.end, d);
    }
    Columns right = allowed;
    if (!right_valid.empty()) {
      const std::uint8_t* mask = right_valid.ptr<std::uint8_t>(y);
      const Columns valid = validColumns(mask, width);
      right = {std::max(right.begin, valid.begin), std::min(right.end, valid.end)};
      if (!valid.whole) removed += removeMaskedMatches(mask, width, d);
    }
    return removed + removeBeyond(low, high, right, width, d);
  });
}

std::size_t removeInconsistent(const cv::Mat& right_disparity, double tolerance, cv::Mat& disparity,
                               int threads) {
  static_assert(kNoDisparity < 0, "told from a disparity by its sign");
  const float limit = static_cast<float>(tolerance);
  return right_disparity.type() == CV_16SC1
             ? removeInconsistentOf<short>(right_disparity, limit, disparity, threads)
             : removeInconsistentOf<float>(right_disparity, limit, disparity, threads);
}

std::size_t removeImprecise(const cv::Mat& sigma, double max_sigma, cv::Mat& disparity,
                            int threads) {
  const float limit = static_cast<float>(max_sigma);
  return sumOverRows(disparity.rows, threads, [&](int y) {
    float* d = disparity.ptr<float>(y);
    const float* s = sigma.ptr<float>(y);
    unsigned removed = 0;
    for (int x = 0; x < disparity.cols; ++x) {
      const bool keep = s[x] <= limit;  // not for NaN
      removed += static_cast<unsigned>(!keep & (d[x] == d[x]));
      d[x] = keep ? d[x] : kNan;
    }
    return static_cast<std::size_t>(removed);
  });
}

std::size_t removeSmallSurfaces(double max_step, int min_size, cv::Mat& disparity, int threads) {
  const Surfaces surfaces(disparity, static_cast<float>(max_step), threads);
  return sumOverRows(disparity.rows, threads, [&](int y) {
    float* d = disparity.ptr<float>(y);
    std::size_t removed = 0;
    surfaces.forRow(y, [&](const Run& run, int size) {
      if (size >= min_size) return;
      std::fill(d + run.begin, d + run.end, kNan);
      removed += static_cast<std::size_t>(run.end - run.begin);
    });
    return removed;
  });
}

}  // namespace scanner::stereo
