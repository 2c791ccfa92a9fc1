#include "scanner/ros/conversions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

namespace scanner::bridge {
namespace {

constexpr double kNaNd = std::numeric_limits<double>::quiet_NaN();
constexpr float kNaNf = std::numeric_limits<float>::quiet_NaN();

Eigen::Isometry3d somePose() {
  return makePose({1.0, -2.0, 0.5}, Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5));
}

TEST(TimeConversion, IsExactToTheNanosecond) {
  for (const std::int64_t ns : {0LL, 1LL, 999999999LL, 1403715273262142976LL}) {
    EXPECT_EQ(toNanoseconds(fromRos(rosTime(fromNanoseconds(ns)))), ns);
  }
  EXPECT_EQ(toRos(fromNanoseconds(-1)).status().code(), StatusCode::kOutOfRange);
  EXPECT_EQ(toRos(Time::max()).status().code(), StatusCode::kOutOfRange);
}

TEST(ImageConversion, KeepsEveryHandledEncoding) {
  for (const PixelFormat format :
       {PixelFormat::kMono8, PixelFormat::kBgr8, PixelFormat::kBayerRggb8, PixelFormat::kBayerBggr8,
        PixelFormat::kBayerGbrg8, PixelFormat::kBayerGrbg8}) {
    Image image;
    image.format = format;
    image.data.create(3, 5, format == PixelFormat::kBgr8 ? CV_8UC3 : CV_8UC1);
    for (std::size_t i = 0; i < image.data.total() * image.data.elemSize(); ++i) {
      image.data.data[i] = static_cast<std::uint8_t>(i);
    }
    const sensor_msgs::Image message = toRos(image, makeHeader(Time(), "camera"));
    EXPECT_EQ(message.encoding, toString(format));
    const Result<Image> back = fromRos(message);
    ASSERT_TRUE(back) << back.status().message();
    EXPECT_EQ(back->format, format);
    EXPECT_EQ(cv::norm(back->data, image.data, cv::NORM_INF), 0.0);
  }
}

TEST(ImageConversion, SwapsRgbAndRemovesPadding) {
  sensor_msgs::Image message;
  message.encoding = "rgb8";
  message.width = 1;
  message.height = 2;
  message.step = 4;
  message.data = {1, 2, 3, 99, 4, 5, 6, 99};
  const Result<Image> image = fromRos(message);
  ASSERT_TRUE(image);
  EXPECT_EQ(image->format, PixelFormat::kBgr8);
  EXPECT_EQ(image->data.at<cv::Vec3b>(0, 0), cv::Vec3b(3, 2, 1));
  EXPECT_EQ(image->data.at<cv::Vec3b>(1, 0), cv::Vec3b(6, 5, 4));
}

TEST(ImageConversion, RefusesWhatItCannotReadAndNamesIt) {
  sensor_msgs::Image message;
  message.encoding = "mono16";
  message.width = message.height = 2;
  message.step = 4;
  message.data.resize(8);
  EXPECT_EQ(fromRos(message).status().code(), StatusCode::kUnsupported);
  EXPECT_NE(fromRos(message).status().message().find("mono16"), std::string::npos);
  message.encoding = "mono8";
  message.data.resize(3);
  EXPECT_EQ(fromRos(message).status().code(), StatusCode::kInvalidInput);
  message.width = 0;
  EXPECT_EQ(fromRos(message).status().code(), StatusCode::kInvalidInput);
}

CameraModel someCamera() {
  CameraModel camera;
  camera.width = 640;
  camera.height = 480;
  camera.D = {0.1, -0.2, 0.001, 0.002, 0.0};
  camera.K << 500, 0, 320, 0, 501, 240, 0, 0, 1;
  camera.R = Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY()).toRotationMatrix();
  camera.P << 480, 0, 310, -57.6, 0, 480, 235, 0, 0, 0, 1, 0;
  return camera;
}

TEST(CameraInfoConversion, GoesThereAndBack) {
  const CameraModel camera = someCamera();
  const Result<CameraModel> back = fromRos(toRos(camera, makeHeader(Time(), "c")));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->width, camera.width);
  EXPECT_EQ(back->D, camera.D);
  EXPECT_EQ(back->K, camera.K);
  EXPECT_EQ(back->R, camera.R);
  EXPECT_EQ(back->P, camera.P);
  EXPECT_EQ(back->distortion_model, camera.distortion_model);
}

TEST(CameraInfoConversion, RefusesUncalibratedBinnedAndCropped) {
  sensor_msgs::CameraInfo message = toRos(someCamera(), makeHeader(Time(), "c"));
  message.K[0] = 0.0;
  EXPECT_NE(fromRos(message).status().message().find("K[0]"), std::string::npos);
  message = toRos(someCamera(), makeHeader(Time(), "c"));
  message.binning_x = 2;
  EXPECT_EQ(fromRos(message).status().code(), StatusCode::kUnsupported);
  message.binning_x = 1;
  EXPECT_TRUE(fromRos(message));
  message.roi.width = 100;
  EXPECT_EQ(fromRos(message).status().code(), StatusCode::kUnsupported);
}

TEST(ImuConversion, OrientationIsOptional) {
  ImuSample sample;
  sample.stamp = fromNanoseconds(5);
  sample.angular_velocity = {1, 2, 3};
  sample.linear_acceleration = {4, 5, 6};
  sensor_msgs::Imu message = toRos(sample, "base_link");
  EXPECT_EQ(message.orientation_covariance[0], -1.0);
  EXPECT_FALSE(fromRos(message)->orientation.has_value());
  sample.orientation = Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5);
  message = toRos(sample, "base_link");
  const Result<ImuSample> back = fromRos(message);
  ASSERT_TRUE(back && back->orientation);
  EXPECT_TRUE(back->orientation->isApprox(*sample.orientation));
  EXPECT_EQ(back->angular_velocity, sample.angular_velocity);
  EXPECT_EQ(back->linear_acceleration, sample.linear_acceleration);
  EXPECT_EQ(back->stamp, sample.stamp);
  message.orientation = geometry_msgs::Quaternion();  // all zero: drivers that have none
  ASSERT_TRUE(fromRos(message));
  EXPECT_FALSE(fromRos(message)->orientation.has_value());
}

TEST(ImuConversion, RefusesNanAndNonUnitAndAbsent) {
  ImuSample sample;
  sample.orientation = Eigen::Quaterniond::Identity();
  sensor_msgs::Imu message = toRos(sample, "b");
  message.angular_velocity.y = kNaNd;
  EXPECT_EQ(fromRos(message).status().code(), StatusCode::kInvalidInput);
  message = toRos(sample, "b");
  message.orientation.w = 0.5;
  EXPECT_EQ(fromRos(message).status().code(), StatusCode::kInvalidInput);
  message = toRos(sample, "b");
  message.linear_acceleration_covariance[0] = -1.0;
  EXPECT_EQ(fromRos(message).status().code(), StatusCode::kInvalidInput);
}

TEST(ImuConversion, TurningKeepsPhysics) {
  // A sensor mounted a quarter turn about z: its x axis is base y.
  const Eigen::Quaterniond q_base_imu(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()));
  ImuSample sample;
  sample.angular_velocity = Eigen::Vector3d::UnitX();
  sample.orientation = Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()));
  const ImuSample in_base = turned(sample, q_base_imu);
  EXPECT_TRUE(in_base.angular_velocity.isApprox(Eigen::Vector3d::UnitY()));
  // The same direction in the world, whichever frame it is told in.
  EXPECT_TRUE((*in_base.orientation * in_base.angular_velocity)
                  .isApprox(*sample.orientation * sample.angular_velocity));
}

TEST(PoseConversion, GoesThereAndBackAndRefusesNonRigid) {
  const Eigen::Isometry3d T = somePose();
  EXPECT_TRUE(fromRos(toRos(T))->isApprox(T));
  const auto stamped = toRos(T, fromNanoseconds(7), "a", "b");
  EXPECT_EQ(stamped.header.frame_id, "a");
  EXPECT_EQ(stamped.child_frame_id, "b");
  EXPECT_TRUE(fromRos(stamped.transform)->isApprox(T));
  geometry_msgs::Pose pose = toRos(T);
  pose.position.x = kNaNd;
  EXPECT_FALSE(fromRos(pose));
  EXPECT_FALSE(fromRos(geometry_msgs::Pose()));  // quaternion of zeros
  const auto covariance = withCovariance(T, 0.1, 0.2).covariance;
  EXPECT_DOUBLE_EQ(covariance[7], 0.01);
  EXPECT_DOUBLE_EQ(covariance[35], 0.04);
}

TEST(PathConversion, KeepsStampsAndRefusesBackwardOnes) {
  const Trajectory trajectory = {{fromNanoseconds(1), somePose()},
                                 {fromNanoseconds(2), Eigen::Isometry3d::Identity()}};
  nav_msgs::Path path = toRos(trajectory, "map");
  EXPECT_EQ(path.header.frame_id, "map");
  const Result<Trajectory> back = fromRos(path);
  ASSERT_TRUE(back);
  ASSERT_EQ(back->size(), 2U);
  EXPECT_EQ((*back)[1].stamp, fromNanoseconds(2));
  EXPECT_TRUE((*back)[0].T_map_base.isApprox(somePose()));
  std::swap(path.poses[0], path.poses[1]);
  EXPECT_EQ(fromRos(path).status().code(), StatusCode::kInvalidInput);
}

OrganizedCloud someCloud() {
  OrganizedCloud cloud;
  cloud.stamp = fromNanoseconds(123456789);
  cloud.width = 2;
  cloud.height = 2;
  for (int i = 0; i < 4; ++i) {
    const auto f = static_cast<float>(i);
    cloud.cloud.points.emplace_back(i == 2 ? kNaNf : f, 2.0F, 3.0F);
    cloud.cloud.normals.emplace_back(0.0F, 0.0F, i == 3 ? kNaNf : -1.0F);
    cloud.cloud.colors.push_back({static_cast<std::uint8_t>(i), 128, 255});
    cloud.cloud.sigmas.push_back(0.001F * f);
  }
  return cloud;
}

TEST(CloudConversion, OrganisedGoesThereAndBack) {
  const OrganizedCloud cloud = someCloud();
  const sensor_msgs::PointCloud2 message = toRos(cloud, "optical");
  EXPECT_EQ(message.header.frame_id, "optical");
  EXPECT_EQ(message.width, 2U);
  EXPECT_EQ(message.height, 2U);
  EXPECT_EQ(message.point_step, 32U);
  EXPECT_FALSE(message.is_dense);
  const Result<OrganizedCloud> back = fromRos(message);
  ASSERT_TRUE(back) << back.status().message();
  EXPECT_EQ(back->stamp, cloud.stamp);
  EXPECT_EQ(back->width, 2);
  EXPECT_EQ(back->cloud.colors, cloud.cloud.colors);
  EXPECT_EQ(back->cloud.sigmas, cloud.cloud.sigmas);
  EXPECT_TRUE(std::isnan(back->cloud.points[2].x()));
  EXPECT_EQ(back->cloud.points[3], cloud.cloud.points[3]);
  EXPECT_TRUE(std::isnan(back->cloud.normals[3].z()));
}

TEST(CloudConversion, PacksColoursAsRvizWants) {
  const sensor_msgs::PointCloud2 message = toRos(someCloud(), "optical");
  std::uint32_t bits = 0;
  std::memcpy(&bits, message.data.data() + 32 + 24, 4);  // second point, field rgb
  EXPECT_EQ(bits, 0x000180FFU);
}

TEST(CloudConversion, AbsentAttributesHaveNoField) {
  PointCloud cloud;
  cloud.points.emplace_back(1.0F, 2.0F, 3.0F);
  const sensor_msgs::PointCloud2 message = toRos(cloud, makeHeader(Time(), "map"));
  EXPECT_EQ(message.fields.size(), 3U);
  EXPECT_TRUE(message.is_dense);
  const Result<PointCloud> back = pointsFromRos(message);
  ASSERT_TRUE(back);
  EXPECT_FALSE(back->hasNormals());
  EXPECT_EQ(back->points[0], cloud.points[0]);
  EXPECT_TRUE(pointsFromRos(toRos(PointCloud(), makeHeader(Time(), "map")))->empty());
}

TEST(CloudConversion, RefusesBrokenMessages) {
  sensor_msgs::PointCloud2 message = toRos(someCloud(), "optical");
  message.data.resize(message.data.size() - 1);
  EXPECT_EQ(pointsFromRos(message).status().code(), StatusCode::kInvalidInput);
  message = toRos(someCloud(), "optical");
  message.fields[0].name = "a";
  EXPECT_EQ(pointsFromRos(message).status().code(), StatusCode::kInvalidInput);
  message = toRos(someCloud(), "optical");
  message.is_bigendian = true;
  EXPECT_EQ(pointsFromRos(message).status().code(), StatusCode::kUnsupported);
}

TEST(DisparityConversion, FollowsStereoMsgs) {
  StereoCalibration calibration{someCamera(), someCamera()};
  calibration.left.P(0, 2) = 320.0;
  calibration.left.P(0, 3) = 0.0;  // the right one's principal point is at 310: offset 10
  DisparityImage disparity;
  disparity.min_disparity_px = 20.0;
  disparity.max_disparity_px = 60.0;
  disparity.disparity_px = (cv::Mat_<float>(1, 2) << 30.0F, kNaNf);
  const stereo_msgs::DisparityImage message = toRos(disparity, calibration, "optical");
  EXPECT_FLOAT_EQ(message.f, 480.0F);
  EXPECT_FLOAT_EQ(message.T, 0.12F);
  EXPECT_FLOAT_EQ(message.min_disparity, 10.0F);
  EXPECT_FLOAT_EQ(message.max_disparity, 50.0F);
  float values[2];
  std::memcpy(values, message.image.data.data(), sizeof(values));
  EXPECT_FLOAT_EQ(values[0], 20.0F);            // Z = f T / d holds with this one
  EXPECT_LT(values[1], message.min_disparity);  // unknown
}

TEST(MeshConversion, GivesOneColouredTriangleListPerMesh) {
  Mesh mesh;
  mesh.vertices.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.vertices.colors = {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}};
  mesh.faces = {{0, 1, 2}};
  const auto marker = toRos(mesh, makeHeader(Time(), "map"), "mesh", 3);
  EXPECT_EQ(marker.type, visualization_msgs::Marker::TRIANGLE_LIST);
  ASSERT_EQ(marker.points.size(), 3U);
  ASSERT_EQ(marker.colors.size(), 3U);
  EXPECT_EQ(marker.points[1].x, 1.0);
  EXPECT_FLOAT_EQ(marker.colors[2].b, 1.0F);
  EXPECT_FLOAT_EQ(marker.colors[2].a, 1.0F);
}

}  // namespace
}  // namespace scanner::bridge
