// bumblebee_node with an emulated camera: pictures, stamps, calibration, controls, faults, cables.
// Run by bumblebee_node.test, whose nodes wait for the cameras that come and go here.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <gtest/gtest.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <ros/service.h>
#include <ros/spinner.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/SetCameraInfo.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include "ros/bumblebee_fixtures.h"
#include "ros/bumblebee_node_calibration.h"
#include "scanner/BumblebeeConfig.h"
#include "scanner/GetRegister.h"
#include "scanner/SetRegister.h"
#include "scanner/bumblebee/driver.h"
#include "scanner/ros/conversions.h"
#include "scanner/simulation/rig.h"
#include "support/camera_port_lock.h"
#include "support/temporary_folder.h"

namespace scanner::bridge {
namespace {

using namespace test;  // NOLINT(google-build-using-namespace)

class BumblebeeNodeTest : public testing::Test {
 protected:
  BumblebeeNodeTest() : diagnostics_(nh_), spinner_(2) { spinner_.start(); }

  static void SetUpTestSuite() { camera_ = new Camera("SIMNODE1"); }
  static void TearDownTestSuite() {
    delete camera_;
    camera_ = nullptr;
  }

  bool streaming() const { return diagnostics_.value("bumblebee_node", "state") == "streaming"; }
  int count(const std::string& key) const {
    return std::stoi("0" + diagnostics_.value("bumblebee_node", key));
  }

  ros::NodeHandle nh_;
  DiagnosticsInbox diagnostics_;
  ros::AsyncSpinner spinner_;
  static Camera* camera_;
};
Camera* BumblebeeNodeTest::camera_ = nullptr;

TEST_F(BumblebeeNodeTest, PicturesHaveEqualStampsFramesAndTheirCalibration) {
  const PairTopics topics(nh_);
  ASSERT_TRUE(eventually([&] {
    return topics.pairs(12) && topics.left_info.size() >= 12 && topics.right_info.size() >= 12;
  })) << diagnostics_.of("bumblebee_node").message;
  expectRightPictures(topics);
  expectIncreasing(stamps(topics.left));
  expectIncreasing(stamps(topics.right));
  for (const auto& [inbox, frame] : {std::pair(&topics.left, "bumblebee_left_optical"),
                                     std::pair(&topics.right, "bumblebee_right_optical")}) {
    const sensor_msgs::Image& image = *inbox->all().front();
    EXPECT_EQ(image.encoding, "bayer_rggb8");
    EXPECT_EQ(image.header.frame_id, frame);
    EXPECT_EQ(image.step, static_cast<unsigned>(kWidth));
    EXPECT_NEAR((ros::Time::now() - image.header.stamp).toSec(), 0.0, kPatience_s);
  }
  const sensor_msgs::CameraInfo left = *topics.left_info.all().back();
  const sensor_msgs::CameraInfo right = *topics.right_info.all().back();
  expectCamera(left, 170.5, 0.0);
  expectCamera(right, 169.5, -20.16);
  EXPECT_EQ(left.header.frame_id, "bumblebee_left_optical");
  EXPECT_EQ(right.header.frame_id, "bumblebee_right_optical");
  const std::vector<Time> images = stamps(topics.left);
  for (const Time stamp : {fromRos(left.header.stamp), fromRos(right.header.stamp)}) {
    EXPECT_TRUE(eventually([&] {
      const std::vector<Time> now = stamps(topics.left);
      return std::find(now.begin(), now.end(), stamp) != now.end();
    }));
  }
}

TEST_F(BumblebeeNodeTest, TfKnowsTheRightEye) {
  tf2_ros::Buffer buffer;
  const tf2_ros::TransformListener listener(buffer, nh_, false);
  ASSERT_TRUE(eventually([&] {
    return buffer.canTransform("bumblebee_left_optical", "bumblebee_right_optical", ros::Time());
  }));
  const auto T = fromRos(
      buffer.lookupTransform("bumblebee_left_optical", "bumblebee_right_optical", ros::Time())
          .transform);
  ASSERT_TRUE(T);
  // Left R is the identity, right R turns by atan2(0.6, 0.8) about x.
  EXPECT_LT((T->translation() - Eigen::Vector3d(0.12, 0.0, 0.0)).norm(), 1e-9);
  EXPECT_LT((T->linear() * Eigen::Vector3d::UnitY() - Eigen::Vector3d(0.0, 0.8, 0.6)).norm(), 1e-9);
}

TEST_F(BumblebeeNodeTest, ReconfiguringReachesTheCamera) {
  const auto set = [](double exposure_s, double gain_db) {
    dynamic_reconfigure::Reconfigure call;
    const std::pair<const char*, double> wanted[] = {{"exposure_s", exposure_s},
                                                     {"gain_db", gain_db}};
    for (const auto& [name, value] : wanted) {
      dynamic_reconfigure::DoubleParameter parameter;
      parameter.name = name;
      parameter.value = value;
      call.request.config.doubles.push_back(parameter);
    }
    EXPECT_TRUE(ros::service::call("/bumblebee_node/bumblebee/set_parameters", call));
    std::map<std::string, double> answer;
    for (const auto& parameter : call.response.config.doubles) {
      answer[parameter.name] = parameter.value;
    }
    return answer;
  };
  ASSERT_TRUE(ros::service::waitForService("/bumblebee_node/bumblebee/set_parameters",
                                           ros::Duration(kPatience_s)));
  ASSERT_TRUE(eventually([&] { return diagnostics_.says("bumblebee_node", kOk, "streaming"); }));
  for (const Exposure wanted : {Exposure{0.006, 3.0}, Exposure{0.003, 7.0}}) {
    const auto answer = set(wanted.exposure_s, wanted.gain_db);
    EXPECT_EQ(answer.at("exposure_s"), wanted.exposure_s);
    EXPECT_EQ(answer.at("rate_hz"), 12.0) << "the others stay";
    EXPECT_TRUE(eventually([&] {
      const Exposure now = camera_->exposure();
      return std::abs(now.exposure_s - wanted.exposure_s) < 1e-5 &&
             std::abs(now.gain_db - wanted.gain_db) < 0.51;
    })) << camera_->exposure().exposure_s
        << " s, " << camera_->exposure().gain_db << " dB";
  }
  double kept = 0.0;
  EXPECT_TRUE(nh_.getParam("/bumblebee_node/bumblebee/exposure_s", kept));
  EXPECT_EQ(kept, 0.003) << "for a node that is started anew";
}

TEST_F(BumblebeeNodeTest, ACameraWithoutIidcRegistersSaysSo) {
  ASSERT_TRUE(eventually([&] { return streaming(); }));
  GetRegister get;
  get.request.offset = 0x1048;
  ASSERT_TRUE(ros::service::call("/bumblebee_node/get_register", get));
  EXPECT_FALSE(get.response.success);
  EXPECT_FALSE(get.response.message.empty());
  SetRegister set;
  set.request.offset = 0x1048;
  ASSERT_TRUE(ros::service::call("/bumblebee_node/set_register", set));
  EXPECT_FALSE(set.response.success);
  EXPECT_FALSE(set.response.message.empty());
}

TEST_F(BumblebeeNodeTest, LostPacketsAreCountedAndSpoilNoPicture) {
  ASSERT_TRUE(eventually([&] { return diagnostics_.says("bumblebee_node", kOk, "streaming"); }));
  EXPECT_EQ(diagnostics_.of("bumblebee_node").hardware_id, "SIMNODE1");
  const PairTopics topics(nh_);
  camera_->device().setLostPackets(0.02);
  EXPECT_TRUE(eventually([&] { return diagnostics_.says("bumblebee_node", kWarn, "dropped"); }))
      << diagnostics_.of("bumblebee_node").message;
  EXPECT_TRUE(eventually([&] { return topics.pairs(5); }));
  camera_->device().setLostPackets(0.0);
  EXPECT_GT(count("dropped"), 0);
  EXPECT_GT(count("damaged"), 0);
  EXPECT_TRUE(eventually([&] { return count("lost packets") > 0; }));
  expectRightPictures(topics);
  expectIncreasing(stamps(topics.left));
}

/// Exit code and standard output.
std::pair<int, std::string> run(const std::string& arguments) {
  std::string output;
  FILE* pipe = popen(("rosrun scanner bumblebee_node " + arguments + " 2>&1").c_str(), "r");
  std::array<char, 512> buffer{};
  while (pipe != nullptr && std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) {
    output += buffer.data();
  }
  const int code = pipe != nullptr ? WEXITSTATUS(pclose(pipe)) : -1;
  return {code, output};
}

TEST_F(BumblebeeNodeTest, ACameraInUseIsListedButCannotBeProbed) {
  ASSERT_TRUE(eventually([&] { return streaming(); }));
  const int connections = count("connections");
  const auto [listed, cameras] = run("--list __name:=listing");
  EXPECT_EQ(listed, 0);
  EXPECT_NE(cameras.find("SIMNODE1"), std::string::npos) << cameras;
  const auto [code, line] = run("--probe SIMNODE1");
  EXPECT_EQ(code, 1) << line;
  EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 1) << line;
  const int pairs = count("pairs");
  EXPECT_TRUE(eventually([&] { return count("pairs") > pairs + 12; }));
  EXPECT_EQ(count("connections"), connections) << "whoever streams is not disturbed";
}

TEST_F(BumblebeeNodeTest, TheCableOutAndInAgain) {
  const PairTopics topics(nh_);
  ASSERT_TRUE(eventually([&] { return topics.pairs(3); }));
  camera_->device().unplug();
  EXPECT_TRUE(eventually(
      [&] { return diagnostics_.of("bumblebee_node").level == kError && !streaming(); }));
  const std::size_t before = topics.left.size();
  camera_->device().plug();
  EXPECT_TRUE(eventually([&] { return topics.pairs(before + 5); }))
      << diagnostics_.of("bumblebee_node").message;
  EXPECT_TRUE(eventually([&] { return diagnostics_.of("bumblebee_node").level < kError; }));
  EXPECT_GE(count("connections"), 2);
  expectRightPictures(topics);
  expectIncreasing(stamps(topics.left));
  EXPECT_TRUE(eventually([&] { return camera_->exposure().exposure_s < 0.0035; }))
      << "settings are kept over the cable";
}

class BumblebeeCalibrationTest : public BumblebeeNodeTest {
 protected:
  static void SetUpTestSuite() {}
  static void TearDownTestSuite() {}

  bool set(const std::string& eye, sensor_msgs::CameraInfo info) {
    sensor_msgs::SetCameraInfo call;
    call.request.camera_info = std::move(info);
    return ros::service::call("/uncalibrated/bumblebee/" + eye + "/set_camera_info", call) &&
           call.response.success;
  }
};

TEST_F(BumblebeeCalibrationTest, WithoutABaselineThereAreImagesAndNoCameraInfo) {
  const Camera camera("SIMNODE2");
  const PairTopics topics(nh_, "/without_baseline");
  const std::string node = "without_baseline/bumblebee_node";
  EXPECT_TRUE(eventually([&] { return topics.pairs(5); })) << diagnostics_.of(node).message;
  EXPECT_TRUE(eventually([&] { return diagnostics_.says(node, kError, "P[3]"); }))
      << diagnostics_.of(node).message;
  EXPECT_EQ(topics.left_info.size() + topics.right_info.size(), 0U);
}

TEST_F(BumblebeeCalibrationTest, AFreeCameraCanBeProbed) {
  const Camera camera("SIMFREE");
  const auto [code, text] = run("--probe SIMFREE");
  EXPECT_EQ(code, 0) << text;
  for (const char* part :
       {"serial: SIMFREE", "model: Bumblebee2", "pixels: ", "registers: false"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
  }
}

TEST_F(BumblebeeCalibrationTest, ACalibrationCanBeSetWhileStreaming) {
  const Camera camera("SIMNODE3");
  const PairTopics topics(nh_, "/uncalibrated");
  const std::string node = "uncalibrated/bumblebee_node";
  EXPECT_TRUE(eventually([&] { return diagnostics_.says(node, kError, "not calibrated"); }))
      << diagnostics_.of(node).message;
  EXPECT_TRUE(eventually([&] { return topics.pairs(3); }));
  EXPECT_EQ(topics.left_info.size() + topics.right_info.size(), 0U);

  CameraModel model;
  model.width = kWidth;
  model.height = kHeight;
  model.D = {-0.31, 0.0, 0.0, 0.0, 0.0};
  model.K << 170.5, 0.0, 80.0, 0.0, 170.5, 60.0, 0.0, 0.0, 1.0;
  model.P << 168.0, 0.0, 80.0, 0.0, 0.0, 168.0, 60.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  ASSERT_TRUE(set("left", toRos(model, {})));
  model.P(0, 3) = 20.16;  // the cables of the eyes mixed up
  ASSERT_TRUE(set("right", toRos(model, {})));
  EXPECT_TRUE(eventually([&] { return diagnostics_.says(node, kError, "P[3]"); }));
  EXPECT_EQ(topics.right_info.size(), 0U);

  model.P(0, 3) = -20.16;
  ASSERT_TRUE(set("right", toRos(model, {})));
  ASSERT_TRUE(eventually([&] { return topics.right_info.size() >= 2; }));
  expectCamera(*topics.right_info.all().front(), 170.5, -20.16);
  EXPECT_TRUE(eventually([&] { return diagnostics_.of(node).level < kError; }));

  model.width = 2 * kWidth;
  ASSERT_TRUE(set("right", toRos(model, {})));
  EXPECT_TRUE(eventually([&] { return diagnostics_.says(node, kError, "320x120"); }));
}

std::string eyeText(const CameraModel& camera) {
  const Eigen::IOFormat flow(17, Eigen::DontAlignCols, ",", ",", "", "", "[", "]");
  std::ostringstream text;
  text << "\n  size: [" << camera.width << "," << camera.height
       << "]\n  K: " << camera.K.format(flow) << "\n  R: " << camera.R.format(flow)
       << "\n  P: " << camera.P.format(flow) << "\n  D: "
       << Eigen::Map<const Eigen::VectorXd>(camera.D.data(),
                                            static_cast<Eigen::Index>(camera.D.size()))
              .format(flow)
       << "\n";
  return text.str();
}

TEST(RigFileTest, ItsCamerasAreTheCalibrationWhereTheyFit) {
  const simulation::SimulatedRig rig = simulation::makeRig({}, 3);
  const TemporaryFolder folder;
  BumblebeeNodeOptions options;
  options.rig = folder / "rig.yaml";
  std::ofstream(options.rig) << "T_base_link_bumblebee_left_optical:\n  translation: [0, 0, 0]\n"
                                "  rotation_xyzw: [0, 0, 0, 1]\nleft:"
                             << eyeText(rig.calibration.left)
                             << "right:" << eyeText(rig.calibration.right);
  BumblebeeCalibration calibration(ros::NodeHandle("rig_file"), options);
  calibration.useCamera("1234567");
  const int width = rig.calibration.left.width, height = rig.calibration.left.height;
  const Time stamp = fromRos(ros::Time::now());
  EXPECT_FALSE(calibration.infos(width / 2, height / 2, stamp));
  EXPECT_EQ(calibration.verdict().state, BumblebeeCalibration::State::kRefused);
  EXPECT_NE(calibration.verdict().reason.find("512x384"), std::string::npos);
  const auto infos = calibration.infos(width, height, stamp);
  ASSERT_TRUE(infos) << calibration.verdict().reason;
  EXPECT_EQ(infos->first.K[0], rig.calibration.left.K(0, 0));
  EXPECT_EQ(infos->second.P[3], rig.calibration.right.P(0, 3));
  EXPECT_TRUE(rightInLeft(rig.calibration).isApprox(rig.T_left_right, 1e-9))
      << "as the simulated rig has it";
}

TEST(BumblebeeConfigTest, NamesDefaultsAndBoundsAreTheDriversOptions) {
  bumblebee::DriverOptions options;
  BoundsOf described;
  describe(described, options);
  const auto values = [](const BumblebeeConfig& config) {
    dynamic_reconfigure::Config message;
    config.__toMessage__(message);
    std::map<std::string, double> found;
    for (const auto& parameter : message.doubles) found[parameter.name] = parameter.value;
    return found;
  };
  const auto lowest = values(BumblebeeConfig::__getMin__());
  const auto highest = values(BumblebeeConfig::__getMax__());
  const auto normal = values(BumblebeeConfig::__getDefault__());
  EXPECT_EQ(normal.size(), 7U);
  EXPECT_EQ(BumblebeeConfig::__getDefault__().auto_exposure, options.auto_exposure);
  for (const auto& [name, value] : normal) {
    ASSERT_EQ(described.bounds.count(name), 1U) << name;
    EXPECT_EQ(value, described.defaults.at(name)) << name;
    EXPECT_EQ(lowest.at(name), described.bounds.at(name).min) << name;
    EXPECT_EQ(highest.at(name), described.bounds.at(name).max) << name;
  }
}

}  // namespace
}  // namespace scanner::bridge

int main(int argc, char** argv) {
  const scanner::test::CameraPortLock alone;
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "bumblebee_node_test");
  const ros::NodeHandle keep_running;
  return RUN_ALL_TESTS();
}
