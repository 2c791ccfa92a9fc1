// What the nodes do with parameters they cannot use, and the loaders on a real parameter server.
#include <gtest/gtest.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "scanner/ros/parameters.h"
#include "scanner/stereo/options.h"

namespace scanner::bridge {
namespace {

struct Ended {
  int code = -1;
  std::string output;
};

/// Runs a node to its end and keeps what it wrote to stderr; one that keeps running gets SIGINT and
/// its code 124.
Ended run(const std::string& command) {
  Ended ended;
  FILE* pipe = popen(
      ("timeout --signal=INT 20 rosrun scanner " + command + " 2>&1 >/dev/null").c_str(), "r");
  std::array<char, 512> buffer{};
  while (pipe != nullptr && std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) {
    ended.output += buffer.data();
  }
  if (pipe != nullptr) ended.code = WEXITSTATUS(pclose(pipe));
  return ended;
}

class NodeParametersTest : public testing::Test {
 protected:
  NodeParametersTest() { clear(); }
  ~NodeParametersTest() override { clear(); }
  /// Private parameters stay on the server when a node ends.
  void clear() {
    for (const char* name :
         {"/scanner", "/stereo_node", "/inertial_odometry_node", "/registration_node", "/mesh_node",
          "/viewfinder_node", "/replay_node"}) {
      nh_.deleteParam(name);
    }
  }
  void refused(const std::string& command, const std::string& key, const std::string& value) {
    const Ended ended = run(command);
    EXPECT_EQ(ended.code, 1) << command << ": " << ended.output;
    EXPECT_EQ(std::count(ended.output.begin(), ended.output.end(), '\n'), 1) << ended.output;
    EXPECT_NE(ended.output.find(key), std::string::npos) << ended.output;
    EXPECT_NE(ended.output.find(value), std::string::npos) << ended.output;
    clear();
  }
  ros::NodeHandle nh_;
};

TEST_F(NodeParametersTest, OutOfBoundsUnknownAndWrongTypeStopTheNodeWithOneLine) {
  refused("stereo_node _threads:=-1", "threads", "-1");
  refused("stereo_node _nonesuch:=3", "nonesuch", "");
  refused("mesh_node _preview_faces:=many", "preview_faces", "many");
  nh_.setParam("/scanner/stereo/matcher/block/window_px", -13);
  refused("stereo_node", "stereo.matcher.block.window_px", "-13");
  nh_.setParam("/scanner/inertial/gravity", 9.8);
  refused("inertial_odometry_node", "inertial.gravity", "");
}

TEST_F(NodeParametersTest, RigAndFolderThatCannotBeUsedStopTheNodeWithOneLine) {
  refused("registration_node _rig:=/no/such/rig.yaml", "/no/such/rig.yaml", "");
  refused("registration_node _out:=/proc/nowhere", "/proc/nowhere", "");
  refused("replay_node _bag:=/no/such.bag", "/no/such.bag", "no such file");
}

TEST_F(NodeParametersTest, BlocksComeFromTheNamespaceWithThePrivateOnesOnTop) {
  nh_.setParam("/scanner/stereo/matcher/min_disparity_px", 12);
  nh_.setParam("/scanner/stereo/depth/max_depth_m", 7);  // an integer is a fine length
  const ros::NodeHandle private_nh("~");
  private_nh.setParam("stereo/matcher/min_disparity_px", 24);
  private_nh.setParam("other", true);
  stereo::StereoOptions options;
  loadBlock(nh_, private_nh, "stereo", options);
  EXPECT_EQ(options.matcher.min_disparity_px, 24);
  EXPECT_EQ(options.depth.max_depth_m, 7.0);
  EXPECT_EQ(options.matcher.max_disparity_px, stereo::StereoOptions().matcher.max_disparity_px);
  EXPECT_EQ(privateParameters(private_nh, {"stereo"}), ParameterTree::parse(R"({"other": true})"));
  EXPECT_EQ(parameterBlock(nh_, private_nh, "absent"), ParameterTree::object());
  nh_.setParam("/scanner/surface", "text");
  EXPECT_THROW(loadBlock(nh_, private_nh, "surface", options), ConfigurationError);
}

TEST_F(NodeParametersTest, CtrlCEndsANodeCleanly) {
  for (const char* node : {"stereo_node", "inertial_odometry_node", "registration_node",
                           "mesh_node", "viewfinder_node"}) {
    const std::string command =
        std::string("timeout --signal=INT --preserve-status 3 rosrun scanner ") + node +
        " >/dev/null 2>&1";
    EXPECT_EQ(WEXITSTATUS(std::system(command.c_str())), 0) << node;
  }
}

}  // namespace
}  // namespace scanner::bridge

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "node_parameters_test");
  const ros::NodeHandle keep_running;
  return RUN_ALL_TESTS();
}
