#include <gtest/gtest.h>

#include <hwy/highway.h>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstring>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <random>
#include <vector>

#include "scanner/core/se3.h"
#include "scanner/stereo/normals.h"
#include "scanner/stereo/rectify.h"
#include "scanner/stereo/triangulate.h"
#include "stereo/synthetic.h"

/// The vectorised kernels against plain references, and against each other.
namespace scanner::stereo {
namespace {

constexpr double kDegree = 57.29577951308232;

/// Runs `body` on every instruction set and thread count; all must give the same bytes.
template <typename Body>
void expectSameBytes(const Body& body) {
  const std::vector<std::uint8_t> expected = body(1);
  ASSERT_FALSE(expected.empty());
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    for (const int threads : {1, 2, 3}) {
      EXPECT_EQ(body(threads), expected) << hwy::TargetName(target) << ", " << threads;
    }
  }
  hwy::SetSupportedTargetsForTest(0);
}

template <typename T>
void appendBytes(const T* data, std::size_t count, std::vector<std::uint8_t>& bytes) {
  const std::size_t old = bytes.size();
  bytes.resize(old + count * sizeof(T));
  std::memcpy(bytes.data() + old, data, count * sizeof(T));
}

double uniform(std::mt19937_64& generator) {
  return static_cast<double>(generator() >> 11) * 0x1.0p-53;
}

/// Waves, a step, holes, noise and a block of no points; odd sizes reach every tail.
DisparityImage roughDisparity(int width, int height, double noise_px) {
  std::mt19937_64 generator(5);
  DisparityImage d;
  d.disparity_px.create(height, width, CV_32FC1);
  d.sigma_px.create(height, width, CV_32FC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double value = 60.0 + 6.0 * std::sin(0.09 * x) * std::cos(0.07 * y) + 0.1 * y;
      if (x > width / 2 && y > height / 3) value -= 12.0;
      value += noise_px * (uniform(generator) + uniform(generator) - 1.0);
      if (uniform(generator) < 0.1 || (x < 20 && y < 9)) value = NAN;
      d.disparity_px.at<float>(y, x) = static_cast<float>(value);
      d.sigma_px.at<float>(y, x) = static_cast<float>(0.05 + 0.1 * uniform(generator));
    }
  }
  return d;
}

OrganizedCloud roughCloud(int width, int height, double noise_px) {
  return triangulate(roughDisparity(width, height, noise_px), {},
                     testing::idealCalibration(width, height, 300.0, 0.12), DepthOptions());
}

/// Eq. 4.1, directly, in double.
Eigen::Vector3d referenceNormal(const OrganizedCloud& c, const NormalOptions& o, int u, int v) {
  const Eigen::Vector3d undefined = Eigen::Vector3d::Constant(NAN);
  const auto at = [&](int x, int y) { return static_cast<std::size_t>(y * c.width + x); };
  const Eigen::Vector3f& centre = c.cloud.points[at(u, v)];
  const double tolerance = o.max_step_sigmas * static_cast<double>(c.cloud.sigmas[at(u, v)]);
  if (std::isnan(centre.z())) return undefined;
  const int radius = o.window_px / 2;
  std::vector<Eigen::Vector3d> points;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (int y = std::max(0, v - radius); y <= std::min(c.height - 1, v + radius); ++y) {
    for (int x = std::max(0, u - radius); x <= std::min(c.width - 1, u + radius); ++x) {
      const Eigen::Vector3f& p = c.cloud.points[at(x, y)];
      if (std::isnan(p.z())) continue;
      const int distance = std::max(std::abs(x - u), std::abs(y - v));
      const double limit =
          o.max_step_ratio * static_cast<double>(centre.z()) * distance + tolerance;
      if (std::abs(static_cast<double>(p.z()) - static_cast<double>(centre.z())) > limit) {
        return undefined;
      }
      points.push_back(p.cast<double>());
      mean += points.back();
    }
  }
  if (static_cast<int>(points.size()) < o.min_points) return undefined;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) scatter += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
  const Eigen::Vector3d normal = solver.eigenvectors().col(0);
  return normal.dot(centre.cast<double>()) > 0.0 ? Eigen::Vector3d(-normal) : normal;
}

struct NormalCase {
  int width, height, window, min_points;
  double noise_px;
};

class NormalsAgainstReference : public ::testing::TestWithParam<NormalCase> {};

TEST_P(NormalsAgainstReference, SameEigenvectorAndSameGaps) {
  const NormalCase& p = GetParam();
  OrganizedCloud cloud = roughCloud(p.width, p.height, p.noise_px);
  NormalOptions o;
  o.window_px = p.window;
  o.min_points = p.min_points;
  estimateNormals(cloud, o, 2);
  std::size_t defined = 0, other_gaps = 0;
  double squares = 0.0, worst = 0.0;
  for (int v = 0; v < p.height; ++v) {
    for (int u = 0; u < p.width; ++u) {
      const Eigen::Vector3f& n = cloud.cloud.normals[static_cast<std::size_t>(v * p.width + u)];
      const Eigen::Vector3d expected = referenceNormal(cloud, o, u, v);
      if (std::isnan(n.x()) != std::isnan(expected.x())) ++other_gaps;
      if (std::isnan(n.x()) || std::isnan(expected.x())) continue;
      const double angle = (n.cast<double>() - expected).norm() * kDegree;
      squares += angle * angle;
      worst = std::max(worst, angle);
      ++defined;
    }
  }
  ASSERT_GT(defined, 500U);
  ASSERT_LT(defined, cloud.cloud.size());
  EXPECT_LE(other_gaps, 1U);  // a neighbour on the limit, decided in float
  EXPECT_LT(std::sqrt(squares / static_cast<double>(defined)), 0.002);
  EXPECT_LT(worst, 0.1);
}

INSTANTIATE_TEST_SUITE_P(Windows, NormalsAgainstReference,
                         ::testing::Values(NormalCase{131, 77, 5, 13, 0.0},
                                           NormalCase{131, 77, 5, 13, 0.1},
                                           NormalCase{257, 40, 3, 5, 0.3},
                                           NormalCase{67, 101, 7, 20, 0.1},
                                           NormalCase{60, 61, 31, 200, 0.05}));

TEST(NormalsSimd, NormalOfALineIsUndefined) {
  OrganizedCloud cloud;
  cloud.width = 9;
  cloud.height = 5;
  for (int i = 0; i < 45; ++i) {
    cloud.cloud.points.emplace_back(0.001f * static_cast<float>(i % 9), 0.0f, 1.0f);
  }
  estimateNormals(cloud, NormalOptions(), 1);
  for (const Eigen::Vector3f& n : cloud.cloud.normals) EXPECT_TRUE(std::isnan(n.z()));
}

TEST(NormalsSimd, SameBytesOnEveryTarget) {
  for (const int window : {3, 5, 31}) {
    expectSameBytes([&](int threads) {
      OrganizedCloud cloud = roughCloud(151, 67, 0.1);
      NormalOptions o;
      o.window_px = window;
      o.min_points = 5;
      estimateNormals(cloud, o, threads);
      std::vector<std::uint8_t> bytes;
      appendBytes(cloud.cloud.normals.data(), cloud.cloud.normals.size(), bytes);
      return bytes;
    });
  }
}

TEST(TriangulateSimd, SameBytesOnEveryTargetAndAsTheFormulaSays) {
  const StereoCalibration c = testing::idealCalibration(101, 67, 300.0, 0.12);
  const DisparityImage d = roughDisparity(101, 67, 0.1);
  cv::Mat color(67, 101, CV_8UC3);
  for (int i = 0; i < 67 * 101 * 3; ++i) color.data[i] = static_cast<std::uint8_t>(i * 37);
  expectSameBytes([&](int threads) {
    const OrganizedCloud out = triangulate(d, color, c, DepthOptions(), threads);
    std::vector<std::uint8_t> bytes;
    appendBytes(out.cloud.points.data(), out.cloud.size(), bytes);
    appendBytes(out.cloud.sigmas.data(), out.cloud.size(), bytes);
    appendBytes(out.cloud.colors.data(), out.cloud.size(), bytes);
    return bytes;
  });
  const OrganizedCloud out = triangulate(d, color, c, DepthOptions(), 2);
  for (int v = 0; v < 67; ++v) {
    for (int u = 0; u < 101; ++u) {
      const auto i = static_cast<std::size_t>(v * 101 + u);
      const auto disparity = static_cast<double>(d.disparity_px.at<float>(v, u));
      const cv::Vec3b bgr = color.at<cv::Vec3b>(v, u);
      EXPECT_EQ(out.cloud.colors[i], (Rgb8{bgr[2], bgr[1], bgr[0]}));
      ASSERT_EQ(std::isnan(out.cloud.points[i].z()), std::isnan(disparity));
      if (std::isnan(disparity)) continue;
      const double z = 300.0 * 0.12 / disparity;
      EXPECT_NEAR(static_cast<double>(out.cloud.points[i].z()), z, 1e-7);
      EXPECT_NEAR(static_cast<double>(out.cloud.points[i].x()), (u - c.left.P(0, 2)) * z / 300.0,
                  1e-7);
      EXPECT_NEAR(static_cast<double>(out.cloud.sigmas[i]),
                  z * z * static_cast<double>(d.sigma_px.at<float>(v, u)) / (300.0 * 0.12), 1e-8);
    }
  }
}

StereoCalibration tiltedCalibration(int width, int height) {
  StereoCalibration c = testing::idealCalibration(width, height, 260.0, 0.12);
  for (CameraModel* camera : {&c.left, &c.right}) {
    camera->distortion_model = "plumb_bob";
    camera->D = {-0.3, 0.1, 0.001, -0.002, 0.0};
  }
  c.left.R = expSo3({0.01, -0.04, 0.03}).toRotationMatrix();
  c.right.R = expSo3({-0.02, 0.03, -0.02}).toRotationMatrix();
  return c;
}

Image randomImage(PixelFormat format, int width, int height) {
  std::mt19937_64 generator(7);
  const int channels = format == PixelFormat::kBgr8 ? 3 : 1;
  Image image{cv::Mat(height, width, CV_8UC(channels)), format};
  const std::size_t bytes = image.data.total() * image.data.elemSize();
  for (std::size_t i = 0; i < bytes; ++i) {
    image.data.data[i] = static_cast<std::uint8_t>(generator() >> 56);
  }
  return image;
}

constexpr PixelFormat kFormats[] = {PixelFormat::kMono8,      PixelFormat::kBgr8,
                                    PixelFormat::kBayerRggb8, PixelFormat::kBayerBggr8,
                                    PixelFormat::kBayerGbrg8, PixelFormat::kBayerGrbg8};

TEST(RectifySimd, SameBytesOnEveryTarget) {
  for (const PixelFormat format : kFormats) {
    for (const bool ideal : {false, true}) {
      const Rectifier rectifier(ideal ? testing::idealCalibration(203, 77, 260.0, 0.12)
                                      : tiltedCalibration(203, 77));
      const Image image = randomImage(format, 203, 77);
      expectSameBytes([&](int threads) {
        const RectifiedPair pair = rectifier.rectify({Time(), image, image}, threads).value();
        std::vector<std::uint8_t> bytes;
        appendBytes(pair.left_gray.data, pair.left_gray.total(), bytes);
        appendBytes(pair.right_gray.data, pair.right_gray.total(), bytes);
        appendBytes(pair.left_color.data, 3 * pair.left_color.total(), bytes);
        return bytes;
      });
    }
  }
}

/// Grey before resampling, in double.
double rawGray(const Image& image, int x, int y) {
  const auto mirrored = [](int i, int n) { return i < 0 ? -i : i >= n ? 2 * (n - 1) - i : i; };
  const int width = image.data.cols, height = image.data.rows;
  x = std::clamp(x, 0, width - 1);
  y = std::clamp(y, 0, height - 1);
  if (image.format == PixelFormat::kMono8) return image.data.at<std::uint8_t>(y, x);
  double sum = 0.0;
  for (int j = -1; j <= 1; ++j) {
    for (int i = -1; i <= 1; ++i) {
      const int weight = (2 - std::abs(i)) * (2 - std::abs(j));
      sum += weight * image.data.at<std::uint8_t>(mirrored(y + j, height), mirrored(x + i, width));
    }
  }
  return sum / 16.0;
}

/// Cubic convolution (Keys) of the raw grey, in double.
double resampled(const Image& image, double x, double y) {
  const auto kernel = [](double t) {
    t = std::abs(t);
    if (t < 1.0) return 1.5 * t * t * t - 2.5 * t * t + 1.0;
    return t < 2.0 ? -0.5 * t * t * t + 2.5 * t * t - 4.0 * t + 2.0 : 0.0;
  };
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
  double sum = 0.0;
  for (int j = y0 - 1; j <= y0 + 2; ++j) {
    for (int i = x0 - 1; i <= x0 + 2; ++i) {
      sum += kernel(x - i) * kernel(y - j) * rawGray(image, i, j);
    }
  }
  return std::clamp(sum, 0.0, 255.0);
}

TEST(RectifySimd, GrayIsTheCubicConvolutionOfTheRawImage) {
  const StereoCalibration c = tiltedCalibration(203, 77);
  const Rectifier rectifier(c);
  cv::Mat K, R, P, map_x, map_y;
  cv::eigen2cv(c.right.K, K);
  cv::eigen2cv(c.right.R, R);
  cv::eigen2cv(Eigen::Matrix3d(c.right.P.leftCols<3>()), P);
  cv::initUndistortRectifyMap(K, c.right.D, R, P, cv::Size(203, 77), CV_32FC1, map_x, map_y);
  for (const PixelFormat format : {PixelFormat::kMono8, PixelFormat::kBayerGrbg8}) {
    const Image image = randomImage(format, 203, 77);
    const RectifiedPair pair = rectifier.rectify({Time(), image, image}, 2).value();
    double squares = 0.0;
    for (int v = 0; v < 77; ++v) {
      for (int u = 0; u < 203; ++u) {
        const double x = std::clamp(static_cast<double>(map_x.at<float>(v, u)), -2.0, 203.9);
        const double y = std::clamp(static_cast<double>(map_y.at<float>(v, u)), -2.0, 77.9);
        const double error = pair.right_gray.at<std::uint8_t>(v, u) - resampled(image, x, y);
        EXPECT_LT(std::abs(error), 1.0) << u << ", " << v;  // white noise: the worst there is
        squares += error * error;
      }
    }
    EXPECT_LT(std::sqrt(squares / (203 * 77)), 0.31);  // rounding to whole levels is 0.289
  }
}

TEST(RectifySimd, RectifiedCameraKeepsItsBytes) {
  const Rectifier rectifier(testing::idealCalibration(203, 77, 260.0, 0.12));
  const Image mono = randomImage(PixelFormat::kMono8, 203, 77);
  const RectifiedPair gray = rectifier.rectify({Time(), mono, mono}).value();
  EXPECT_EQ(cv::countNonZero(gray.left_gray != mono.data), 0);
  EXPECT_EQ(cv::countNonZero(gray.right_gray != mono.data), 0);
  const Image bgr = randomImage(PixelFormat::kBgr8, 203, 77);
  const RectifiedPair color = rectifier.rectify({Time(), bgr, bgr}).value();
  EXPECT_EQ(cv::norm(color.left_color, bgr.data, cv::NORM_INF), 0.0);
}

TEST(RectifySimd, ColourOfATexturedSceneIsRecovered) {
  // Colour that changes slowly under grey detail, as on most surfaces.
  cv::Mat truth(96, 120, CV_8UC3);
  Image raw{cv::Mat(96, 120, CV_8UC1), PixelFormat::kBayerGbrg8};
  for (int y = 0; y < 96; ++y) {
    for (int x = 0; x < 120; ++x) {
      const double detail = 0.5 * testing::texture(x, y) + 50.0;
      const cv::Vec3b pixel(testing::toGray(detail - 0.2 * x), testing::toGray(detail),
                            testing::toGray(detail + 0.3 * y));
      truth.at<cv::Vec3b>(y, x) = pixel;
      const int channel = (x + y) % 2 == 0 ? 1 : (y % 2 == 0 ? 0 : 2);
      raw.data.at<std::uint8_t>(y, x) = pixel[channel];
    }
  }
  const Rectifier rectifier(testing::idealCalibration(120, 96, 260.0, 0.12));
  const RectifiedPair pair = rectifier.rectify({Time(), raw, raw}).value();
  const cv::Rect inside(3, 3, 114, 90);
  const double rms = cv::norm(pair.left_color(inside), truth(inside), cv::NORM_L2) /
                     std::sqrt(3.0 * inside.area());
  EXPECT_LT(rms, 1.5);
}

}  // namespace
}  // namespace scanner::stereo
