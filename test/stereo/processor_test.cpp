#include "scanner/stereo/stereo_processor.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>

#include "scanner/core/se3.h"
#include "scanner/stereo/suitability.h"
#include "stereo/synthetic.h"

namespace scanner::stereo {
namespace {

using testing::DisparityPlane;
using testing::idealCalibration;
using testing::makePair;

constexpr int kWidth = 320, kHeight = 200;
constexpr double kFocal = 400.0, kBaseline = 0.1;

StereoFrame frameOf(const RectifiedPair& pair) {
  return {
      pair.stamp, {pair.left_gray, PixelFormat::kMono8}, {pair.right_gray, PixelFormat::kMono8}};
}

StereoOptions testOptions() {
  StereoOptions o;
  o.matcher.min_disparity_px = 10;
  o.matcher.max_disparity_px = 70;
  return o;
}

TEST(StereoProcessor, PlaneFromImagesToCloud) {
  const StereoCalibration c = idealCalibration(kWidth, kHeight, kFocal, kBaseline);
  // Z = f B / d, so d = d0 + a u + b v is a plane in space.
  const DisparityPlane plane{30.0, 0.03, -0.02};
  const StereoProcessor processor(c, testOptions(), 2);
  const auto result = processor.process(frameOf(makePair(kWidth, kHeight, plane, {1.0})));
  ASSERT_TRUE(result) << result.status().message();
  const StereoProcessor::Output& out = *result;
  EXPECT_EQ(toNanoseconds(out.cloud.stamp), 42);
  EXPECT_GT(out.statistics.density, 0.7);
  EXPECT_GT(out.statistics.normals, out.statistics.points * 8 / 10);
  EXPECT_GT(out.statistics.mean_sigma_px, 0.0);
  EXPECT_EQ(out.statistics.points, out.statistics.match.valid);
  // a (f X / Z + cx) + b (f Y / Z + cy) + d0 = f B / Z, times Z.
  const double cx = c.left.P(0, 2), cy = c.left.P(1, 2);
  const Eigen::Vector3d normal =
      -Eigen::Vector3d(plane.a * kFocal, plane.b * kFocal, plane.at(cx, cy)).normalized();
  double distance2 = 0.0, angle = 0.0;
  for (std::size_t i = 0; i < out.cloud.cloud.size(); ++i) {
    const Eigen::Vector3d p = out.cloud.cloud.points[i].cast<double>();
    if (std::isnan(p.z())) continue;
    const double scale =
        Eigen::Vector3d(plane.a * kFocal, plane.b * kFocal, plane.at(cx, cy)).norm();
    const double off = normal.dot(p) + kFocal * kBaseline / scale;
    distance2 += off * off;
    const Eigen::Vector3d n = out.cloud.cloud.normals[i].cast<double>();
    if (!std::isnan(n.x())) angle += std::acos(std::min(1.0, n.dot(normal)));
  }
  // 0.03 px at 1.3 m is 1.3 mm.
  EXPECT_LT(std::sqrt(distance2 / static_cast<double>(out.statistics.points)), 2.5e-3);
  EXPECT_LT(angle / static_cast<double>(out.statistics.normals), 0.2);
}

TEST(StereoProcessor, SameBytesForAnyThreadCount) {
  const StereoCalibration c = idealCalibration(kWidth, kHeight, kFocal, kBaseline);
  const StereoFrame frame = frameOf(makePair(kWidth, kHeight, {30.0, 0.03, 0.02}, {2.0}));
  const auto one = StereoProcessor(c, testOptions(), 1).process(frame);
  const auto two = StereoProcessor(c, testOptions(), 2).process(frame);
  const auto same = [](const std::vector<Eigen::Vector3f>& a,
                       const std::vector<Eigen::Vector3f>& b) {
    return a.size() == b.size() &&
           std::memcmp(a.data(), b.data(), a.size() * sizeof(Eigen::Vector3f)) == 0;
  };
  EXPECT_TRUE(same(one->cloud.cloud.points, two->cloud.cloud.points));
  EXPECT_TRUE(same(one->cloud.cloud.normals, two->cloud.cloud.normals));
}

TEST(StereoProcessor, BadConfigurationThrowsBadDataDoesNot) {
  StereoCalibration c = idealCalibration(kWidth, kHeight, kFocal, kBaseline);
  EXPECT_THROW(StereoProcessor(c, StereoOptions(), 1), ConfigurationError);  // 330 px of 320
  EXPECT_THROW(StereoProcessor(c, testOptions(), 0), ConfigurationError);
  const StereoProcessor processor(c, testOptions(), 1);
  EXPECT_EQ(processor.process({}).status().code(), StatusCode::kInvalidInput);
  const Image black{cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(0)), PixelFormat::kMono8};
  const auto nothing = processor.process({Time(), black, black});
  ASSERT_TRUE(nothing);
  EXPECT_EQ(nothing->statistics.points, 0U);
  c.right.P(0, 3) = 1.0;
  EXPECT_THROW(StereoProcessor(c, testOptions(), 1), ConfigurationError);
}

TEST(MakeView, PutsThePointsInBaseLinkAndConditionsInTheWorld) {
  const StereoCalibration c = idealCalibration(kWidth, kHeight, kFocal, kBaseline);
  const StereoProcessor processor(c, testOptions(), 2);
  const auto out = processor.process(frameOf(makePair(kWidth, kHeight, {30.0, 0.0, 0.0}, {1.0})));
  ASSERT_TRUE(out);
  const Eigen::Isometry3d T_base_optical =
      makePose({0.1, 0.2, 0.3}, expSo3(Eigen::Vector3d(0.3, -1.2, 0.7)));
  // The camera looks down at a floor, which is the subject and must stay.
  Eigen::Isometry3d T_world_optical = Eigen::Isometry3d::Identity();
  T_world_optical.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  const Eigen::Isometry3d T_world_base = T_world_optical * T_base_optical.inverse();
  ConditioningStatistics statistics;
  const auto view =
      makeView(7, out->cloud, T_base_optical, T_world_base, ConditioningOptions(), &statistics);
  ASSERT_TRUE(view) << view.status().message();
  EXPECT_EQ(view->index, 7);
  EXPECT_EQ(view->stamp, out->cloud.stamp);
  EXPECT_TRUE(allFinite(view->cloud));
  EXPECT_TRUE(view->cloud.hasNormals() && view->cloud.hasColors() && view->cloud.hasSigmas());
  EXPECT_FALSE(statistics.ground_found);
  EXPECT_GT(view->cloud.size(), out->statistics.normals * 8 / 10);
  const Eigen::Isometry3d T_optical_base = T_base_optical.inverse();
  for (std::size_t i = 0; i < view->cloud.size(); i += 97) {
    const Eigen::Vector3d p = T_optical_base * view->cloud.points[i].cast<double>();
    EXPECT_NEAR(p.z(), kFocal * kBaseline / 30.0, 0.02);
  }
}

TEST(MakeView, TooFewPointsOrABadPoseIsAStatus) {
  OrganizedCloud cloud;
  cloud.width = cloud.height = 10;
  cloud.cloud.points.assign(100, Eigen::Vector3f::Constant(NAN));
  cloud.cloud.normals = cloud.cloud.points;
  const Eigen::Isometry3d I = Eigen::Isometry3d::Identity();
  EXPECT_EQ(makeView(0, cloud, I, I, {}, nullptr).status().code(), StatusCode::kNotEnoughData);
  Eigen::Isometry3d bad = I;
  bad.translation().x() = NAN;
  EXPECT_EQ(makeView(0, cloud, I, bad, {}, nullptr).status().code(), StatusCode::kInvalidInput);
}

TEST(Trouble, HopelessPairsAreNamed) {
  const RectifiedPair good = makePair(kWidth, kHeight, {40.0, 0.02, 0.0}, {1.0});
  EXPECT_EQ(describeTrouble(good, 1), "");
  RectifiedPair pair = good;
  pair.right_gray = cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(3));
  EXPECT_NE(describeTrouble(pair, 1).find("right image is black"), std::string::npos);
  pair.left_gray = pair.right_gray;
  EXPECT_NE(describeTrouble(pair, 1).find("both"), std::string::npos);
  pair = good;
  pair.left_gray = cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(255));
  EXPECT_NE(describeTrouble(pair, 1).find("saturated"), std::string::npos);
  pair = good;
  std::swap(pair.left_gray, pair.right_gray);
  EXPECT_NE(describeTrouble(pair, 1).find("swapped"), std::string::npos);
  pair = good;
  pair.right_gray = makePair(kWidth, kHeight, {5000.0, 0.0, 0.0}).right_gray;
  EXPECT_NE(describeTrouble(pair, 1).find("do not match"), std::string::npos);
}

TEST(Suitability, DisparitiesOfThePairAgainstTheConfiguration) {
  const StereoCalibration c = idealCalibration(kWidth, kHeight, kFocal, kBaseline);
  const RectifiedPair pair = makePair(kWidth, kHeight, {30.0, 0.04, 0.0}, {1.0});
  const auto range = measureDisparities(pair, 1);
  ASSERT_TRUE(range) << range.status().message();
  EXPECT_NEAR(range->min_px, 31.5, 2.5);
  EXPECT_NEAR(range->max_px, 42.3, 2.5);
  EXPECT_EQ(describeMismatch(pair, c, testOptions(), 1), "");
  StereoOptions narrow = testOptions();
  narrow.matcher.min_disparity_px = 100;
  narrow.matcher.max_disparity_px = 200;
  EXPECT_NE(describeMismatch(pair, c, narrow, 1).find("100 to 200 px"), std::string::npos);
}

}  // namespace
}  // namespace scanner::stereo
