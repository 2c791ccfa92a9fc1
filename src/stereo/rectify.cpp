#include "scanner/stereo/rectify.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

namespace scanner::stereo {
namespace {

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

/// Weights of cubic convolution (Keys, a = -1/2) for the samples at -1, 0, 1, 2.
inline void cubicWeights(float t, float w[4]) {
  const float t2 = t * t, t3 = t2 * t;
  w[0] = -0.5f * t3 + t2 - 0.5f * t;
  w[1] = 1.5f * t3 - 2.5f * t2 + 1.0f;
  w[2] = -1.5f * t3 + 2.0f * t2 + 0.5f * t;
  w[3] = 0.5f * t3 - 0.5f * t2;
}

float sampleClamped(const cv::Mat& image, int x0, int y0, const float wx[4], const float wy[4]) {
  float sum = 0.0f;
  for (int j = 0; j < 4; ++j) {
    const float* row = image.ptr<float>(std::clamp(y0 - 1 + j, 0, image.rows - 1));
    float line = 0.0f;
    for (int i = 0; i < 4; ++i) line += wx[i] * row[std::clamp(x0 - 1 + i, 0, image.cols - 1)];
    sum += wy[j] * line;
  }
  return sum;
}

float sampleInside(const cv::Mat& image, int x0, int y0, const float wx[4], const float wy[4]) {
  float sum = 0.0f;
  for (int j = 0; j < 4; ++j) {
    const float* p = image.ptr<float>(y0 - 1 + j) + x0 - 1;
    sum += wy[j] * (wx[0] * p[0] + wx[1] * p[1] + wx[2] * p[2] + wx[3] * p[3]);
  }
  return sum;
}

/// Resamples at float coordinates. Outside the image the edge is repeated, so that no false edge
/// appears there; the valid mask says which pixels those are.
cv::Mat resampleGray(const cv::Mat& raw, const cv::Mat& map_x, const cv::Mat& map_y) {
  cv::Mat out(map_x.size(), CV_8UC1);
  for (int v = 0; v < out.rows; ++v) {
    const float* mx = map_x.ptr<float>(v);
    const float* my = map_y.ptr<float>(v);
    std::uint8_t* to = out.ptr<std::uint8_t>(v);
    for (int u = 0; u < out.cols; ++u) {
      // A strong distortion model can throw far pixels to infinity.
      const float x = std::clamp(mx[u], -2.0f, static_cast<float>(raw.cols + 1));
      const float y = std::clamp(my[u], -2.0f, static_cast<float>(raw.rows + 1));
      const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
      float wx[4], wy[4];
      cubicWeights(x - static_cast<float>(x0), wx);
      cubicWeights(y - static_cast<float>(y0), wy);
      const bool inside = x0 >= 1 && y0 >= 1 && x0 + 2 < raw.cols && y0 + 2 < raw.rows;
      const float value =
          inside ? sampleInside(raw, x0, y0, wx, wy) : sampleClamped(raw, x0, y0, wx, wy);
      to[u] = static_cast<std::uint8_t>(std::clamp(value + 0.5f, 0.0f, 255.0f));
    }
  }
  return out;
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

cv::Mat matchingGray(const Image& image) {
  cv::Mat gray;
  if (isBayer(image.format)) {
    const cv::Mat kernel = (cv::Mat_<float>(1, 3) << 0.25f, 0.5f, 0.25f);
    // Reflection about the edge pixel keeps the colour pattern going.
    cv::sepFilter2D(image.data, gray, CV_32F, kernel, kernel, cv::Point(-1, -1), 0.0,
                    cv::BORDER_REFLECT_101);
    return gray;
  }
  if (image.format == PixelFormat::kBgr8) {
    cv::Mat gray8;
    cv::cvtColor(image.data, gray8, cv::COLOR_BGR2GRAY);
    gray8.convertTo(gray, CV_32F);
    return gray;
  }
  image.data.convertTo(gray, CV_32F);
  return gray;
}

cv::Mat toBgr(const Image& image) {
  if (image.format == PixelFormat::kBgr8) return image.data;
  // OpenCV names a Bayer pattern by the second row's second and third pixel.
  int code = cv::COLOR_GRAY2BGR;
  if (image.format == PixelFormat::kBayerRggb8) code = cv::COLOR_BayerBG2BGR_EA;
  if (image.format == PixelFormat::kBayerBggr8) code = cv::COLOR_BayerRG2BGR_EA;
  if (image.format == PixelFormat::kBayerGbrg8) code = cv::COLOR_BayerGR2BGR_EA;
  if (image.format == PixelFormat::kBayerGrbg8) code = cv::COLOR_BayerGB2BGR_EA;
  cv::Mat bgr;
  cv::cvtColor(image.data, bgr, code);
  return bgr;
}

Rectifier::Eye Rectifier::makeEye(const CameraModel& camera) {
  cv::Mat K, R, P;
  cv::eigen2cv(camera.K, K);
  cv::eigen2cv(camera.R, R);
  cv::eigen2cv(Eigen::Matrix3d(camera.P.leftCols<3>()), P);
  const cv::Size size(camera.width, camera.height);
  Eye eye;
  if (camera.distortion_model == "equidistant") {
    cv::fisheye::initUndistortRectifyMap(K, camera.D, R, P, size, CV_32FC1, eye.x, eye.y);
  } else {
    cv::initUndistortRectifyMap(K, camera.D, R, P, size, CV_32FC1, eye.x, eye.y);
  }
  cv::convertMaps(eye.x, eye.y, eye.fixed, eye.fixed_part, CV_16SC2);
  eye.valid = validMask(eye.x, eye.y);
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

Result<RectifiedPair> Rectifier::rectify(const StereoFrame& frame) const {
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
  pair.left_gray = resampleGray(matchingGray(frame.left), left_.x, left_.y);
  pair.right_gray = resampleGray(matchingGray(frame.right), right_.x, right_.y);
  cv::remap(toBgr(frame.left), pair.left_color, left_.fixed, left_.fixed_part, cv::INTER_LINEAR,
            cv::BORDER_CONSTANT);
  pair.left_valid = left_.valid;
  pair.right_valid = right_.valid;
  return pair;
}

}  // namespace scanner::stereo
