#include "calibration/views.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>

#include "calibration/selection.h"
#include "calibration/text.h"

namespace scanner::calibration {
namespace {

constexpr double kDegrees = 180.0 / 3.14159265358979323846;

double coverage(const Views& views, int eye, cv::Size size) {
  std::vector<cv::Point2f> all, hull;
  for (const BoardObservation* view : views) {
    all.insert(all.end(), corners(*view, eye).begin(), corners(*view, eye).end());
  }
  cv::convexHull(all, hull);
  return cv::contourArea(hull) / (static_cast<double>(size.width) * size.height);
}

/// A board that looks the same turned by 180 degrees has an arbitrary origin, so places are those
/// of its middle and angles those between normals and between lines.
bool alike(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, const Eigen::Vector3d& middle) {
  constexpr double kAngle = 5.0 / kDegrees, kShift = 0.05;
  const Eigen::Vector3d at_a = a * middle, at_b = b * middle;
  if ((at_a - at_b).norm() > kShift * at_a.norm()) return false;
  const auto between = [&](int axis) {
    return std::acos(std::min(1.0, std::abs(a.linear().col(axis).dot(b.linear().col(axis)))));
  };
  return between(2) < kAngle && between(0) < kAngle;
}

}  // namespace

const char* const kTakeMore =
    "take more, with the board tilted by 20 to 45 degrees to all sides, near and far, and in every "
    "corner of the picture";

Eigen::Isometry3d pose(const cv::Mat& rotation, const cv::Mat& translation) {
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
  cv::cv2eigen(rotation, R);
  cv::cv2eigen(translation, t);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = R;
  T.translation() = t;
  return T;
}

Eigen::Isometry3d pose(const BoardPose& board) {
  cv::Mat R;
  cv::Rodrigues(board.rotation, R);
  return pose(R, cv::Mat(board.translation));
}

ViewDiversity diversity(const Views& views, const Board& board, cv::Size size,
                        const StereoFit& fit) {
  ViewDiversity d;
  const Eigen::Vector3d middle(0.5 * (board.columns - 1) * board.square_m,
                               0.5 * (board.rows - 1) * board.squareHeight(), 0.0);
  std::vector<Eigen::Isometry3d> poses, distinct;
  for (const BoardObservation* view : views) {
    const BoardFit fitted = fitBoard(*view, board, fit);
    const Eigen::Isometry3d now = pose(fitted.pose);
    for (const Eigen::Isometry3d& other : poses) {
      const double cosine = std::abs(now.linear().col(2).dot(other.linear().col(2)));
      d.tilt_deg = std::max(d.tilt_deg, std::acos(std::min(1.0, cosine)) * kDegrees);
    }
    poses.push_back(now);
    const bool seen = std::any_of(distinct.begin(), distinct.end(),
                                  [&](const auto& other) { return alike(other, now, middle); });
    if (!seen) distinct.push_back(now);
  }
  d.distinct = static_cast<int>(distinct.size());
  d.left_coverage = coverage(views, 0, size);
  d.right_coverage = coverage(views, 1, size);
  return d;
}

Status checkDiversity(const ViewDiversity& d, const StereoCalibrationOptions& o) {
  std::string why;
  if (d.distinct < o.min_views) {
    why = format(
        "only %d of them differ by more than 5 deg or 5 %% of the distance, at least %d "
        "must",
        d.distinct, o.min_views);
  } else if (d.tilt_deg < o.min_tilt_deg) {
    why = format(
        "the boards are tilted against each other by %.1f deg at most, at least %.0f deg "
        "are needed",
        d.tilt_deg, o.min_tilt_deg);
  } else if (std::min(d.left_coverage, d.right_coverage) < o.min_coverage) {
    why = format("the boards cover %.0f %% of the %s picture, at least %.0f %% are needed",
                 100.0 * std::min(d.left_coverage, d.right_coverage),
                 d.left_coverage < d.right_coverage ? "left" : "right", 100.0 * o.min_coverage);
  }
  if (why.empty()) return Status::ok();
  return {StatusCode::kNotEnoughData, "the views are too alike: " + why + "; " + kTakeMore};
}

Status checkEyes(const StereoFit& fit) {
  const double x = fit.t.at<double>(0), y = fit.t.at<double>(1), z = fit.t.at<double>(2);
  if (std::abs(x) < std::hypot(y, z)) {
    return {
        StatusCode::kInvalidInput,
        format("the cameras do not stand side by side: the right one lies (%.1f, %.1f, %.1f) mm "
               "(right, down, ahead) from the left one",
               -1e3 * x, -1e3 * y, -1e3 * z)};
  }
  if (x > 0.0) {
    return {StatusCode::kInvalidInput,
            format("left and right are swapped: the camera of the right pictures stands %.1f mm to "
                   "the left of the other; exchange the pictures",
                   1e3 * x)};
  }
  return Status::ok();
}

Result<Screening> screen(const std::vector<BoardObservation>& observations, const Board& board,
                         cv::Size size, const StereoCalibrationOptions& options, int threads) {
  // The full polynomial, so that no view is blamed for what a simple model cannot follow.
  const bool automatic = options.distortion == Distortion::kAutomatic;
  const Distortion model = automatic ? Distortion::kK1K2P1P2K3 : options.distortion;
  Screening s;
  s.notes.resize(observations.size());
  for (const BoardObservation& o : observations) s.used.push_back(&o);
  const auto most = static_cast<std::size_t>(options.max_left_out_share *
                                             static_cast<double>(observations.size()));
  while (true) {
    const auto fit = fitStereo(s.used, board, size, model, nullptr);
    if (!fit) {
      return Status(StatusCode::kNoConvergence,
                    "the views do not determine the cameras: " + std::string(kTakeMore));
    }
    auto bad = findOutlier(s.used, board, size, *fit, options, threads);
    if (bad && automatic) {
      // A wide lens that no polynomial follows is not the view's fault either.
      const auto wide = fitStereo(s.used, board, size, Distortion::kRationalP1P2, nullptr);
      if (wide) bad = findOutlier(s.used, board, size, *wide, options, threads);
    }
    if (!bad) return s;
    if (observations.size() - s.used.size() == most) {
      return Status(
          StatusCode::kInvalidInput,
          format("more than %zu of %zu views do not fit one rigid pair of cameras (%s: %.2f px, "
                 "the others %.2f px): are the board's size and the pairing of the pictures right, "
                 "was the board flat and nothing moving?",
                 most, observations.size(), s.used[bad->index]->name.c_str(), bad->miss_px,
                 bad->others_px));
    }
    const auto index = static_cast<std::size_t>(s.used[bad->index] - observations.data());
    s.notes[index] = format(
        "left out: %.2f px off a calibration from the others, which fit to "
        "%.2f px",
        bad->miss_px, bad->others_px);
    s.used.erase(s.used.begin() + static_cast<std::ptrdiff_t>(bad->index));
  }
}

}  // namespace scanner::calibration
