#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "scanner/evaluation/stereo_evaluation.h"

namespace scanner::evaluation {
namespace {

/// Two disparities this close belong to one surface.
constexpr float kSameSurface = 1.0F;

bool inside(int x, int width) { return x >= 0 && x < width; }

/// Does the right eye's truth confirm the match?
bool confirmed(const float* right, int width, int x, float d) {
  const float at = static_cast<float>(x) - d;
  for (const float whole : {std::floor(at), std::ceil(at)}) {
    const int column = static_cast<int>(whole);
    if (inside(column, width) && std::abs(right[column] - d) <= kSameSurface) return true;
  }
  return false;
}

/// Largest disparity that arrives at each column of the right image.
void carry(const float* truth, int width, std::vector<float>& nearest) {
  nearest.assign(static_cast<std::size_t>(width), -std::numeric_limits<float>::infinity());
  for (int x = 0; x < width; ++x) {
    if (std::isnan(truth[x])) continue;
    const int to = static_cast<int>(std::lround(static_cast<float>(x) - truth[x]));
    if (!inside(to, width)) continue;
    float& there = nearest[static_cast<std::size_t>(to)];
    there = std::max(there, truth[x]);
  }
}

}  // namespace

cv::Mat nonOccluded(const cv::Mat& truth, const cv::Mat& right_truth) {
  if (truth.type() != CV_32FC1 || (!right_truth.empty() && (right_truth.type() != CV_32FC1 ||
                                                            right_truth.size() != truth.size()))) {
    throw std::invalid_argument("nonOccluded: needs CV_32FC1 maps of equal size");
  }
  cv::Mat out = cv::Mat::zeros(truth.size(), CV_8UC1);
  std::vector<float> nearest;
  for (int y = 0; y < truth.rows; ++y) {
    const float* d = truth.ptr<float>(y);
    if (right_truth.empty()) carry(d, truth.cols, nearest);
    for (int x = 0; x < truth.cols; ++x) {
      if (std::isnan(d[x])) continue;
      const int to = static_cast<int>(std::lround(static_cast<float>(x) - d[x]));
      if (!inside(to, truth.cols)) continue;
      const bool seen = right_truth.empty()
                            ? d[x] >= nearest[static_cast<std::size_t>(to)] - kSameSurface
                            : confirmed(right_truth.ptr<float>(y), truth.cols, x, d[x]);
      if (seen) out.at<std::uint8_t>(y, x) = 255;
    }
  }
  return out;
}

cv::Mat nearDepthSteps(const cv::Mat& truth, const cv::Mat& occluded, double gap_px, int width_px) {
  if (truth.type() != CV_32FC1 || occluded.type() != CV_8UC1 || occluded.size() != truth.size()) {
    throw std::invalid_argument("nearDepthSteps: needs CV_32FC1 and CV_8UC1 of equal size");
  }
  cv::Mat steps = occluded.clone();
  const auto mark = [&](int y, int x, int other_y, int other_x) {
    // NaN compares false: the rim of the unknown is no step.
    if (!(std::abs(truth.at<float>(y, x) - truth.at<float>(other_y, other_x)) >= gap_px)) return;
    steps.at<std::uint8_t>(y, x) = 255;
    steps.at<std::uint8_t>(other_y, other_x) = 255;
  };
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      if (x + 1 < truth.cols) mark(y, x, y, x + 1);
      if (y + 1 < truth.rows) mark(y, x, y + 1, x);
    }
  }
  cv::Mat out;
  cv::dilate(steps, out, cv::Mat::ones(width_px, width_px, CV_8UC1));
  return out;
}

}  // namespace scanner::evaluation
