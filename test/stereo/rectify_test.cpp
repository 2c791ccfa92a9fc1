#include "scanner/stereo/rectify.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "scanner/core/se3.h"
#include "stereo/synthetic.h"

namespace scanner::stereo {
namespace {

using testing::idealCalibration;
using testing::texture;
using testing::toGray;

/// A rig with distortion and toe-in; the baseline runs along the rectified x axis.
StereoCalibration skewedCalibration(const std::string& model) {
  StereoCalibration c = idealCalibration(320, 240, 300.0, 0.12);
  for (CameraModel* camera : {&c.left, &c.right}) {
    camera->distortion_model = model;
    camera->D = {-0.2, 0.05, 0.001, -0.002, 0.0};
    if (model == "rational_polynomial") camera->D = {-0.2, 0.05, 0.001, 0, 0, 0.02, 0.01, 0.0};
    if (model == "equidistant") camera->D = {-0.02, 0.01, -0.003, 0.001};
  }
  c.left.R = expSo3({0.01, -0.02, 0.015}).toRotationMatrix();
  c.right.R = expSo3({-0.015, 0.02, -0.01}).toRotationMatrix();
  c.right.K(0, 0) = 305.0;
  return c;
}

/// Where a rectified pixel is in the raw image, through OpenCV's projection of a ray.
cv::Point2d rawPixel(const CameraModel& camera, double u, double v) {
  const Eigen::Vector3d rectified((u - camera.P(0, 2)) / camera.P(0, 0),
                                  (v - camera.P(1, 2)) / camera.P(1, 1), 1.0);
  const Eigen::Vector3d ray = camera.R.transpose() * rectified;
  cv::Mat K;
  cv::eigen2cv(camera.K, K);
  const std::vector<cv::Point3d> points{{ray.x(), ray.y(), ray.z()}};
  std::vector<cv::Point2d> projected;
  const cv::Vec3d zero(0, 0, 0);
  if (camera.distortion_model == "equidistant") {
    cv::fisheye::projectPoints(points, projected, zero, zero, K, camera.D);
  } else {
    cv::projectPoints(points, zero, zero, K, camera.D, projected);
  }
  return projected[0];
}

Image grayImage(int width, int height, const std::function<double(int, int)>& value) {
  Image image;
  image.format = PixelFormat::kMono8;
  image.data.create(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image.data.at<std::uint8_t>(y, x) = toGray(value(x, y));
  }
  return image;
}

class RectifyModels : public ::testing::TestWithParam<std::string> {};

TEST_P(RectifyModels, SamplesWhereProjectPointsSays) {
  const StereoCalibration c = skewedCalibration(GetParam());
  const Rectifier rectifier(c);
  const auto raw = [](int x, int y) { return texture(x, y); };
  StereoFrame frame;
  frame.stamp = fromNanoseconds(5);
  frame.left = grayImage(320, 240, raw);
  frame.right = grayImage(320, 240, raw);
  const RectifiedPair pair = rectifier.rectify(frame).value();
  EXPECT_EQ(pair.stamp, frame.stamp);
  double squares = 0.0, worst = 0.0;
  int n = 0;
  for (int v = 4; v < 240; v += 7) {
    for (int u = 4; u < 320; u += 7) {
      for (const bool left : {true, false}) {
        const cv::Point2d p = rawPixel(left ? c.left : c.right, u, v);
        const bool inside = p.x > 2 && p.y > 2 && p.x < 317 && p.y < 237;
        const cv::Mat& valid = left ? pair.left_valid : pair.right_valid;
        if (inside) {
          EXPECT_NE(valid.at<std::uint8_t>(v, u), 0);
        }
        if (p.x < -1 || p.y < -1 || p.x > 320 || p.y > 240) {
          EXPECT_EQ(valid.at<std::uint8_t>(v, u), 0);
        }
        if (!inside) continue;
        const cv::Mat& gray = left ? pair.left_gray : pair.right_gray;
        const double error = gray.at<std::uint8_t>(v, u) - texture(p.x, p.y);
        squares += error * error;
        worst = std::max(worst, std::abs(error));
        ++n;
      }
    }
  }
  ASSERT_GT(n, 1500);
  // Rounding to whole grey levels, twice, is 0.4; a shift of 0.1 px would be 1.2.
  EXPECT_LT(std::sqrt(squares / n), 0.7);
  EXPECT_LT(worst, 4.0);
}

INSTANTIATE_TEST_SUITE_P(Distortion, RectifyModels,
                         ::testing::Values("plumb_bob", "rational_polynomial", "equidistant"));

class BayerPatterns : public ::testing::TestWithParam<PixelFormat> {};

TEST_P(BayerPatterns, ColourComesOutAsItWentIn) {
  // Colours of the four sites of a 2x2 cell, row by row.
  const PixelFormat format = GetParam();
  std::string sites = "rggb";
  if (format == PixelFormat::kBayerBggr8) sites = "bggr";
  if (format == PixelFormat::kBayerGbrg8) sites = "gbrg";
  if (format == PixelFormat::kBayerGrbg8) sites = "grbg";
  Image image;
  image.format = format;
  image.data.create(32, 40, CV_8UC1);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 40; ++x) {
      const char site = sites[static_cast<std::size_t>(2 * (y % 2) + x % 2)];
      image.data.at<std::uint8_t>(y, x) = site == 'r' ? 200 : site == 'g' ? 120 : 40;
    }
  }
  const Rectifier rectifier(idealCalibration(40, 32, 50.0, 0.1));
  const RectifiedPair pair = rectifier.rectify({Time(), image, image}).value();
  for (int y = 2; y < 30; ++y) {
    for (int x = 2; x < 38; ++x) {
      EXPECT_EQ(pair.left_color.at<cv::Vec3b>(y, x), cv::Vec3b(40, 120, 200));
      EXPECT_EQ(pair.left_gray.at<std::uint8_t>(y, x), 120);  // (r + 2 g + b) / 4, every site
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, BayerPatterns,
                         ::testing::Values(PixelFormat::kBayerRggb8, PixelFormat::kBayerBggr8,
                                           PixelFormat::kBayerGbrg8, PixelFormat::kBayerGrbg8));

TEST(Rectify, BgrAndMonoInput) {
  const Rectifier rectifier(idealCalibration(40, 32, 50.0, 0.1));
  Image bgr{cv::Mat(32, 40, CV_8UC3, cv::Scalar(10, 100, 200)), PixelFormat::kBgr8};
  const RectifiedPair color = rectifier.rectify({Time(), bgr, bgr}).value();
  EXPECT_EQ(color.left_color.at<cv::Vec3b>(16, 20), cv::Vec3b(10, 100, 200));
  EXPECT_NEAR(color.left_gray.at<std::uint8_t>(16, 20), 0.299 * 200 + 0.587 * 100 + 1.14, 1.0);
  Image mono{cv::Mat(32, 40, CV_8UC1, cv::Scalar(77)), PixelFormat::kMono8};
  const RectifiedPair grey = rectifier.rectify({Time(), mono, mono}).value();
  EXPECT_EQ(grey.left_color.at<cv::Vec3b>(16, 20), cv::Vec3b(77, 77, 77));
  EXPECT_EQ(grey.right_gray.at<std::uint8_t>(16, 20), 77);
}

TEST(Rectify, BadFramesAreRefusedWithTheReason) {
  const Rectifier rectifier(idealCalibration(40, 32, 50.0, 0.1));
  const Image good{cv::Mat(32, 40, CV_8UC1, cv::Scalar(77)), PixelFormat::kMono8};
  const auto message = [&](const Image& left, const Image& right) {
    const auto result = rectifier.rectify({Time(), left, right});
    EXPECT_EQ(result.status().code(), StatusCode::kInvalidInput);
    return result.status().message();
  };
  EXPECT_NE(message({}, good).find("left image is empty"), std::string::npos);
  const Image small{cv::Mat(30, 40, CV_8UC1), PixelFormat::kMono8};
  EXPECT_NE(message(good, small).find("right image is 40x30"), std::string::npos);
  const Image deep{cv::Mat(32, 40, CV_16UC1), PixelFormat::kMono8};
  EXPECT_NE(message(deep, good).find("CV_16UC1"), std::string::npos);
  const Image mislabelled{good.data, PixelFormat::kBgr8};
  EXPECT_NE(message(mislabelled, good).find("CV_8UC3"), std::string::npos);
  const Image bayer{good.data, PixelFormat::kBayerRggb8};
  EXPECT_FALSE(message(good, bayer).empty());
}

TEST(Rectify, BadCalibrationThrows) {
  StereoCalibration c = idealCalibration(40, 32, 50.0, 0.1);
  c.right.P(0, 3) = 0.0;
  EXPECT_THROW(Rectifier{c}, ConfigurationError);
  c = idealCalibration(40, 32, 50.0, 0.1);
  c.left.distortion_model = "division";
  EXPECT_THROW(Rectifier{c}, ConfigurationError);
  c = idealCalibration(40, 32, 50.0, 0.1);
  c.right.D = {0.1, 0.2, 0.3};
  EXPECT_THROW(Rectifier{c}, ConfigurationError);
}

}  // namespace
}  // namespace scanner::stereo
