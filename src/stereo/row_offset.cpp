#include "stereo/row_offset.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

namespace scanner::stereo {
namespace {

constexpr int kBlock = 16;
/// A block needs this many pixels, and gradients in y of this variance (grey levels squared).
constexpr int kMinPixels = 100;
constexpr double kMinGradient2 = 4.0;
/// A shift beyond this (coarse px) is outside what the linearisation holds for.
constexpr double kMaxShift = 1.5;
constexpr int kMinBlocks = 12;

struct Shift {
  double x = 0.0, y = 0.0;  ///< place in the image, -1 to 1
  double down = 0.0;        ///< coarse px
};

/// The shift of one block: L(x, y) = g R(x - d + sx, y + sy) + o, linear in g, o, g sx, g sy.
bool solveBlock(const CoarsePair& pair, const CoarseMatch& match, int x0, int y0, double* down) {
  Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
  Eigen::Vector4d b = Eigen::Vector4d::Zero();
  int count = 0;
  double gradient2 = 0.0;
  for (int y = std::max(1, y0); y < std::min(y0 + kBlock, pair.left.rows - 1); ++y) {
    const short* d = match.disparity.ptr<short>(y);
    const std::uint8_t* left = pair.left.ptr(y);
    const std::array<const std::uint8_t*, 3> right = {pair.right.ptr(y - 1), pair.right.ptr(y),
                                                      pair.right.ptr(y + 1)};
    for (int x = x0; x < std::min(x0 + kBlock, pair.left.cols); ++x) {
      const int other = x - d[x];
      if (d[x] == kNoCoarseDisparity || other < 1 || other >= pair.right.cols - 1) continue;
      const double value = right[1][other];
      const double gx = 0.5 * (right[1][other + 1] - right[1][other - 1]);
      const double gy = 0.5 * (right[2][other] - right[0][other]);
      const Eigen::Vector4d row(gx, gy, value, 1.0);
      A += row * row.transpose();
      b += row * static_cast<double>(left[x]);
      gradient2 += gy * gy;
      ++count;
    }
  }
  if (count < kMinPixels || gradient2 < kMinGradient2 * count) return false;
  const Eigen::Vector4d s = A.ldlt().solve(b);
  if (!s.allFinite() || s[2] < 0.1) return false;
  *down = s[1] / s[2];
  return std::abs(*down) <= kMaxShift && std::abs(s[0] / s[2]) <= kMaxShift;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Plane a + b x + c y through the shifts, in a few rounds without those far off it.
Eigen::Vector3d fitPlane(const std::vector<Shift>& shifts, double start) {
  Eigen::Vector3d plane(start, 0.0, 0.0);
  for (const double limit : {1.5, 0.8, 0.4, 0.3}) {
    Eigen::Matrix3d A = 1e-3 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    for (const Shift& s : shifts) {
      const Eigen::Vector3d row(1.0, s.x, s.y);
      if (std::abs(s.down - plane.dot(row)) > limit) continue;
      A += row * row.transpose();
      b += row * s.down;
    }
    plane = A.ldlt().solve(b);
  }
  return plane;
}

}  // namespace

RowOffset measureRowOffset(const CoarsePair& pair, const CoarseMatch& match) {
  std::vector<Shift> shifts;
  std::vector<double> downs;
  const double half_x = 0.5 * pair.left.cols, half_y = 0.5 * pair.left.rows;
  for (int y0 = 0; y0 < pair.left.rows; y0 += kBlock) {
    for (int x0 = 0; x0 < pair.left.cols; x0 += kBlock) {
      double down = 0.0;
      if (!solveBlock(pair, match, x0, y0, &down)) continue;
      shifts.push_back(
          {(x0 + 0.5 * kBlock) / half_x - 1.0, (y0 + 0.5 * kBlock) / half_y - 1.0, down});
      downs.push_back(down);
    }
  }
  if (shifts.size() < static_cast<std::size_t>(kMinBlocks)) return {};
  RowOffset out;
  out.blocks = static_cast<int>(shifts.size());
  const double middle = median(downs);
  const Eigen::Vector3d plane = fitPlane(shifts, middle);
  // Only where there are blocks: a plane says nothing about the rest.
  double worst = 0.0;
  for (const Shift& s : shifts) {
    const double value = plane.dot(Eigen::Vector3d(1.0, s.x, s.y));
    if (std::abs(value) > std::abs(worst)) worst = value;
  }
  out.median_px = middle * pair.factor;
  out.worst_px = worst * pair.factor;
  return out;
}

}  // namespace scanner::stereo
