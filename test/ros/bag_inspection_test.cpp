#include "scanner/ros/bag_inspection.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "ros/bag_writer.h"
#include "support/temporary_folder.h"

namespace scanner::bridge {
namespace {

class BagInspectionTest : public testing::Test {
 protected:
  BagInspectionTest() {
    // The ball of the synthetic rig is 0.5 m away: 84 px at f = 350 px.
    std::ofstream(folder_ / "near.yaml")
        << "stereo: {matcher: {min_disparity_px: 32, max_disparity_px: 112}}\n";
    std::ofstream(folder_ / "far.yaml")
        << "stereo: {matcher: {min_disparity_px: 4, max_disparity_px: 20}}\n";
  }
  BagInspection inspect(const test::BagWriter& writer, const std::string& config = "near.yaml") {
    const std::string path = folder_ / "recording.bag";
    writer.write(path, rig_);
    return inspectBag(path, folder_ / config, 2);
  }
  static std::string all(const std::vector<std::string>& lines) {
    std::string text;
    for (const std::string& line : lines) text += line + '\n';
    return text;
  }

  test::SyntheticRig rig_;
  test::TemporaryFolder folder_;
};

TEST_F(BagInspectionTest, AGoodRecordingCanBeScanned) {
  const BagInspection result = inspect({});
  EXPECT_TRUE(result.scannable()) << all(result.problems);
  EXPECT_EQ(result.statistics.frames, 3U);
  EXPECT_EQ(result.inertial.frames_covered, 3U);
  EXPECT_NEAR(result.inertial.mean_acceleration, 9.82, 0.1);
  EXPECT_GT(result.left.mean, 10.0);
  EXPECT_GT(result.far_m, 0.4);
  EXPECT_LT(result.near_m, 0.7);
  EXPECT_EQ(result.suitability.front().config, folder_ / "near.yaml");
  EXPECT_GT(result.suitability.front().share, 0.6);
  const auto json = nlohmann::json::parse(toJson(result));
  EXPECT_EQ(json["scannable"], true);
  EXPECT_EQ(json["pairs"]["total"], 3);
  EXPECT_NE(toText(result).find("can be scanned"), std::string::npos);
}

TEST_F(BagInspectionTest, SaysWhenTheConfigurationDoesNotSuit) {
  const BagInspection result = inspect({}, "far.yaml");
  EXPECT_FALSE(result.scannable());
  EXPECT_NE(all(result.problems).find("far.yaml"), std::string::npos);
  EXPECT_NE(all(result.problems).find("the scene lies at"), std::string::npos);
  EXPECT_NE(toText(result).find("cannot be scanned"), std::string::npos);
}

TEST_F(BagInspectionTest, SuspectsUnits) {
  test::BagWriter in_g;
  in_g.imu = [](int, sensor_msgs::Imu& imu) {
    imu.linear_acceleration.x /= 9.81;
    imu.linear_acceleration.y /= 9.81;
    imu.linear_acceleration.z /= 9.81;
    return true;
  };
  EXPECT_NE(all(inspect(in_g).problems).find("look like g"), std::string::npos);
  test::BagWriter in_degrees;
  in_degrees.frames = 5;
  in_degrees.imu = [](int, sensor_msgs::Imu& imu) {
    imu.angular_velocity.x *= 57.3;
    imu.angular_velocity.y *= 57.3;
    imu.angular_velocity.z *= 57.3;
    return true;
  };
  EXPECT_NE(all(inspect(in_degrees).problems).find("deg/s"), std::string::npos);
}

TEST_F(BagInspectionTest, SaysWhatIsMissing) {
  test::BagWriter writer;
  writer.imu = [](int, sensor_msgs::Imu&) { return false; };
  EXPECT_NE(all(inspect(writer).problems).find("/mti/imu/data"), std::string::npos);
  writer = {};
  writer.transforms = false;
  const BagInspection no_rig = inspect(writer);
  EXPECT_TRUE(no_rig.scannable()) << all(no_rig.problems);
  EXPECT_NE(all(no_rig.warnings).find("--rig"), std::string::npos);
  writer = {};
  writer.imu = [](int, sensor_msgs::Imu& imu) {
    imu.orientation_covariance[0] = -1.0;
    return true;
  };
  EXPECT_NE(all(inspect(writer).warnings).find("no orientation"), std::string::npos);
}

TEST_F(BagInspectionTest, ClocksThatDoNotMeetAreAProblem) {
  test::BagWriter writer;
  writer.imu = [](int, sensor_msgs::Imu& imu) {
    imu.header.stamp += ros::Duration(3600.0);
    return true;
  };
  EXPECT_NE(all(inspect(writer).problems).find("time span"), std::string::npos);
  writer = {};
  writer.image = [](int, bool left, sensor_msgs::Image& image) {
    if (!left) image.header.stamp += ros::Duration(0.002);
    return true;
  };
  EXPECT_NE(all(inspect(writer).problems).find("same stamp"), std::string::npos);
}

TEST_F(BagInspectionTest, ExposureIsJudged) {
  test::BagWriter writer;
  writer.image = [](int, bool left, sensor_msgs::Image& image) {
    if (left) std::fill(image.data.begin(), image.data.begin() + 20000, 255);
    return true;
  };
  EXPECT_NE(all(inspect(writer).warnings).find("over-exposed"), std::string::npos);
}

TEST_F(BagInspectionTest, ABadFileIsAProblemABadConfigurationThrows) {
  const BagInspection result = inspectBag(folder_ / "absent.bag", folder_ / "near.yaml", 1);
  ASSERT_EQ(result.problems.size(), 1U);
  EXPECT_NE(result.problems.front().find("no such file"), std::string::npos);
  EXPECT_THROW(inspectBag(folder_ / "absent.bag", "nonesuch", 1), ConfigurationError);
}

}  // namespace
}  // namespace scanner::bridge
