// A recording through the nodes (replay.test has them up) and through scan_bag's code: the same
// files.
#include "scanner/ros/replay.h"

#include <gtest/gtest.h>
#include <ros/init.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "ros/bag_writer.h"
#include "scanner/core/trajectory_io.h"
#include "scanner/ros/offline_scan.h"
#include "support/temporary_folder.h"

namespace scanner::bridge {
namespace {

std::string contents(const std::string& path) {
  std::ostringstream out;
  out << std::ifstream(path, std::ios::binary).rdbuf();
  return out.str();
}

TEST(Replay, GivesTheSameFilesAsScanBag) {
  const test::SyntheticRig rig;
  const test::TemporaryFolder folder;
  test::BagWriter writer;
  writer.frames = 5;
  const std::string bag = folder / "recording.bag";
  writer.write(bag, rig);

  ros::NodeHandle nh;
  ReplayOptions options;
  options.bag = bag;
  options.rate = 2.0;
  options.out = folder / "live";
  const Result<std::string> lines = replay(nh, options);
  ASSERT_TRUE(lines) << lines.status().message();
  EXPECT_NE(lines->find("5 of 5 views registered"), std::string::npos) << *lines;

  OfflineScanRequest request;
  request.bag = bag;
  request.config = SCANNER_SOURCE_DIR "/test/ros/chain_config.yaml";
  request.out = folder / "offline";
  const std::atomic<bool> stop{false};
  scanBag(
      request, [](std::size_t, std::size_t, std::size_t) {}, stop);
  const Result<Trajectory> live = readTum(folder / "live/trajectory.tum");
  ASSERT_TRUE(live);
  EXPECT_EQ(live->size(), 5U);
  for (const char* name : {"/trajectory.tum", "/views/view_004.ply", "/model.ply"}) {
    EXPECT_FALSE(contents(options.out + name).empty()) << name;
    EXPECT_EQ(contents(options.out + name), contents(request.out + name)) << name;
  }
  const auto live_report = nlohmann::json::parse(contents(options.out + "/report.json"));
  const auto report = nlohmann::json::parse(contents(request.out + "/report.json"));
  for (const char* part :
       {"views", "groups", "trials", "prior", "truth", "loop", "model", "tables"}) {
    EXPECT_EQ(live_report[part], report[part]) << part;
  }
  // The stereo node does not tell how long it took.
  EXPECT_TRUE(live_report["time_s"]["stereo"].is_null());
  EXPECT_GT(live_report["time_s"]["surface"], 0.0);
  EXPECT_NE(contents(options.out + "/report.html").find("<section id=\"model\">"),
            std::string::npos);
}

}  // namespace
}  // namespace scanner::bridge

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "replay_test");
  return RUN_ALL_TESTS();
}
