#include "scanner/simulation/simulation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <opencv2/imgproc.hpp>

#include "scanner/simulation/frame_store.h"
#include "support/temporary_folder.h"

namespace scanner::simulation {
namespace {

/// Small enough for a test: the published rig at a quarter of its resolution.
SimulationOptions smallOptions() {
  SimulationOptions options;
  options.scene.detail_m = 0.01;
  options.scene.background = false;
  options.rig.width_px = 256;
  options.rig.height_px = 192;
  options.motion.views = 4;
  options.render.samples = 1;
  return options;
}

bool samePixels(const Image& a, const Image& b) {
  return a.data.size() == b.data.size() && cv::norm(a.data, b.data, cv::NORM_INF) == 0.0;
}

class SmallSimulation : public ::testing::Test {
 protected:
  static const Simulation& simulation() {
    static const Simulation instance("artwork", smallOptions(), 7, Time(fromSeconds(100.0)), 2);
    return instance;
  }
};

TEST_F(SmallSimulation, SameSeedSameBytesWhateverTheThreads) {
  const Simulation again("artwork", smallOptions(), 7, Time(fromSeconds(100.0)), 1);
  const StereoFrame a = simulation().frame(1), b = again.frame(1);
  EXPECT_TRUE(samePixels(a.left, b.left));
  EXPECT_TRUE(samePixels(a.right, b.right));
  ASSERT_EQ(simulation().samples().size(), again.samples().size());
  EXPECT_EQ(simulation().samples()[50].imu.angular_velocity,
            again.samples()[50].imu.angular_velocity);
}

TEST_F(SmallSimulation, AnotherSeedIsAnotherScan) {
  const Simulation other("artwork", smallOptions(), 8, Time(fromSeconds(100.0)), 2);
  EXPECT_FALSE(samePixels(simulation().frame(0).left, other.frame(0).left));
  EXPECT_NE(simulation().samples()[50].imu.angular_velocity,
            other.samples()[50].imu.angular_velocity);
}

TEST_F(SmallSimulation, PicturesAreWellExposed) {
  const StereoFrame frame = simulation().frame(0);
  const double mean = cv::mean(frame.left.data)[0];
  EXPECT_GT(mean, 50.0);
  EXPECT_LT(mean, 190.0);
  const double saturated = cv::countNonZero(frame.left.data == 255);
  EXPECT_LT(saturated, 0.05 * static_cast<double>(frame.left.data.total()));
  EXPECT_NEAR(mean, cv::mean(frame.right.data)[0], 10.0);  // both eyes alike
}

TEST_F(SmallSimulation, TruthHoldsEveryViewExactly) {
  const Trajectory truth = simulation().truth();
  for (int view = 0; view < simulation().views(); ++view) {
    const Time stamp = simulation().viewStamp(view);
    const auto found = std::find_if(truth.begin(), truth.end(),
                                    [&](const StampedPose& pose) { return pose.stamp == stamp; });
    ASSERT_NE(found, truth.end());
    const Eigen::Isometry3d exact =
        simulation().motion().at(simulation().viewTime(view)).T_map_base;
    EXPECT_LT((found->T_map_base.translation() - exact.translation()).norm(), 1e-6);
  }
  EXPECT_TRUE(std::is_sorted(truth.begin(), truth.end(),
                             [](const auto& a, const auto& b) { return a.stamp < b.stamp; }));
}

TEST_F(SmallSimulation, ObjectIsInThePicture) {
  const Renderer renderer(simulation().scene(), simulation().options().render, 2);
  for (int view = 0; view < simulation().views(); ++view) {
    const Eigen::Isometry3d T_map_camera =
        simulation().motion().at(simulation().viewTime(view)).T_map_base *
        simulation().rig().T_base_camera;
    const cv::Mat depth =
        renderer.rectifiedDepth(simulation().rig().calibration.left, T_map_camera, true);
    int seen = 0;
    for (const float z : cv::Mat_<float>(depth)) seen += std::isfinite(z);
    EXPECT_GT(seen, 0.2 * static_cast<double>(depth.total())) << "view " << view;
  }
}

TEST_F(SmallSimulation, FrameStoreShowsWhatTheSimulationRenders) {
  FrameStore store(simulation());
  ASSERT_TRUE(store.waitForAll(std::chrono::minutes(2)));
  const auto frame = store.frame(2, simulation().exposure());
  ASSERT_TRUE(frame);
  const StereoFrame direct = simulation().frame(2);
  // Half floats round to 0.05 %, which moves a few pixels by one grey level.
  EXPECT_LE(cv::norm(frame->left.data, direct.left.data, cv::NORM_INF), 1.0);
  EXPECT_EQ(frame->stamp, direct.stamp);
}

TEST_F(SmallSimulation, SkippedViewsAreNotRendered) {
  FrameStore store(simulation());
  store.skipBefore(3);
  EXPECT_FALSE(store.waitForAll(std::chrono::milliseconds(1)));
  while (!store.has(3)) store.waitForAll(std::chrono::milliseconds(20));
  EXPECT_LT(store.rendered(), simulation().views());
}

TEST(SimulationOptionsTest, NoiseFreeKeepsTheOptics) {
  const SimulationOptions options = noiseFree(SimulationOptions());
  EXPECT_FALSE(options.sensor.noise);
  EXPECT_TRUE(options.rig.distortion);
  EXPECT_EQ(options.imu.gyro_noise_deg_s_sqrthz, 0.0);
  EXPECT_EQ(options.imu.bandwidth_hz, 0.0);
}

TEST(SimulationOptionsTest, FilesAreCheckedKeyByKey) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "rig.yaml";
  std::ofstream(path) << "simulation:\n  motion: {views: 7}\n  render: {samples: 9}\n";
  const SimulationOptions options = loadSimulation(path);
  EXPECT_EQ(options.motion.views, 7);
  EXPECT_EQ(options.render.samples, 9);
  std::ofstream(path) << "simulation:\n  motion: {vews: 7}\n";
  try {
    loadSimulation(path);
    FAIL() << "an unknown key was accepted";
  } catch (const ConfigurationError& error) {
    EXPECT_NE(std::string(error.what()).find("simulation.motion.vews"), std::string::npos)
        << error.what();
  }
}

TEST(SimulationOptionsTest, UnknownScenesAreRefused) {
  EXPECT_THROW(Simulation("no_such_scene", smallOptions(), 1, Time(), 1), ConfigurationError);
}

}  // namespace
}  // namespace scanner::simulation
