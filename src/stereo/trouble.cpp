#include "scanner/stereo/trouble.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "stereo/coarse.h"
#include "stereo/row_offset.h"

namespace scanner::stereo {
namespace {

/// Width that pairs are looked at, px.
constexpr int kCoarseWidth = 320;
/// Least size, coarse px, of a piece of surface that counts.
constexpr int kMinPiece = 30;
/// Disparities within plus and minus this, coarse px, are those of things far away, or of two
/// copies of one picture.
constexpr int kFar = 1;
/// Share of the textured pixels that must match. Measured on 41 good pairs (outdoors, indoors,
/// simulated): 0.45 and more; on pictures that do not belong together: below 0.03.
constexpr double kMinMatched = 0.1;
constexpr double kPartlyMatched = 0.3;
/// Above this, the rows are close enough for what differs to be measured.
constexpr double kFullyMatched = 0.45;
/// Other rows are the right ones when this many times as much matches there.
constexpr double kBetterRows = 1.25;
/// A relation of the pictures is the true one when this many times as much matches under it.
constexpr double kClearly = 4.0;
constexpr double kMinTextured = 0.01;
constexpr double kSameShare = 0.9;
constexpr double kDark = 12.0, kMinContrast = 3.0;
constexpr int kBright = 250;
constexpr double kMaxBright = 0.5;
constexpr double kMaxBrightnessRatio = 4.0;
/// Contrast of the strongest edges over 2 px to that over 8 px: 0.50 to 1.22 on good pictures,
/// below 0.34 after a blur of 4 px; between two eyes up to 1.2 times, with one eye blurred by 2 px
/// 1.3 times and more.
constexpr double kMinSharpness = 0.4, kMaxSharpnessRatio = 1.4;
/// Rows that differ by more, px of the full size, are named; by more than the second, matching
/// windows no longer see the same things.
constexpr double kMaxRowOffset = 1.0, kHopelessRowOffset = 3.0;
/// Rows that are tried when little matches, in steps of twice the coarse pixel.
constexpr int kNearRows = 1, kFarRows = 12;

using Histogram = std::array<std::size_t, 256>;

std::string number(const char* format, double value) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

struct Brightness {
  double mean = 0.0, deviation = 0.0, bright = 0.0;
};

/// Over every fourth pixel of every fourth row.
Brightness brightness(const cv::Mat& gray, const cv::Mat& valid) {
  constexpr int kStep = 4;
  std::uint64_t count = 0, sum = 0, sum2 = 0, bright = 0;
  for (int y = 0; y < gray.rows; y += kStep) {
    const std::uint8_t* row = gray.ptr(y);
    const std::uint8_t* mask = valid.empty() ? nullptr : valid.ptr(y);
    for (int x = 0; x < gray.cols; x += kStep) {
      if (mask != nullptr && mask[x] == 0) continue;
      const auto value = static_cast<std::uint64_t>(row[x]);
      ++count;
      sum += value;
      sum2 += value * value;
      bright += value >= kBright ? 1 : 0;
    }
  }
  if (count == 0) return {};
  const auto n = static_cast<double>(count);
  const double mean = static_cast<double>(sum) / n;
  const double variance = std::max(0.0, static_cast<double>(sum2) / n - mean * mean);
  return {mean, std::sqrt(variance), static_cast<double>(bright) / n};
}

Trouble inspectEye(const Brightness& b) {
  if (b.mean < kDark && b.deviation < kDark) {
    return {TroubleKind::kBlack, true, "is black (lens cap, or exposure too short)"};
  }
  if (b.bright > kMaxBright) {
    return {TroubleKind::kSaturated, true, "is saturated (exposure too long)"};
  }
  if (b.deviation < kMinContrast) {
    return {TroubleKind::kBlank, true, "shows nothing (covered, or no texture)"};
  }
  return {};
}

/// Value that 99 % of the entries do not exceed.
double percentile99(const Histogram& histogram) {
  std::size_t all = 0, sum = 0;
  for (const std::size_t n : histogram) all += n;
  for (std::size_t i = 0; i < histogram.size(); ++i) {
    sum += histogram[i];
    if (sum * 100 >= all * 99) return static_cast<double>(i);
  }
  return 255.0;
}

double edgeContrast(const cv::Mat& gray) {
  Histogram histogram{};
  for (int y = 0; y < gray.rows; ++y) {
    const std::uint8_t* row = gray.ptr(y);
    for (int x = 1; x < gray.cols; ++x) {
      ++histogram[static_cast<std::size_t>(std::abs(row[x] - row[x - 1]))];
    }
  }
  return percentile99(histogram);
}

double sharpness(const cv::Mat& gray) {
  return edgeContrast(boxReduced(gray, 2)) / std::max(1.0, edgeContrast(boxReduced(gray, 8)));
}

Trouble inspectFocus(const RectifiedPair& pair) {
  const double left = sharpness(pair.left_gray), right = sharpness(pair.right_gray);
  Trouble trouble{TroubleKind::kBlurred, false, ""};
  if (left < kMinSharpness && right < kMinSharpness) {
    trouble.line = "both images are blurred (out of focus, or moved during the exposure)";
  } else if (std::max(left, right) > kMaxSharpnessRatio * std::min(left, right)) {
    trouble.line = std::string(left < right ? "left" : "right") +
                   " image is blurred (out of focus, or something on the lens)";
  } else {
    return {};
  }
  return trouble;
}

/// How much of a pair matches, of the pixels that can: positive disparities, and those about 0.
struct Matched {
  double near = 0.0, far = 0.0;
};

Matched shares(const CoarseMatch& match, std::size_t textured) {
  Matched out;
  for (auto it = match.disparity.begin<short>(); it != match.disparity.end<short>(); ++it) {
    if (*it == kNoCoarseDisparity) continue;
    (*it > kFar ? out.near : out.far) += 1.0;
  }
  const auto n = static_cast<double>(std::max<std::size_t>(1, textured));
  return {out.near / n, out.far / n};
}

CoarsePair exchanged(const CoarsePair& pair) {
  return {pair.factor, pair.right, pair.left, pair.right_valid, pair.left_valid};
}

Trouble rowTrouble(double offset_px) {
  Trouble trouble{TroubleKind::kRowsDiffer, std::abs(offset_px) > kHopelessRowOffset, ""};
  trouble.line = "rows do not correspond: points lie up to " +
                 number("%.1f px ", std::abs(offset_px)) + (offset_px > 0.0 ? "lower" : "higher") +
                 " in the right image (wrong calibration, not rectified, or not synchronised)";
  return trouble;
}

/// The shift of the right picture under which most of a pair matches.
struct BestRows {
  int factor = 1, rows = 0;
  double share = 0.0;  ///< of the textured pixels
  CoarseMatch match;
};

void tryRows(const CoarsePair& pair, int min_rows, int max_rows, int threads, BestRows* best) {
  const auto textured = static_cast<double>(std::max<std::size_t>(1, texturedPixels(pair.left)));
  for (int size = min_rows; size <= max_rows; ++size) {
    for (const int rows : {-size, size}) {
      CoarseMatch match =
          coarseMatch(withRowsMoved(pair, rows), -kFar, pair.left.cols / 2, kMinPiece / 2, threads);
      const double share = static_cast<double>(match.found) / textured;
      if (share <= best->share) continue;
      *best = {pair.factor, rows, share, std::move(match)};
    }
  }
}

/// Looks for rows that correspond when those of equal number do not: the near ones at the coarse
/// size, those further off at half of it. `as_given` is the share that matches as it is.
Trouble inspectRows(const RectifiedPair& full, const CoarsePair& pair, double as_given,
                    int threads) {
  const CoarsePair half = coarsePair(full, 2 * pair.factor);
  BestRows best{pair.factor, 0, 0.0, {}};
  tryRows(pair, 1, 2 * kNearRows, threads, &best);
  tryRows(half, kNearRows + 1, kFarRows, threads, &best);
  if (best.share < kMinMatched || best.share < kBetterRows * as_given) return {};
  const CoarsePair& at = best.factor == pair.factor ? pair : half;
  const RowOffset rest = measureRowOffset(withRowsMoved(at, best.rows), best.match);
  return rowTrouble(best.rows * best.factor + rest.median_px);
}

Trouble inspectMatches(const RectifiedPair& full, int threads) {
  const int factor = std::max(1, (full.left_gray.cols + kCoarseWidth / 2) / kCoarseWidth);
  const CoarsePair pair = coarsePair(full, factor);
  const std::size_t left = texturedPixels(pair.left), right = texturedPixels(pair.right);
  const double least = kMinTextured * static_cast<double>(pair.left.total());
  if (static_cast<double>(std::min(left, right)) < least) {
    return {TroubleKind::kBlank, true,
            std::string(left < right ? "left" : "right") +
                " image shows no texture (covered, out of focus, or a bare surface)"};
  }
  const int widest = pair.left.cols / 2;
  const CoarseMatch match = coarseMatch(pair, -kFar, widest, kMinPiece, threads);
  const Matched given = shares(match, left);
  const Matched other =
      shares(coarseMatch(exchanged(pair), -kFar, widest, kMinPiece, threads), right);
  if (other.near > kMinMatched && other.near > kClearly * given.near) {
    return {TroubleKind::kSwapped, true, "left and right image are swapped"};
  }
  if (given.far > kMinMatched && given.far > kSameShare * (given.near + given.far)) {
    return {TroubleKind::kSamePicture, true,
            "both images show the same (one camera on both inputs), or nothing but what is far "
            "away"};
  }
  const double share = given.near + given.far;
  if (share < kFullyMatched) {
    if (Trouble rows = inspectRows(full, pair, share, threads)) return rows;
  }
  if (share < kMinMatched) {
    return {TroubleKind::kUnrelated, true,
            "the two images do not match (not of one moment, not rectified, or no texture)"};
  }
  const RowOffset offset = measureRowOffset(pair, match);
  if (offset.blocks > 0 && std::abs(offset.worst_px) > kMaxRowOffset) {
    return rowTrouble(offset.worst_px);
  }
  if (share < kPartlyMatched) {
    return {TroubleKind::kUnrelated, false,
            "the two images match only in part (rows that do not correspond everywhere, not of one "
            "moment, or a repeated pattern)"};
  }
  return {};
}

}  // namespace

Trouble inspectBrightness(const RectifiedPair& pair) {
  if (pair.left_gray.empty() || pair.right_gray.empty() || pair.left_gray.type() != CV_8UC1 ||
      pair.right_gray.type() != CV_8UC1 || pair.left_gray.size() != pair.right_gray.size()) {
    return {TroubleKind::kEmpty, true, "an image is empty, or the two are not alike in size"};
  }
  const Brightness left = brightness(pair.left_gray, pair.left_valid);
  const Brightness right = brightness(pair.right_gray, pair.right_valid);
  Trouble left_trouble = inspectEye(left), right_trouble = inspectEye(right);
  if (left_trouble && right_trouble) {
    left_trouble.line =
        left_trouble.kind == right_trouble.kind
            ? "both images: each " + left_trouble.line
            : "both images: left " + left_trouble.line + ", right " + right_trouble.line;
    return left_trouble;
  }
  if (left_trouble || right_trouble) {
    Trouble& trouble = left_trouble ? left_trouble : right_trouble;
    trouble.line = (left_trouble ? "left image " : "right image ") + trouble.line;
    return trouble;
  }
  const double ratio =
      std::max(left.mean, right.mean) / std::max(1.0, std::min(left.mean, right.mean));
  if (ratio <= kMaxBrightnessRatio) return {};
  return {TroubleKind::kUneven, false,
          std::string(left.mean < right.mean ? "left" : "right") +
              " image is much darker than the other (exposure, aperture, or half covered)"};
}

Trouble inspectPair(const RectifiedPair& pair, int threads) {
  const Trouble bright = inspectBrightness(pair);
  if (bright.hopeless) return bright;
  const Trouble matches = inspectMatches(pair, threads);
  const Trouble focus = inspectFocus(pair);
  // What the pictures look like explains why they do not match, or match on other rows.
  if (matches.kind == TroubleKind::kUnrelated || matches.kind == TroubleKind::kRowsDiffer) {
    if (bright) return {bright.kind, matches.hopeless, bright.line};
    if (focus) return {focus.kind, matches.hopeless, focus.line};
  }
  if (matches) return matches;
  return bright ? bright : focus;
}

Trouble inspectRaw(const StereoFrame& frame) {
  const cv::Mat& left = frame.left.data;
  const cv::Mat& right = frame.right.data;
  if (left.empty() || left.size() != right.size() || left.type() != right.type()) return {};
  // Two sensors never agree to the last bit over a whole picture, unless it is black or saturated.
  const auto bytes = static_cast<std::size_t>(left.cols) * left.elemSize();
  bool varied = false;
  for (int y = 0; y < left.rows; ++y) {
    const std::uint8_t* l = left.ptr(y);
    if (!std::equal(l, l + bytes, right.ptr(y))) return {};
    varied = varied || std::any_of(l, l + bytes, [&](std::uint8_t v) {
               return std::abs(v - left.ptr(0)[0]) > static_cast<int>(kDark);
             });
  }
  if (!varied) return {};
  return {TroubleKind::kSamePicture, true,
          "both images are the same picture (one camera on both inputs)"};
}

std::string describeTrouble(const RectifiedPair& pair, int threads) {
  return inspectPair(pair, threads).line;
}

}  // namespace scanner::stereo
