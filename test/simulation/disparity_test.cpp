// The simulated pictures against the exact depth, through the stereo stage.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "scanner/simulation/simulation.h"
#include "scanner/stereo/stereo_processor.h"

namespace scanner::simulation {
namespace {

/// Absolute errors of the block matcher's disparity, pixels, where both are known.
std::vector<double> blockMatchingErrors(const Simulation& simulation, int view) {
  const StereoCalibration& cameras = simulation.rig().calibration;
  stereo::StereoOptions options;
  options.matcher.method = stereo::MatchMethod::kBlock;
  options.matcher.min_disparity_px = 80;
  options.matcher.max_disparity_px = 335;
  const stereo::StereoProcessor stereo(cameras, options, 2);
  const Result<stereo::StereoProcessor::Output> output = stereo.process(simulation.frame(view));
  if (!output) return {};
  RenderOptions unlit;
  unlit.sky_occlusion = false;
  const Renderer renderer(simulation.scene(), unlit, 2);
  const Eigen::Isometry3d T_map_camera =
      simulation.motion().at(simulation.viewTime(view)).T_map_base * simulation.rig().T_base_camera;
  const cv::Mat depth = renderer.rectifiedDepth(cameras.left, T_map_camera, true);
  std::vector<double> errors;
  for (int row = 0; row < depth.rows; ++row) {
    for (int col = 0; col < depth.cols; ++col) {
      const float z = depth.at<float>(row, col);
      const float found = output->disparity.disparity_px.at<float>(row, col);
      if (!std::isfinite(z) || !std::isfinite(found)) continue;
      const double exact = cameras.focalLength() * cameras.baseline() / static_cast<double>(z);
      errors.push_back(std::abs(static_cast<double>(found) - exact));
    }
  }
  return errors;
}

TEST(ArtworkDisparity, BlockMatchingWithoutNoiseAgreesWithTheExactDisparity) {
  SimulationOptions options = noiseFree(SimulationOptions());
  options.motion.views = 2;
  // What is left is the matcher and the renderer: no mosaic, and enough samples for the texture.
  options.sensor.format = PixelFormat::kMono8;
  options.render.samples = 8;
  const Simulation simulation("artwork", options, 1, Time(), 2);
  std::vector<double> errors = blockMatchingErrors(simulation, 0);
  ASSERT_GT(errors.size(), 50000U);
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  RecordProperty("median_error_px", std::to_string(*middle));
  EXPECT_LT(*middle, 0.05);
}

}  // namespace
}  // namespace scanner::simulation
