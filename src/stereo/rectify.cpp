#include "scanner/stereo/rectify.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <string>

#include "scanner/core/parallel.h"
#include "stereo/rectify_planes.h"
#include "stereo/rectify_simd.h"

namespace scanner::stereo {
namespace {

constexpr std::size_t kRowsPerChunk = 16;

void requireKnownDistortion(const CameraModel& camera, const std::string& side) {
  const std::size_t n = camera.D.size();
  const std::string& model = camera.distortion_model;
  bool known = false;
  if (model == "plumb_bob") known = n == 0 || n == 4 || n == 5;
  if (model == "rational_polynomial") known = n == 8 || n == 12 || n == 14;
  if (model == "equidistant") known = n == 4;
  if (!known) {
    throw ConfigurationError(side + " camera: distortion model '" + model + "' with " +
                             std::to_string(n) +
                             " coefficients; known are plumb_bob (0, 4 or 5), rational_polynomial "
                             "(8, 12 or 14) and equidistant (4)");
  }
}

/// Weights of cubic convolution (Keys, a = -1/2) for the samples at -1, 0, 1, 2. Rounded to 1/2^14
/// so that their sum is one: a flat image stays what it is.
simd::CubicWeights makeCubicWeights() {
  simd::CubicWeights weights{};
  constexpr double kOne = 1 << 14;
  const auto pair = [](int a, int b) {
    return static_cast<std::int32_t>((static_cast<std::uint32_t>(b) << 16) |
                                     (static_cast<std::uint32_t>(a) & 0xFFFFU));
  };
  for (int i = 0; i < simd::kPhases; ++i) {
    const double t = static_cast<double>(i) / simd::kPhases, t2 = t * t, t3 = t2 * t;
    const int before = static_cast<int>(std::lround(kOne * (-0.5 * t3 + t2 - 0.5 * t)));
    const int right = static_cast<int>(std::lround(kOne * (-1.5 * t3 + 2.0 * t2 + 0.5 * t)));
    const int after = static_cast<int>(std::lround(kOne * (0.5 * t3 - 0.5 * t2)));
    weights.first[i] = pair(before, (1 << 14) - before - right - after);
    weights.second[i] = pair(right, after);
  }
  return weights;
}

const simd::CubicWeights& cubicWeights() {
  static const simd::CubicWeights weights = makeCubicWeights();
  return weights;
}

/// A position in steps of 1/1024 px, at most two pixels outside: beyond, the edge is repeated, and
/// a strong distortion model can throw far pixels to infinity or to no number at all.
int fixedPosition(float position, int size) {
  const double bounded = std::isnan(position)
                             ? -2.0
                             : std::clamp(static_cast<double>(position), -2.0, size + 1.0 - 1e-3);
  return static_cast<int>(std::lround(bounded * simd::kPhases));
}

cv::Mat validMask(const cv::Mat& map_x, const cv::Mat& map_y) {
  cv::Mat valid(map_x.size(), CV_8UC1);
  const float right = static_cast<float>(map_x.cols - 1);
  const float bottom = static_cast<float>(map_x.rows - 1);
  for (int v = 0; v < valid.rows; ++v) {
    for (int u = 0; u < valid.cols; ++u) {
      const float x = map_x.at<float>(v, u), y = map_y.at<float>(v, u);
      const bool inside = x >= 0.0f && y >= 0.0f && x <= right && y <= bottom;
      valid.at<std::uint8_t>(v, u) = inside ? 255 : 0;
    }
  }
  return valid;
}

Status checkImage(const Image& image, const CameraModel& camera, const std::string& side) {
  const auto invalid = [&](const std::string& what) {
    return Status(StatusCode::kInvalidInput, side + " image " + what);
  };
  if (image.data.empty()) return invalid("is empty");
  if (image.data.cols != camera.width || image.data.rows != camera.height) {
    return invalid("is " + std::to_string(image.data.cols) + "x" + std::to_string(image.data.rows) +
                   ", the calibration is for " + std::to_string(camera.width) + "x" +
                   std::to_string(camera.height));
  }
  const int wanted = image.format == PixelFormat::kBgr8 ? CV_8UC3 : CV_8UC1;
  if (image.data.type() != wanted) {
    return invalid("has pixel type " + cv::typeToString(image.data.type()) + ", format " +
                   toString(image.format) + " needs " + cv::typeToString(wanted));
  }
  return Status::ok();
}

}  // namespace

Rectifier::Eye Rectifier::makeEye(const CameraModel& camera) {
  cv::Mat K, R, P, x, y;
  cv::eigen2cv(camera.K, K);
  cv::eigen2cv(camera.R, R);
  cv::eigen2cv(Eigen::Matrix3d(camera.P.leftCols<3>()), P);
  const cv::Size size(camera.width, camera.height);
  if (camera.distortion_model == "equidistant") {
    cv::fisheye::initUndistortRectifyMap(K, camera.D, R, P, size, CV_32FC1, x, y);
  } else {
    cv::initUndistortRectifyMap(K, camera.D, R, P, size, CV_32FC1, x, y);
  }
  Eye eye;
  eye.valid = validMask(x, y);
  const std::size_t pixels = eye.valid.total() + simd::kRectifyOverrun;
  eye.index.assign(pixels, 0);
  eye.phase.assign(pixels, 0);
  eye.identity = true;
  RawPlanes planes;
  planes.stride = RawPlanes::strideFor(size.width);
  std::size_t i = 0;
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u, ++i) {
      const int fx = fixedPosition(x.at<float>(v, u), size.width);
      const int fy = fixedPosition(y.at<float>(v, u), size.height);
      // Right shift of a negative number rounds down, as wanted.
      const int left = fx >> simd::kPhaseBits, above = fy >> simd::kPhaseBits;
      eye.index[i] = static_cast<std::int32_t>(planes.index(left - 1, above - 1));
      eye.phase[i] = static_cast<std::uint32_t>(fx & (simd::kPhases - 1)) |
                     static_cast<std::uint32_t>(fy & (simd::kPhases - 1)) << 16;
      if (left != u || above != v || eye.phase[i] != 0) eye.identity = false;
    }
  }
  return eye;
}

Rectifier::Rectifier(const StereoCalibration& calibration) : calibration_(calibration) {
  const Status status = scanner::validate(calibration);
  if (!status) throw ConfigurationError(status.message());
  requireKnownDistortion(calibration.left, "left");
  requireKnownDistortion(calibration.right, "right");
  left_ = makeEye(calibration.left);
  right_ = makeEye(calibration.right);
}

cv::Mat Rectifier::rectifyEye(const Eye& eye, const Image& image, int threads, cv::Mat* color) {
  const cv::Size size = image.data.size();
  const bool mono = image.format == PixelFormat::kMono8;
  const bool copy = mono && eye.identity;
  const RawPlanes planes = copy ? RawPlanes() : makePlanes(image, color != nullptr, threads);
  cv::Mat gray(size, CV_8UC1);
  if (color != nullptr) color->create(size, CV_8UC3);
  const auto width = static_cast<std::size_t>(size.width);
  parallelFor(
      static_cast<std::size_t>(size.height), kRowsPerChunk, threads,
      [&](std::size_t begin, std::size_t end) {
        // The kernels write beyond the row's end.
        std::vector<std::uint8_t> line(width + simd::kRectifyOverrun), pixels;
        if (color != nullptr && !mono) pixels.resize(4 * (width + simd::kRectifyOverrun));
        std::vector<std::uint8_t> valid(width + simd::kRectifyOverrun);
        for (std::size_t row = begin; row < end; ++row) {
          const int v = static_cast<int>(row);
          std::uint8_t* to = gray.ptr<std::uint8_t>(v);
          const simd::ResampleRow at{eye.index.data() + row * width, eye.phase.data() + row * width,
                                     planes.stride};
          if (copy) {
            std::memcpy(to, image.data.ptr<std::uint8_t>(v), width);
          } else {
            if (eye.identity) {
              simd::roundGrayRow(&planes.gray[planes.index(0, v)], width, line.data());
            } else {
              simd::cubicGrayRow(at, cubicWeights(), planes.gray.data(), width, line.data());
            }
            std::memcpy(to, line.data(), width);
          }
          if (color == nullptr) continue;
          std::uint8_t* bgr = color->ptr<std::uint8_t>(v);
          if (mono) {
            simd::replicateGrayRow(to, width, bgr);
          } else if (eye.identity) {
            simd::packBgrRow(&planes.bgrx[4 * planes.index(0, v)], width, bgr);
          } else {
            std::memcpy(valid.data(), eye.valid.ptr<std::uint8_t>(v), width);
            simd::bilinearColorRow(at, planes.bgrx.data(), valid.data(), width, pixels.data());
            simd::packBgrRow(pixels.data(), width, bgr);
          }
        }
      });
  return gray;
}

Result<RectifiedPair> Rectifier::rectify(const StereoFrame& frame, int threads) const {
  Status status = checkImage(frame.left, calibration_.left, "left");
  if (status) status = checkImage(frame.right, calibration_.right, "right");
  if (!status) return status;
  if (frame.left.format != frame.right.format) {
    return Status(StatusCode::kInvalidInput, std::string("left image is ") +
                                                 toString(frame.left.format) + ", right image is " +
                                                 toString(frame.right.format));
  }
  RectifiedPair pair;
  pair.stamp = frame.stamp;
  pair.left_gray = rectifyEye(left_, frame.left, threads, &pair.left_color);
  pair.right_gray = rectifyEye(right_, frame.right, threads, nullptr);
  pair.left_valid = left_.valid;
  pair.right_valid = right_.valid;
  return pair;
}

}  // namespace scanner::stereo
