#include "calibration/stereo_fit.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

namespace scanner::calibration {
namespace {

bool plausible(const StereoFit& fit, cv::Size size) {
  for (int eye = 0; eye < 2; ++eye) {
    const cv::Mat& K = fit.K[static_cast<std::size_t>(eye)];
    const cv::Mat& D = fit.D[static_cast<std::size_t>(eye)];
    if (!cv::checkRange(K) || !cv::checkRange(D)) return false;
    const double f = K.at<double>(0, 0) / size.width;
    if (f < 0.1 || f > 50.0) return false;
  }
  return cv::checkRange(fit.R) && cv::checkRange(fit.t) && std::isfinite(fit.rms_px);
}

double radialFactor(const cv::Mat& D, double r) {
  const auto k = [&](int i) { return i < D.cols ? D.at<double>(i) : 0.0; };
  const double r2 = r * r;
  return (1.0 + r2 * (k(0) + r2 * (k(1) + r2 * k(4)))) /
         (1.0 + r2 * (k(5) + r2 * (k(6) + r2 * k(7))));
}

bool growsUntil(const cv::Mat& D, double farthest) {
  constexpr double kStep = 0.002;
  constexpr double kLast = 20.0;  // 87 degrees off the axis
  double before = 0.0;
  for (double r = kStep; r < kLast; r += kStep) {
    const double now = r * radialFactor(D, r);
    if (!(now > before)) return false;
    if (now >= farthest) return true;
    before = now;
  }
  return false;
}

std::array<cv::Point2d, 4> pictureCorners(cv::Size size) {
  const double w = size.width - 1.0, h = size.height - 1.0;
  return {cv::Point2d(0, 0), cv::Point2d(w, 0), cv::Point2d(0, h), cv::Point2d(w, h)};
}

Bundle bundleOf(const StereoFit& fit) {
  Bundle bundle;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    bundle.K[eye] = fit.K[eye].clone();
    bundle.D[eye] = fit.D[eye].clone();
  }
  cv::Rodrigues(fit.R, bundle.rotation);
  bundle.translation = cv::Vec3d(fit.t);
  return bundle;
}

}  // namespace

std::optional<StereoFit> fitStereo(const Views& views, const Board& board, cv::Size size,
                                   Distortion distortion, const StereoFit* start) {
  Bundle bundle;
  if (start != nullptr) {
    bundle = bundleOf(*start);
    for (const BoardObservation* view : views) {
      bundle.poses.push_back(fitBoard(*view, board, *start).pose);
    }
  } else {
    const auto guess = firstGuess(views, board, size);
    if (!guess) return std::nullopt;
    bundle = *guess;
    // A stiff model leads the way to a free one.
    adjust(views, board, Distortion::kK1, bundle);
  }
  const int length = distortion == Distortion::kRationalP1P2 ? 8 : 5;
  for (cv::Mat& D : bundle.D) {
    cv::Mat longer = cv::Mat::zeros(1, length, CV_64F);
    D.copyTo(longer.colRange(0, D.cols));
    if (start == nullptr && length == 8) {
      // By the denominator: it has no pole where it starts, and fits that grow one are worthless.
      longer.at<double>(5) = -longer.at<double>(0);
      longer.at<double>(0) = 0.0;
    }
    D = longer;
  }
  const double squares = adjust(views, board, distortion, bundle);
  StereoFit fit;
  fit.distortion = distortion;
  fit.K = bundle.K;
  fit.D = bundle.D;
  cv::Rodrigues(bundle.rotation, fit.R);
  fit.t = cv::Mat(bundle.translation).clone();
  const double corners = 2.0 * static_cast<double>(views.size()) * board.columns * board.rows;
  fit.rms_px = std::sqrt(squares / corners);
  if (!plausible(fit, size)) return std::nullopt;
  return fit;
}

BoardFit fitBoard(const BoardObservation& view, const Board& board, const StereoFit& fit) {
  BoardFit result;
  result.pose = poseOf(view.left, board, fit.K[0], fit.D[0]);
  std::array<std::vector<cv::Point2d>, 2> projected;
  adjustPose(view, board, bundleOf(fit), result.pose, projected);
  for (std::size_t eye = 0; eye < 2; ++eye) {
    const auto& measured = corners(view, static_cast<int>(eye));
    for (std::size_t i = 0; i < measured.size(); ++i) {
      const cv::Point2d r = cv::Point2d(measured[i]) - projected[eye][i];
      result.residual[eye].emplace_back(r);
      result.mean_square[eye] += r.dot(r) / static_cast<double>(measured.size());
    }
  }
  return result;
}

bool oneToOne(const StereoFit& fit, cv::Size size) {
  for (std::size_t eye = 0; eye < 2; ++eye) {
    const cv::Mat& K = fit.K[eye];
    double farthest = 0.0;
    for (const cv::Point2d& p : pictureCorners(size)) {
      farthest = std::max(farthest, std::hypot((p.x - K.at<double>(0, 2)) / K.at<double>(0, 0),
                                               (p.y - K.at<double>(1, 2)) / K.at<double>(1, 1)));
    }
    if (!growsUntil(fit.D[eye], farthest)) return false;
  }
  return true;
}

std::vector<cv::Point2d> cornerRays(const StereoFit& fit, cv::Size size) {
  std::vector<cv::Point2d> rays;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    std::vector<cv::Point2d> pixels = {{0.5 * (size.width - 1), 0.5 * (size.height - 1)}};
    for (const cv::Point2d& p : pictureCorners(size)) pixels.push_back(p);
    std::vector<cv::Point2d> out;
    cv::undistortPoints(
        pixels, out, fit.K[eye], fit.D[eye], cv::noArray(), cv::noArray(),
        cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-12));
    const double f = fit.K[eye].at<double>(0, 0);
    for (std::size_t i = 1; i < out.size(); ++i) rays.push_back((out[i] - out[0]) * f);
  }
  return rays;
}

}  // namespace scanner::calibration
