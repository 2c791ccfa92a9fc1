#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "scanner/core/parallel.h"
#include "scanner/stereo/normals.h"
#include "scanner/stereo/suitability.h"
#include "scanner/stereo/triangulate.h"
#include "stereo/synthetic.h"

namespace scanner::stereo {
namespace {

using testing::idealCalibration;

constexpr int kWidth = 160, kHeight = 120;
constexpr double kFocal = 200.0;

/// The cloud of a depth function z(x, y) of normalised image coordinates; NaN where it is.
OrganizedCloud cloudOf(const std::function<double(double, double)>& depth, double noise = 0.0) {
  std::mt19937_64 generator(3);
  std::normal_distribution<double> normal(0.0, 1.0);
  OrganizedCloud out;
  out.width = kWidth;
  out.height = kHeight;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const double x = (u - 79.5) / kFocal, y = (v - 59.5) / kFocal;
      const double z = depth(x, y) + noise * normal(generator);
      out.cloud.points.push_back(Eigen::Vector3d(x * z, y * z, z).cast<float>());
      out.cloud.sigmas.push_back(static_cast<float>(noise));
    }
  }
  return out;
}

std::size_t at(int u, int v) { return static_cast<std::size_t>(v * kWidth + u); }

TEST(Triangulate, ClosedForm) {
  StereoCalibration c = idealCalibration(8, 6, 500.0, 0.12);
  c.left.P(1, 1) = 510.0;
  c.right.P(0, 2) -= 4.0;  // d_metric = d - 4
  DisparityImage d;
  d.stamp = fromNanoseconds(9);
  d.disparity_px = cv::Mat(6, 8, CV_32FC1, cv::Scalar(64.0f));
  d.sigma_px = cv::Mat(6, 8, CV_32FC1, cv::Scalar(0.1f));
  d.disparity_px.at<float>(0, 0) = NAN;
  d.disparity_px.at<float>(0, 1) = 4.0f;    // infinitely far
  d.disparity_px.at<float>(0, 2) = 1.0f;    // behind the camera
  d.disparity_px.at<float>(0, 3) = 5.0f;    // 60 m
  d.disparity_px.at<float>(0, 4) = 604.0f;  // 0.1 m
  cv::Mat color(6, 8, CV_8UC3, cv::Scalar(1, 2, 3));
  DepthOptions bounds;
  bounds.min_depth_m = 0.2;
  bounds.max_depth_m = 50.0;
  const OrganizedCloud out = triangulate(d, color, c, bounds);
  ASSERT_EQ(out.cloud.size(), 48U);
  EXPECT_EQ(out.stamp, d.stamp);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_TRUE(std::isnan(out.cloud.points[i].x()) && std::isnan(out.cloud.points[i].z())) << i;
    EXPECT_TRUE(std::isnan(out.cloud.sigmas[i])) << i;
  }
  const Eigen::Vector3f& p = out.cloud.points[2 * 8 + 6];
  EXPECT_NEAR(p.z(), 1.0, 1e-6);  // 500 * 0.12 / 60
  EXPECT_NEAR(p.x(), (6 - 3.5) / 500.0, 1e-7);
  EXPECT_NEAR(p.y(), (2 - 2.5) / 510.0, 1e-7);
  EXPECT_NEAR(out.cloud.sigmas[2 * 8 + 6], 0.1 / 60.0, 1e-7);
  EXPECT_EQ(out.cloud.colors[0], (Rgb8{3, 2, 1}));
}

TEST(Triangulate, RefusesUnequalSizes) {
  DisparityImage d;
  d.disparity_px = cv::Mat(6, 8, CV_32FC1, cv::Scalar(64.0f));
  d.sigma_px = cv::Mat(6, 7, CV_32FC1, cv::Scalar(0.1f));
  EXPECT_THROW(triangulate(d, {}, idealCalibration(8, 6, 500.0, 0.12), {}), std::invalid_argument);
}

TEST(Normals, OfAPlaneAreExactAndFaceTheCamera) {
  const Eigen::Vector3d n = Eigen::Vector3d(0.3, -0.2, -1.0).normalized();
  OrganizedCloud cloud =
      cloudOf([&](double x, double y) { return -1.5 / n.dot(Eigen::Vector3d(x, y, 1.0)); });
  estimateNormals(cloud, NormalOptions(), 2);
  for (std::size_t i = 0; i < cloud.cloud.size(); ++i) {
    // Corners hold 9 of 25 points, edges 15.
    if (std::isnan(cloud.cloud.normals[i].x())) continue;
    EXPECT_NEAR(cloud.cloud.normals[i].norm(), 1.0f, 1e-5f);
    EXPECT_LT((cloud.cloud.normals[i].cast<double>() - n).norm(), 2e-3);
  }
  EXPECT_FALSE(std::isnan(cloud.cloud.normals[at(80, 60)].x()));
  EXPECT_FALSE(std::isnan(cloud.cloud.normals[at(0, 60)].x()));
  EXPECT_TRUE(std::isnan(cloud.cloud.normals[at(0, 0)].x()));
}

TEST(Normals, OfASphere) {
  const Eigen::Vector3d centre(0.05, -0.03, 1.0);
  const double radius = 0.3;
  OrganizedCloud cloud = cloudOf([&](double x, double y) {
    const Eigen::Vector3d ray(x, y, 1.0);
    const double b = ray.dot(centre), a = ray.squaredNorm();
    const double root = b * b - a * (centre.squaredNorm() - radius * radius);
    return root < 0 ? NAN : (b - std::sqrt(root)) / a;
  });
  estimateNormals(cloud, NormalOptions(), 1);
  int n = 0;
  for (std::size_t i = 0; i < cloud.cloud.size(); ++i) {
    if (std::isnan(cloud.cloud.normals[i].x())) continue;
    const Eigen::Vector3d truth = (cloud.cloud.points[i].cast<double>() - centre) / radius;
    EXPECT_GT(truth.dot(cloud.cloud.normals[i].cast<double>()), std::cos(0.04));
    ++n;
  }
  EXPECT_GT(n, 5000);
}

TEST(Normals, NoneAcrossAStepOrInSparseWindows) {
  OrganizedCloud cloud = cloudOf([](double x, double) { return x < 0.0 ? 1.0 : 1.1; });
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 120; u < kWidth; ++u) {
      if ((u + v) % 3 != 0) cloud.cloud.points[at(u, v)].setConstant(NAN);
    }
  }
  estimateNormals(cloud, NormalOptions(), 2);
  for (int v = 5; v < kHeight - 5; ++v) {
    for (int u = 78; u <= 81; ++u) EXPECT_TRUE(std::isnan(cloud.cloud.normals[at(u, v)].x())) << u;
    EXPECT_NEAR(cloud.cloud.normals[at(77, v)].z(), -1.0f, 1e-5f);
    EXPECT_NEAR(cloud.cloud.normals[at(82, v)].z(), -1.0f, 1e-5f);
    EXPECT_TRUE(std::isnan(cloud.cloud.normals[at(140, v)].x()));
  }
}

TEST(Normals, NoiseOfFarSurfacesIsNotAStep) {
  OrganizedCloud cloud = cloudOf([](double, double) { return 4.0; }, 0.05);
  NormalOptions o;
  o.max_step_sigmas = 4.0;
  o.max_step_ratio = 0.02;
  estimateNormals(cloud, o, 1);
  std::size_t finite = 0;
  for (const Eigen::Vector3f& n : cloud.cloud.normals) finite += std::isnan(n.x()) ? 0 : 1;
  EXPECT_GT(finite, cloud.cloud.size() * 8 / 10);
}

TEST(Normals, SameBytesForAnyThreadCountAndEmptyCloud) {
  const auto depth = [](double x, double y) {
    return 1.0 + 0.2 * std::sin(9 * x) * std::cos(7 * y);
  };
  OrganizedCloud one = cloudOf(depth, 1e-3), two = one;
  estimateNormals(one, NormalOptions(), 1);
  estimateNormals(two, NormalOptions(), 2);
  for (std::size_t i = 0; i < one.cloud.size(); ++i) {
    if (std::isnan(one.cloud.normals[i].x())) {
      EXPECT_TRUE(std::isnan(two.cloud.normals[i].x()));
    } else {
      EXPECT_EQ(one.cloud.normals[i], two.cloud.normals[i]);
    }
  }
  OrganizedCloud empty;
  estimateNormals(empty, NormalOptions(), 2);
  EXPECT_TRUE(empty.cloud.normals.empty());
  empty.width = 3;
  empty.height = 1;
  EXPECT_THROW(estimateNormals(empty, NormalOptions(), 1), std::invalid_argument);
}

TEST(Suitability, NoiseModelAndWorkingRange) {
  // method.md: at 0.75 m and f = 1098 px, 0.1 px is 0.43 mm.
  EXPECT_NEAR(depthSigma(0.75, 1098.0, 0.12, 0.1), 0.43e-3, 0.005e-3);
  EXPECT_NEAR(depthForSigma(0.43e-3, 1098.0, 0.12, 0.1), 0.75, 0.01);
  const StereoCalibration c = idealCalibration(1024, 768, 1098.0, 0.12);
  const DepthRange range = workingRange(c, StereoOptions());
  EXPECT_NEAR(range.min_depth_m, 0.40, 0.005);
  EXPECT_NEAR(range.max_depth_m, 1.32, 0.005);
  const DisparityRange back = disparityRange(c, range);
  EXPECT_NEAR(back.min_px, 100.0, 1.0);
  EXPECT_NEAR(back.max_px, 330.0, 1.0);
  EXPECT_THROW(disparityRange(c, {2.0, 1.0}), ConfigurationError);
}

}  // namespace
}  // namespace scanner::stereo
