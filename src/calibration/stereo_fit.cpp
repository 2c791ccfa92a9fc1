#include "calibration/stereo_fit.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

namespace scanner::calibration {
namespace {

using Points2 = std::vector<std::vector<cv::Point2f>>;
using Points3 = std::vector<std::vector<cv::Point3f>>;

int flagsOf(Distortion distortion) {
  switch (distortion) {
    case Distortion::kK1:
      return cv::CALIB_FIX_K2 | cv::CALIB_FIX_K3 | cv::CALIB_ZERO_TANGENT_DIST;
    case Distortion::kK1K2:
      return cv::CALIB_FIX_K3 | cv::CALIB_ZERO_TANGENT_DIST;
    case Distortion::kK1K2P1P2:
      return cv::CALIB_FIX_K3;
    case Distortion::kRationalP1P2:
      return cv::CALIB_RATIONAL_MODEL;
    case Distortion::kK1K2P1P2K3:
    case Distortion::kAutomatic:
      break;
  }
  return 0;
}

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

/// First guess for one eye. Zhang's closed form is not defined for boards all parallel to the
/// picture and then gives anything; a usual lens is a better start.
void guessEye(const Points3& object, const Points2& image, cv::Size size, int flags, cv::Mat& K,
              cv::Mat& D) {
  K = cv::initCameraMatrix2D(object, image, size, 1.0);
  const double f = K.at<double>(0, 0) / size.width;
  if (!cv::checkRange(K) || f < 0.2 || f > 20.0) {
    K = (cv::Mat_<double>(3, 3) << size.width, 0, 0.5 * (size.width - 1), 0, size.width,
         0.5 * (size.height - 1), 0, 0, 1);
  }
  D = cv::Mat::zeros(1, (flags & cv::CALIB_RATIONAL_MODEL) != 0 ? 8 : 5, CV_64F);
  std::vector<cv::Mat> r, t;
  const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-9);
  cv::calibrateCamera(object, image, size, K, D, r, t, flags | cv::CALIB_USE_INTRINSIC_GUESS, stop);
}

/// Normal equations of one eye for the six parameters of the board's pose.
double accumulate(const std::vector<cv::Point2f>& measured, const cv::Mat& projected,
                  const cv::Mat& J, cv::Mat& JtJ, cv::Mat& Jtr) {
  cv::Mat residual(static_cast<int>(2 * measured.size()), 1, CV_64F);
  for (int i = 0; i < static_cast<int>(measured.size()); ++i) {
    const cv::Point2f& m = measured[static_cast<std::size_t>(i)];
    const cv::Point2d& p = projected.at<cv::Point2d>(i);
    residual.at<double>(2 * i) = static_cast<double>(m.x) - p.x;
    residual.at<double>(2 * i + 1) = static_cast<double>(m.y) - p.y;
  }
  JtJ += J.t() * J;
  Jtr += J.t() * residual;
  return residual.dot(residual);
}

struct PoseEquations {
  cv::Mat JtJ = cv::Mat::zeros(6, 6, CV_64F);
  cv::Mat Jtr = cv::Mat::zeros(6, 1, CV_64F);
  double squares = 0.0;
  std::array<cv::Mat, 2> projected;
};

PoseEquations equations(const BoardObservation& view, const std::vector<cv::Point3d>& object,
                        const StereoFit& fit, const cv::Mat& rotation, const cv::Mat& translation) {
  PoseEquations e;
  cv::Mat J;
  cv::projectPoints(object, rotation, translation, fit.K[0], fit.D[0], e.projected[0], J);
  e.squares += accumulate(view.left, e.projected[0], J.colRange(0, 6).clone(), e.JtJ, e.Jtr);

  cv::Mat rig_rotation, r, t, dr_dr, dr_dt, dt_dr, dt_dt, unused;
  cv::Rodrigues(fit.R, rig_rotation);
  cv::composeRT(rotation, translation, rig_rotation, fit.t, r, t, dr_dr, dr_dt, unused, unused,
                dt_dr, dt_dt, unused, unused);
  cv::projectPoints(object, r, t, fit.K[1], fit.D[1], e.projected[1], J);
  const cv::Mat by_r = J.colRange(0, 3), by_t = J.colRange(3, 6);
  cv::Mat chained;
  cv::hconcat(cv::Mat(by_r * dr_dr + by_t * dt_dr), cv::Mat(by_r * dr_dt + by_t * dt_dt), chained);
  e.squares += accumulate(view.right, e.projected[1], chained, e.JtJ, e.Jtr);
  return e;
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

}  // namespace

std::vector<cv::Point3f> boardPoints(const Board& board) {
  std::vector<cv::Point3f> points;
  for (int r = 0; r < board.rows; ++r) {
    for (int c = 0; c < board.columns; ++c) {
      points.emplace_back(static_cast<float>(c * board.square_m),
                          static_cast<float>(r * board.squareHeight()), 0.0f);
    }
  }
  return points;
}

std::optional<StereoFit> fitStereo(const Views& views, const Board& board, cv::Size size,
                                   Distortion distortion, const StereoFit* start) {
  const int flags = flagsOf(distortion);
  const Points3 object(views.size(), boardPoints(board));
  std::array<Points2, 2> image;
  for (const BoardObservation* view : views) {
    image[0].push_back(view->left);
    image[1].push_back(view->right);
  }
  StereoFit fit;
  fit.distortion = distortion;
  try {
    for (std::size_t eye = 0; eye < 2; ++eye) {
      if (start != nullptr) {
        fit.K[eye] = start->K[eye].clone();
        fit.D[eye] = start->D[eye].clone();
      } else {
        guessEye(object, image[eye], size, flags, fit.K[eye], fit.D[eye]);
      }
    }
    const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 200, 1e-10);
    cv::Mat E, F;
    // OpenCV's figure is over all corners of both eyes, per corner.
    fit.rms_px =
        cv::stereoCalibrate(object, image[0], image[1], fit.K[0], fit.D[0], fit.K[1], fit.D[1],
                            size, fit.R, fit.t, E, F, flags | cv::CALIB_USE_INTRINSIC_GUESS, stop);
    // Zeros for what the model does not have, whatever length OpenCV chose.
    for (cv::Mat& D : fit.D)
      D = D.reshape(1, 1).colRange(0, flags == cv::CALIB_RATIONAL_MODEL ? 8 : 5).clone();
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
  if (!plausible(fit, size)) return std::nullopt;
  return fit;
}

BoardFit fitBoard(const BoardObservation& view, const Board& board, const StereoFit& fit) {
  constexpr int kIterations = 50;
  constexpr double kConverged = 1e-12;
  std::vector<cv::Point3d> object;
  for (const cv::Point3f& p : boardPoints(board)) object.emplace_back(p);
  BoardFit result;
  cv::solvePnP(object, view.left, fit.K[0], fit.D[0], result.rotation, result.translation);
  PoseEquations now = equations(view, object, fit, result.rotation, result.translation);
  double damping = 1e-6;
  for (int i = 0; i < kIterations && damping < 1e6; ++i) {
    cv::Mat damped = now.JtJ.clone(), step;
    for (int k = 0; k < 6; ++k) damped.at<double>(k, k) *= 1.0 + damping;
    cv::solve(damped, now.Jtr, step, cv::DECOMP_SVD);
    const cv::Mat rotation = result.rotation + step.rowRange(0, 3);
    const cv::Mat translation = result.translation + step.rowRange(3, 6);
    PoseEquations next = equations(view, object, fit, rotation, translation);
    if (!(next.squares < now.squares)) {
      damping *= 10.0;
      continue;
    }
    const bool converged = now.squares - next.squares < kConverged * now.squares;
    result.rotation = rotation;
    result.translation = translation;
    now = next;
    damping = std::max(1e-9, 0.1 * damping);
    if (converged) break;
  }
  for (int eye = 0; eye < 2; ++eye) {
    const auto e = static_cast<std::size_t>(eye);
    const auto& measured = corners(view, eye);
    for (int i = 0; i < static_cast<int>(measured.size()); ++i) {
      const cv::Point2d r =
          cv::Point2d(measured[static_cast<std::size_t>(i)]) - now.projected[e].at<cv::Point2d>(i);
      result.residual[e].emplace_back(r);
      result.mean_square[e] += r.dot(r) / static_cast<double>(measured.size());
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
