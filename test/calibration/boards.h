#pragma once

#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <vector>

#include "scanner/calibration/stereo_calibration.h"

/// A pair of cameras that is known exactly, and boards before it.
namespace scanner::calibration::boards {

struct TrueRig {
  cv::Size size = {640, 480};
  std::array<cv::Mat, 2> K, D;
  cv::Mat rotation, translation;  ///< left camera to right camera, 3x1

  double baseline() const { return cv::norm(translation); }
};

/// Pose of a board: to the left camera.
struct Pose {
  cv::Vec3d rotation, translation;
};

inline cv::Mat cameraMatrix(double fx, double fy, double cx, double cy) {
  return (cv::Mat_<double>(3, 3) << fx, 0, cx, 0, fy, cy, 0, 0, 1);
}

/// Not quite the same eyes, not quite parallel.
inline TrueRig usualRig() {
  TrueRig rig;
  rig.K = {cameraMatrix(524.6, 526.1, 312.5, 247.4), cameraMatrix(526.4, 525.7, 318.4, 245.9)};
  rig.D = {(cv::Mat_<double>(1, 5) << -0.3625, 0.1753, 0, 0, 0),
           (cv::Mat_<double>(1, 5) << -0.3530, 0.1630, 0, 0, 0)};
  rig.rotation = (cv::Mat_<double>(3, 1) << 0.003, -0.0075, -0.0021);
  rig.translation = (cv::Mat_<double>(3, 1) << -0.12004, 0.0009, -0.0008);
  return rig;
}

inline Board usualBoard() { return {9, 6, 0.03}; }

inline std::vector<cv::Point3d> corners(const Board& board) {
  std::vector<cv::Point3d> points;
  for (int r = 0; r < board.rows; ++r) {
    for (int c = 0; c < board.columns; ++c) {
      points.emplace_back(c * board.square_m, r * board.squareHeight(), 0.0);
    }
  }
  return points;
}

inline std::vector<cv::Point2f> project(const TrueRig& rig, int eye, const Board& board,
                                        const Pose& pose) {
  cv::Mat rotation(pose.rotation), translation(pose.translation);
  if (eye == 1) {
    cv::composeRT(pose.rotation, pose.translation, rig.rotation, rig.translation, rotation,
                  translation);
  }
  const auto e = static_cast<std::size_t>(eye);
  std::vector<cv::Point2d> exact;
  cv::projectPoints(corners(board), rotation, translation, rig.K[e], rig.D[e], exact);
  return {exact.begin(), exact.end()};
}

inline BoardObservation observe(const TrueRig& rig, const Board& board, const Pose& pose,
                                const std::string& name) {
  BoardObservation o;
  o.name = name;
  o.left = project(rig, 0, board, pose);
  o.right = project(rig, 1, board, pose);
  return o;
}

/// The board's middle at `middle`, turned by `rotation`.
inline Pose poseAt(const Board& board, const cv::Vec3d& rotation, const cv::Vec3d& middle) {
  cv::Matx33d R;
  cv::Rodrigues(rotation, R);
  const cv::Vec3d half(0.5 * (board.columns - 1) * board.square_m,
                       0.5 * (board.rows - 1) * board.squareHeight(), 0.0);
  return {rotation, middle - R * half};
}

inline bool inside(const std::vector<cv::Point2f>& points, const cv::Rect2d& where) {
  for (const cv::Point2f& p : points) {
    if (!where.contains(cv::Point2d(p))) return false;
  }
  return true;
}

/// Where boards may be.
struct Spread {
  double tilt_deg = 35.0;
  double nearest_m = 0.45, farthest_m = 0.8;
  double share = 0.97;  ///< of the picture's width and height, about its middle
};

/// Poses by chance whose boards both eyes see whole.
inline std::vector<Pose> chancePoses(const TrueRig& rig, const Board& board, std::size_t count,
                                     const Spread& spread, unsigned seed) {
  std::mt19937 generator(seed);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
  };
  const double w = rig.size.width, h = rig.size.height, edge = 0.5 * (1.0 - spread.share);
  const cv::Rect2d where(edge * w, edge * h, spread.share * w, spread.share * h);
  const double tilt = spread.tilt_deg * CV_PI / 180.0;
  std::vector<Pose> poses;
  while (poses.size() < count) {
    const double z = between(spread.nearest_m, spread.farthest_m);
    const cv::Vec3d middle(between(-0.8, 0.8) * z, between(-0.6, 0.6) * z, z);
    const cv::Vec3d rotation(between(-tilt, tilt), between(-tilt, tilt), between(-0.3, 0.3));
    const Pose pose = poseAt(board, rotation, middle);
    if (inside(project(rig, 0, board, pose), where) &&
        inside(project(rig, 1, board, pose), where)) {
      poses.push_back(pose);
    }
  }
  return poses;
}

/// Normal noise of `sigma_px` on every coordinate.
inline void addNoise(std::vector<BoardObservation>& observations, double sigma_px, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<float> noise(0.0f, static_cast<float>(sigma_px));
  for (BoardObservation& o : observations) {
    for (auto* points : {&o.left, &o.right}) {
      for (cv::Point2f& p : *points) {
        p.x += noise(generator);
        p.y += noise(generator);
      }
    }
  }
}

inline std::vector<BoardObservation> chanceViews(const TrueRig& rig, const Board& board,
                                                 std::size_t count, double sigma_px, unsigned seed,
                                                 const Spread& spread = {}) {
  std::vector<BoardObservation> observations;
  for (const Pose& pose : chancePoses(rig, board, count, spread, seed)) {
    const std::string number = std::to_string(observations.size() + 1);
    observations.push_back(observe(rig, board, pose, "view" + number));
  }
  if (sigma_px > 0.0) addNoise(observations, sigma_px, seed + 1000);
  return observations;
}

/// A picture of the board with a white border of one square on a grey desk, by 3x3 rays a pixel and
/// a lens that is not sharper than its pixels.
inline cv::Mat render(const TrueRig& rig, int eye, const Board& board, const Pose& pose) {
  constexpr int kRays = 3;
  const auto e = static_cast<std::size_t>(eye);
  cv::Mat rotation(pose.rotation), translation(pose.translation), R;
  if (eye == 1) {
    cv::composeRT(pose.rotation, pose.translation, rig.rotation, rig.translation, rotation,
                  translation);
  }
  cv::Rodrigues(rotation, R);
  // A ray (x, y, 1) meets the board's plane where H^-1 (x, y, 1) says.
  cv::Mat H;
  cv::hconcat(
      std::vector<cv::Mat>{R.col(0) * board.square_m, R.col(1) * board.squareHeight(), translation},
      H);
  const cv::Matx33d to_board(cv::Mat(H.inv()));
  std::vector<cv::Point2d> pixels, rays;
  for (int i = 0; i < rig.size.area() * kRays * kRays; ++i) {
    const int pixel = i / (kRays * kRays), ray = i % (kRays * kRays);
    pixels.emplace_back(pixel % rig.size.width + (ray % kRays + 0.5) / kRays - 0.5,
                        pixel / rig.size.width + (ray / kRays + 0.5) / kRays - 0.5);
  }
  const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 30, 1e-7);
  cv::undistortPoints(pixels, rays, rig.K[e], rig.D[e], cv::noArray(), cv::noArray(), stop);
  cv::Mat picture(rig.size, CV_8UC1);
  for (int p = 0; p < rig.size.area(); ++p) {
    double sum = 0.0;
    for (int i = p * kRays * kRays; i < (p + 1) * kRays * kRays; ++i) {
      const cv::Point2d& ray = rays[static_cast<std::size_t>(i)];
      const cv::Vec3d on = to_board * cv::Vec3d(ray.x, ray.y, 1.0);
      const double u = std::floor(on[0] / on[2]), v = std::floor(on[1] / on[2]);
      const bool square = u >= -1 && v >= -1 && u < board.columns && v < board.rows;
      const bool paper = u >= -2 && v >= -2 && u < board.columns + 1 && v < board.rows + 1;
      const bool black = square && static_cast<int>(std::abs(u + v)) % 2 == 0;
      sum += !paper ? 110.0 : (black ? 25.0 : 225.0);
    }
    picture.at<uchar>(p / rig.size.width, p % rig.size.width) =
        cv::saturate_cast<uchar>(sum / (kRays * kRays));
  }
  cv::GaussianBlur(picture, picture, {}, 0.7);
  return picture;
}

}  // namespace scanner::calibration::boards
